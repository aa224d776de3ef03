"""Whether a program carries what its correction was computed for: with another weight the joints give way otherwise."""

from __future__ import annotations

import numpy as np

from truepath.calibration import Calibration
from truepath.controller import Controller
from truepath.deploying.load import TOLD_KG, Load, bare_arm, calibrated_load
from truepath.deploying.settings import PAYLOAD, settings_in
from truepath.guards import Finding
from truepath.kinematics.effect_rows import MOMENTS
from truepath.programs.program import Program
from truepath.virtual.controller.script_instructions import ScriptError, SetPayload

# On the flange, the tool included: Universal Robots, data sheets of the CB series.
RATED_KG = {"ur5": 5.0, "ur10": 10.0}


def payload_findings(program: Program, calibration: Calibration, controller: Controller) -> list[Finding]:
    """Warnings about more than the arm can carry, and payloads of the program that the correction was not made for.

    The latter only where the calibration contains an effect that depends on the load.
    """
    load = calibrated_load(calibration, controller)
    findings = [] if load is None else _too_heavy(load, calibration)
    if not depends_on_the_load(calibration) or not any(word in program.text for word in PAYLOAD):
        return findings
    text = program.text.removeprefix("\ufeff")
    try:
        settings = settings_in(text)
    except (ScriptError, ValueError, RecursionError):  # what the reader of corrections takes, this one may not
        message = "where the program sets a payload cannot be read, so it is not compared with that of the correction"
        return [*findings, Finding("warning", "payload", None, message)]
    for each in settings.payloads:
        findings += _another(each, load, calibration)
    lines = text.split("\n")
    unclear = [line for line in settings.unclear if any(word in lines[line - 1] for word in PAYLOAD)]
    return [*findings, *(_unclear(line, load) for line in unclear)]


def depends_on_the_load(calibration: Calibration) -> bool:
    """Whether an effect of the calibration depends on what the robot carries."""
    return any(name in MOMENTS for effect in calibration.effects for name in effect.fitted().term.inputs)


def _another(stated: SetPayload, load: Load | None, calibration: Calibration) -> list[Finding]:
    its = Load(stated.mass_kg, None if stated.centre_m is None else np.array(stated.centre_m))
    if load is None:
        message = (
            f"the program sets a payload of {its}; what the calibrated arm carries is not known, so it is not compared"
        )
        return [Finding("warning", "payload", stated.line, message)]
    if its.is_like(load):
        return []
    message = (
        f"the program sets a payload of {its}, the correction is for {load}: how far the joints give way under the "
        f"load is corrected wrongly; {_what_fits(its, load, calibration)}"
    )
    return [Finding("warning", "payload", stated.line, message, its.mass_kg, load.mass_kg, "kg")]


def _what_fits(its: Load, load: Load, calibration: Calibration) -> str:
    """Which --payload-kg would be right; the load already has the present one in it."""
    tool_kg = load.mass_kg - calibration.data.payload_kg
    beyond_kg = its.mass_kg - tool_kg
    if abs(its.mass_kg - load.mass_kg) <= TOLD_KG:
        return "the weights are the same, but not their centres, which --payload-kg cannot state"
    if beyond_kg < -TOLD_KG:
        return f"the tool of the model alone is {tool_kg:.2f} kg, so no --payload-kg fits"
    return f"--payload-kg {max(beyond_kg, 0.0):.2f} fits"


def _unclear(line: int, load: Load | None) -> Finding:
    wanted = "" if load is None else f", {load}"
    message = f"the program computes the payload that it sets: it is not compared with that of the correction{wanted}"
    return Finding("warning", "payload", line, message)


def _too_heavy(load: Load, calibration: Calibration) -> list[Finding]:
    arm = bare_arm(calibration.model.robot)
    rated_kg = None if arm is None else RATED_KG.get(arm.name)
    if arm is None or rated_kg is None or load.mass_kg <= rated_kg:
        return []
    beyond = calibration.data.payload_kg
    message = (
        f"the correction is for {load.mass_kg:.2f} kg on the flange ({load.mass_kg - beyond:.2f} kg tool, {beyond:.2f} "
        f"kg beyond it: --payload-kg), and a {arm.name.upper()} is built for {rated_kg:g} kg"
    )
    return [Finding("warning", "payload-rating", None, message, load.mass_kg, rated_kg, "kg")]
