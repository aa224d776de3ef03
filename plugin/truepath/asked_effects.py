"""What became of the effects that somebody asked for by name."""

from __future__ import annotations

from collections.abc import Sequence

from truepath.calibration_parts import EffectPart
from truepath.context import Context
from truepath.effects import effect_named
from truepath.measurements import Measurements
from truepath.robot import NominalRobot
from truepath.verdict import not_testable

IN_MODEL = "in the model"
ONLY_THESE = "as asked, no other cause was tried: --effects auto, and diagnose, compare all"
STAND_IN = "what is in the model may stand in for a cause that was not tried: repair nothing on this alone"


def became_of(
    names: Sequence[str], robot: NominalRobot, measurements: Measurements, found: Sequence[EffectPart]
) -> dict[str, str]:
    """For each effect asked for: in the model, tried in vain, or not tried and why.

    Args:
        names: of the effects, in the order in which they were asked for.
        robot: nominal robot.
        measurements: the data that were fitted.
        found: effects in the calibration.

    Raises:
        InputError: an unknown effect.
    """
    context = Context.of(measurements)
    blind = {item.effect: item.why for item in not_testable(robot, context)}
    in_model = {effect.name for effect in found}
    told = {}
    for name in names:
        effect = effect_named(name)
        if name in in_model:
            told[name] = IN_MODEL
        elif effect.missing(context) or not effect.terms(robot, context):
            told[name] = f"not tried: {blind.get(name, 'these poses cannot show it')}"
        else:
            told[name] = "tried: the data do not speak for it" + (f" ({blind[name]})" if name in blind else "")
    return told
