"""Effects in the calibration file: every kind comes back as it was, and what makes no sense is refused."""

import hashlib
import json

import numpy as np
import pytest
from command import is_refused
from truepath.calibration import Calibration, load_calibration
from truepath.calibration_parts import EffectPart
from truepath.context import Context
from truepath.effects import EFFECTS
from truepath.effects.base import FittedTerm
from truepath.errors import InputError
from truepath.learn import learn
from truepath.plants import models_dir

RANGE = {"lower_rad": -1.0, "upper_rad": 1.0}
TURN = {"start": 0.0, "end": 100.0}


@pytest.fixture(scope="module")
def plain(real_ur5, clean):
    """A calibration without effects."""
    return learn(real_ur5.robot, clean.subset(np.arange(60)))[0]


@pytest.fixture(scope="module")
def content(plain):
    """Its JSON content."""
    return json.loads(plain.to_json())


@pytest.fixture(scope="module")
def every_kind(real_ur5, clean_kinematic):
    """Terms of every effect, with values and deviations: the first form, and one with a moment if there is one."""
    rng, fitted = np.random.default_rng(0), []
    for effect in EFFECTS.values():
        forms = effect.alternatives(real_ur5.robot, clean_kinematic.context)
        for term in (*forms[0], *(forms[-1] if len(forms) > 1 else ())):
            k = len(term.parameters)
            fitted.append(FittedTerm(term, 1e-4 * rng.normal(size=k), 1e-6 * rng.random(k)))
    return fitted


def part(name, moves, joint, inputs, constants, parameters, unit="rad"):
    """An effect as it stands in a file; parameters by name."""
    numbers = [{"name": each, "value": 1e-4, "sigma": 1e-6, "unit": unit} for each in parameters]
    return {
        "name": name,
        "moves": moves,
        "joint": joint,
        "inputs": list(inputs),
        "constants": constants,
        "cause": "a cause",
        "remedy": "a remedy",
        "parameters": numbers,
    }


@pytest.fixture
def with_effect(content, tmp_path):
    """Function: a file with one effect, and a checksum as somebody would write it who knows how."""

    def write(effect, **data):
        changed = {name: value for name, value in content.items() if name != "checksum"}
        changed |= {"effects": [effect] if effect else [], "data": {**changed["data"], **data}}
        canonical = json.dumps(changed, sort_keys=True, separators=(",", ":"))
        path = tmp_path / "calibration.json"
        path.write_text(json.dumps({**changed, "checksum": hashlib.sha256(canonical.encode()).hexdigest()}))
        return path

    return write


def with_effects(calibration, effects):
    """The same calibration with these effects."""
    content = calibration.model_dump(by_alias=True)
    return Calibration.model_validate({**content, "effects": [effect.model_dump() for effect in effects]})


# What comes back


def test_effects_of_every_kind_are_saved_and_loaded_to_the_last_bit(plain, every_kind, clean_kinematic, tmp_path):
    effects = [EffectPart.of(fitted) for fitted in every_kind]
    assert {effect.name for effect in effects} == set(EFFECTS)
    calibration = with_effects(plain, effects)
    calibration.save(tmp_path / "c.json")
    loaded = load_calibration(tmp_path / "c.json")
    assert loaded.effects == effects
    for before, after in zip(every_kind, loaded.model.effects, strict=True):
        assert (after.term.moves, after.term.joint, after.term.inputs, after.term.constants) == (
            before.term.moves,
            before.term.joint,
            before.term.inputs,
            before.term.constants,
        )
        np.testing.assert_array_equal(after.values, before.values)
        np.testing.assert_array_equal(after.sigma, before.sigma)


def test_a_loaded_calibration_predicts_with_every_effect_what_it_did_before(
    plain, every_kind, clean_kinematic, tmp_path
):
    before = with_effects(plain, [EffectPart.of(fitted) for fitted in every_kind])
    before.save(tmp_path / "c.json")
    loaded, whole = load_calibration(tmp_path / "c.json").model, clean_kinematic.context
    for poses in (whole, Context(whole.q_rad), whole.q_rad):
        np.testing.assert_array_equal(loaded.predict(poses), before.model.predict(poses))
    assert np.abs(loaded.predict(whole) - plain.model.predict(whole)).max() > 1e-5


def test_the_file_says_of_an_effect_what_it_moves_what_it_depends_on_why_and_what_to_do(every_kind):
    for fitted in every_kind:
        effect = EffectPart.of(fitted)
        assert effect.moves in ("joint", "axis", "base", "probe", "robot lengths", "measured lengths")
        assert effect.inputs == list(fitted.term.inputs)
        assert effect.constants == dict(fitted.term.constants)
        assert (effect.cause, effect.remedy) == (EFFECTS[effect.name].cause, EFFECTS[effect.name].remedy)


