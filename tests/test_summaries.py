"""The size of an effect in a few words and in units that people use."""

import numpy as np
import pytest
from truepath.context import Context
from truepath.effects.base import EffectParameter, FittedTerm, Term
from truepath.motions import Moves
from truepath.summaries import summary

POSES = 2000
RANGE = {"lower_rad": -3.2, "upper_rad": 3.2}


@pytest.fixture(scope="module")
def context():
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSES, 6))
    return Context(
        q, time_s=np.linspace(0, 1000, POSES), row=np.arange(POSES) + 2.0, temperature_c=np.full(POSES, 22.0)
    )


@pytest.fixture(scope="module")
def said(context, ur5):
    """Function: the summary of a term; values are triples of a parameter's name, its size and its deviation."""

    def said(effect, moves, joint, inputs, constants, unit, *values):
        parameters = tuple(EffectParameter(name, unit, 1e-4, "any") for name, _, _ in values)
        term = Term(effect, moves, joint, inputs, tuple(constants.items()), parameters)
        sizes, sigma = (np.array([row[k] for row in values]) for k in (1, 2))
        return summary(FittedTerm(term, sizes, sigma), context, ur5)

    return said


def test_a_single_number_comes_with_its_joint_its_deviation_and_a_readable_unit(said):
    text = said(
        *("joint_compliance", Moves.JOINT, 2, ("gravity_torque",), RANGE, "rad/(N m)"), ("compliance", 1.234e-5, 2.1e-7)
    )
    assert text.startswith("joint 2: compliance 12.34 ")
    assert "0.21 " in text
    assert text.endswith("rad/(N m)")


@pytest.mark.parametrize(
    ("unit", "value", "readable"),
    [("rad", 3e-4, "300"), ("m/m", 2.5e-4, "250"), ("1/K", 1.2e-5, "12"), ("rad/rad", 1e-4, "100")],
)
def test_sizes_are_said_in_millionths(said, unit, value, readable):
    text = said("encoder_scale", Moves.JOINT, 4, ("theta",), RANGE, unit, ("scale", value, 1e-6))
    assert f"scale {readable} " in text
    assert "e-" not in text


def test_waves_are_said_by_how_much_they_swing_and_how_often_a_turn(said):
    """A cosine of 100 urad swings by 100 / sqrt 2 = 70.7 rms."""
    text = said(
        "transmission_error", Moves.JOINT, 3, ("theta",), RANGE, "rad", ("cos 2", 1e-4, 1e-6), ("sin 9", 1e-6, 1e-6)
    )
    size = float(text.split("joint 3: ")[1].split()[0])
    assert size == pytest.approx(70.7, rel=0.03)
    assert "rms" in text
    assert text.endswith("mostly 2 cycles per turn")


def test_several_strong_waves_are_all_named_in_order_and_weak_ones_are_not(said):
    waves = [("sin 31", 8e-5, 1e-6), ("cos 1", 1e-4, 1e-6), ("cos 12", 9e-5, 1e-6), ("sin 5", 1e-6, 1e-6)]
    text = said("transmission_error", Moves.JOINT, 3, ("theta",), RANGE, "rad", *waves)
    assert text.endswith("mostly 1, 12 and 31 cycles per turn")


def test_once_a_turn_is_said_in_the_singular(said):
    text = said(
        "transmission_error", Moves.JOINT, 3, ("theta",), RANGE, "rad", ("cos 1", 1e-4, 1e-6), ("cos 4", 1e-6, 1e-6)
    )
    assert text.endswith("1 cycle per turn")


def test_half_waves_over_part_of_a_turn_are_said_in_cycles_per_turn_too(said):
    """Over half a turn, half-wave 8 is 4 cycles there and would be 8 a turn."""
    half_turn = {"lower_rad": 0.0, "upper_rad": np.pi}
    waves = [("half-wave 8", 1e-4, 1e-6), ("half-wave 1", 1e-6, 1e-6)]
    text = said("transmission_error", Moves.JOINT, 3, ("theta",), half_turn, "rad", *waves)
    assert text.endswith("8 cycles per turn")


def test_a_slip_is_said_by_its_length_and_the_time_from_which_on(said):
    """(300, 0, 400) um is 500 um long."""
    constants = {"moment": 512.25, "default time_s": 1000.0}
    text = said("tool_shift", Moves.PROBE, None, ("time_s",), constants, "m", ("x", 3e-4, 1e-6), ("z", 4e-4, 1e-6))
    assert text.startswith("500 ")
    assert "step" in text
    assert "512.25 s" in text
    assert "joint" not in text


def test_without_a_clock_a_step_is_said_by_a_line_of_the_file_that_there_is(said):
    """Between lines 84 and 85: it holds from line 85 on."""
    constants = {"moment": 84.5, "default row": 2001.0}
    text = said("tool_shift", Moves.PROBE, None, ("row",), constants, "m", ("x", 3e-4, 1e-6), ("z", 4e-4, 1e-6))
    assert "line 85 of the file" in text


def test_a_drift_is_said_in_lengths_and_turns(said):
    constants = {"start": 0.0, "end": 1000.0}
    text = said(
        "frame_drift",
        Moves.BASE,
        None,
        ("time_s",),
        constants,
        "m",
        ("x order 1", 1e-4, 1e-6),
        ("rz order 1", 2e-4, 1e-6),
    )
    shift, turn = (float(part.split()[0]) for part in text.split(" and "))
    assert shift == pytest.approx(100 / np.sqrt(3), rel=0.01)  # a ramp from -1 to 1
    assert turn == pytest.approx(200 / np.sqrt(3), rel=0.01)


def test_a_creep_comes_with_its_time_constant(said):
    constants = {"tau_s": 321.0, "start": 0.0, "end": 1000.0, "default time_s": 1000.0}
    text = said("warmup_drift", Moves.JOINT, 6, ("time_s",), constants, "rad", ("creep", -2e-4, 1e-6))
    assert text.startswith("joint 6: creep -200 ")
    assert "time constant about 321 s" in text