@pytest.mark.parametrize(
    "effect",
    [
        part("joint_compliance", "joint", 2, ["gravity_torque"], RANGE, ["compliance"], "rad/(N m)"),
        part("transmission_error", "joint", 6, ["theta"], RANGE, ["cos 3", "sin 3", "half-wave 7"]),
        part("backlash", "joint", 1, ["approach"], {}, ["width"]),
        part("tool_shift", "probe", None, ["row"], {"moment": 40.5, "default row": 80.0}, ["x", "z"], "m"),
        part("frame_drift", "base", None, ["time_s"], TURN, ["x order 1", "y order 6"], "m"),
        part("measurement_scale", "measured lengths", None, [], {}, ["scale"], "m/m"),
    ],
    ids=lambda effect: effect["name"],
)
def test_an_effect_that_makes_sense_is_taken(with_effect, effect):
    model = load_calibration(with_effect(effect)).model
    assert np.isfinite(model.predict(np.zeros((1, 6)))).all()


# What is refused

SCALE = ("encoder_scale", "joint", 1, ["theta"])
SLIP = ("tool_shift", "probe", None, ["time_s"])
DRIFT = ("frame_drift", "base", None, ["time_s"])
CREEP = ("warmup_drift", "joint", 1, ["time_s"])
NONSENSE = {
    "moves nothing that there is": part("encoder_scale", "elbow", 1, ["theta"], RANGE, ["scale"]),
    "moves a reading": part("tool_shift", "reading", None, ["time_s"], {"moment": 1.0}, ["x"]),
    "moves what it never moves": part("thermal_expansion", "joint", 2, ["temperature_c"], {"reference_c": 20.0}, ["x"]),
    "slips on the base": part("tool_shift", "base", None, ["time_s"], {"moment": 1.0}, ["x"]),
    "no joint": part("encoder_scale", "joint", None, ["theta"], RANGE, ["scale"]),
    "a joint too many": part("tool_shift", "probe", 3, ["time_s"], {"moment": 1.0}, ["x"]),
    "joint 0": part("encoder_scale", "joint", 0, ["theta"], RANGE, ["scale"]),
    "joint 7 of 6": part("encoder_scale", "joint", 7, ["theta"], RANGE, ["scale"]),
    "a reading that there is not": part("encoder_scale", "joint", 1, ["mood"], RANGE, ["scale"]),
    "an angle of joint 9": part("encoder_scale", "joint", 1, ["theta", "q9"], RANGE, ["scale"]),
    "without its input": part("encoder_scale", "joint", 1, [], RANGE, ["scale"]),
    "with the input of another": part(*SLIP[:3], ["temperature_c"], {"moment": 20.0}, ["x"]),
    "without its moment": part(*SLIP, {}, ["x"]),
    "without its reference": part("thermal_expansion", "robot lengths", None, ["temperature_c"], {}, ["expansion"]),
    "a constant for an input": part(*SCALE, {**RANGE, "theta": 3.0}, ["scale"]),
    "a constant that nobody knows": part(*SCALE, {**RANGE, "surprise": 3.0}, ["scale"]),
    "a range upside down": part(*SCALE, {"lower_rad": 1.0, "upper_rad": -1.0}, ["scale"]),
    "half a range": part(*SCALE, {"lower_rad": -1.0}, ["scale"]),
    "a range of no joint": part("measurement_scale", "measured lengths", None, [], RANGE, ["scale"]),
    "a campaign without a span": part(*DRIFT, {"start": 5.0, "end": 5.0}, ["x order 1"]),
    "a campaign that runs backwards": part(*DRIFT, {"start": 5.0, "end": 1.0}, ["x order 1"]),
    "no time constant": part(*CREEP, {**TURN, "default time_s": 100.0, "tau_s": 0.0}, ["creep"]),
    "a negative time constant": part(*CREEP, {**TURN, "default time_s": 100.0, "tau_s": -1e-3}, ["creep"]),
    "play without a way between its sides": part(
        "backlash", "joint", 2, ["gravity_torque"], {**RANGE, "soft_torque": 0.0}, ["width"]
    ),
    "no parameter": part(*SCALE, RANGE, []),
    "a parameter that nobody knows": part(*SCALE, RANGE, ["ratio"]),
    "a parameter too many": part(*SCALE, RANGE, ["scale", "ratio"]),
    "a component that a probe does not have": part(*SLIP, {"moment": 1.0}, ["w"]),
    "an order beyond the last": part(*DRIFT, TURN, ["x order 17"]),
    "a component of an axis that there is not": part("axis_wobble", "axis", 1, ["theta"], RANGE, ["rz cos 1"]),
    "a parameter twice": part(*SLIP, {"moment": 1.0}, ["x", "x"]),
    "another unit": part(*SCALE, RANGE, ["scale"], unit="deg"),
    "a form without a name": part("bending", "axis", 1, ["moment_x", "moment_y"], {}, ["rx moment_x"]),
    "outliers": part("outlier", "joint", 1, ["theta"], RANGE, ["scale"]),
}


@pytest.mark.parametrize("kind", NONSENSE)
def test_an_effect_that_makes_no_sense_is_refused(with_effect, kind):
    path = with_effect(NONSENSE[kind])
    with pytest.raises(InputError, match="the calibration is not valid at ") as caught:
        load_calibration(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("value", [None, ["theta", 3], 1.0, True], ids=str)
@pytest.mark.parametrize("field", ["moves", "inputs", "constants"])
def test_fields_of_another_type_are_refused(with_effect, field, value):
    effect = part(*SCALE, RANGE, ["scale"])
    with pytest.raises(InputError, match=rf"effects\.0\.{field}"):
        load_calibration(with_effect({**effect, field: value}))


@pytest.mark.parametrize("number", [float("nan"), float("inf")], ids=str)
def test_a_constant_that_is_no_number_is_refused(with_effect, number):
    with pytest.raises(InputError, match=r"effects\.0\.constants\.moment"):
        load_calibration(with_effect(part(*SLIP, {"moment": number}, ["x"])))


@pytest.mark.parametrize("field", ["moves", "joint", "inputs", "constants"])
def test_a_missing_field_is_refused_by_name(with_effect, field):
    effect = part(*SCALE, RANGE, ["scale"])
    del effect[field]
    with pytest.raises(InputError, match=rf"effects\.0\.{field}"):
        load_calibration(with_effect(effect))


@pytest.mark.parametrize(
    "kind", ["a reading that there is not", "joint 7 of 6", "half a range", "a range of no joint", "without its input"]
)
def test_a_bad_effect_ends_the_command_with_exit_code_2_and_writes_nothing(truepath, with_effect, kind, tmp_path):
    program, output = models_dir() / "ur5" / "weld_path.csv", tmp_path / "out.csv"
    outcome = truepath("correct", program, "-c", with_effect(NONSENSE[kind]), "-o", output)
    assert is_refused(outcome, "calibration.json", "not valid at")
    assert not output.exists()


# The payload


def test_the_payload_of_the_measurements_is_in_the_file_and_in_the_model(real_ur5, clean):
    some = clean.subset(np.arange(60))
    calibration, *_ = learn(real_ur5.robot, some)
    assert calibration.data.payload_kg == np.median(some.payload_kg)
    assert calibration.model.payload_kg == calibration.data.payload_kg


def test_an_older_file_that_names_no_payload_means_none(content, with_effect):
    assert load_calibration(with_effect(None, payload_kg=0.0)).data.payload_kg == 0.0
    path = with_effect(None)
    changed = json.loads(path.read_text())
    del changed["data"]["payload_kg"], changed["checksum"]
    assert Calibration.model_validate(changed).model.payload_kg == 0.0


@pytest.mark.parametrize("payload", [-0.1, float("nan"), float("inf"), None, "2"], ids=str)
def test_a_payload_that_nobody_can_carry_is_refused(with_effect, payload):
    with pytest.raises(InputError, match=r"data\.payload_kg"):
        load_calibration(with_effect(None, payload_kg=payload))


def test_a_calibration_carries_another_payload_on_request_and_nothing_else_changes(with_effect, real_ur5):
    soft = part(
        "joint_compliance",
        "joint",
        2,
        ["gravity_torque"],
        {"lower_rad": -3.0, "upper_rad": 3.0},
        ["compliance"],
        "rad/(N m)",
    )
    calibration = load_calibration(with_effect(soft))
    q = np.array([[0.0, -1.0, 1.0, 0.0, 0.0, 0.0]])
    before = calibration.model.true_joints(q)
    loaded = calibration.carrying(4.0)
    expected = 1e-4 * real_ur5.robot.gravity_torque(q, 4.0)[0, 1]
    assert loaded.model.true_joints(q)[0, 1] - q[0, 1] == pytest.approx(expected, rel=1e-12)
    assert before[0, 1] != loaded.model.true_joints(q)[0, 1]
    assert calibration.carrying(None) is calibration
    assert loaded.carrying(calibration.data.payload_kg) == calibration
