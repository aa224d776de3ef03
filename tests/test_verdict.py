"""The verdict: one sentence that a person understands, with all that matters in it."""

from types import SimpleNamespace

import numpy as np
import pytest
from truepath.context import Context
from truepath.diagnosis import Ambiguity, Finding, Gain, Stage, Unexplained
from truepath.effects import EFFECTS
from truepath.verdict import not_testable, verdict

POSES = 200


def stage(model, mean):
    return Stage(model, SimpleNamespace(position_mm=SimpleNamespace(mean=mean)))


def found(effect, *joints):
    return Finding(effect, joints, "", "", 1e-9, 100.0, Gain(0.2, 0.1, (0.08, 0.12)), (), ())


def decided(entered):
    """Networks that took 0.041 mm to 0.031 mm, or were left out."""
    gain = Gain(0.0412, 0.0309, (0.008, 0.012))
    return SimpleNamespace(model="with networks" if entered else None, gain=gain if entered else None)


def told(findings=(), ambiguous=(), structured=False, network=None):
    """The verdict on a robot that was 2.123 mm off, 0.136 mm once calibrated, 0.041 mm with the findings."""
    left = 0.0412 if findings else 0.1357
    return verdict(
        SimpleNamespace(
            stages=(stage("nominal", 2.1234), stage("kinematic", 0.1357), stage("kinematic+more", left)),
            findings=tuple(findings),
            ambiguous=tuple(ambiguous),
            unexplained=Unexplained(structured, 0.5, left, 0.0391, "neighbours"),
            network=network,
        )
    )


VERDICTS = {
    "nothing": told(),
    "something without a name": told(structured=True),
    "one cause": told([found("joint_compliance", 2)]),
    "three causes": told(
        [found("transmission_error", 2, 4, 5), found("frame_drift"), found("joint_compliance", 1, 3)], structured=True
    ),
    "networks": told([found("joint_compliance", 2)], structured=True, network=decided(entered=True)),
    "networks left out": told(network=decided(entered=False)),
    "a doubt": told(ambiguous=[Ambiguity(("encoder_scale", "kinematic"), "why")]),
}


@pytest.mark.parametrize("case", VERDICTS)
def test_the_verdict_is_one_sentence_in_plain_words(case):
    text = VERDICTS[case]
    assert text[0].isupper()
    assert text.endswith(".")
    assert ". " not in text
    assert "_" not in text
    assert "nan" not in text


@pytest.mark.parametrize("case", VERDICTS)
def test_the_verdict_says_what_calibrating_the_geometry_brings(case):
    assert "from 2.123 to 0.136 mm" in VERDICTS[case]


def test_every_cause_is_named_with_its_joints_and_with_what_is_left_then():
    assert "compliance of joint 2 explains" in VERDICTS["one cause"]
    assert "down to 0.041 mm" in VERDICTS["one cause"]
    three = VERDICTS["three causes"]
    assert "transmission error of joints 2, 4 and 5, frame drift and joint compliance of joints 1 and 3" in three


def test_where_nothing_is_proved_nothing_is_named():
    for case in ("nothing", "something without a name", "a doubt"):
        assert "no other cause is proved" in VERDICTS[case]
    assert not any(name.replace("_", " ") in VERDICTS["nothing"] for name in EFFECTS)


def test_the_verdict_says_whether_what_is_left_is_noise_or_has_a_pattern_without_a_name():
    assert "looks like noise, of which 0.039 mm are expected" in VERDICTS["nothing"]
    assert "pattern that no known cause carries" in VERDICTS["something without a name"]
    assert "looks like noise" not in VERDICTS["three causes"]


def test_causes_that_cannot_be_told_apart_are_in_the_verdict():
    assert "encoder scale" in VERDICTS["a doubt"]
    assert "geometry" in VERDICTS["a doubt"]


def test_networks_are_in_the_verdict_with_what_they_gain_or_as_left_out():
    assert "networks for what has no name take the mean error from 0.041 to 0.031 mm" in VERDICTS["networks"]
    assert "networks are left out, as nothing proves" in VERDICTS["networks left out"]


def test_networks_that_nobody_asked_for_are_not_in_the_verdict():
    assert not any("network" in VERDICTS[case] for case in VERDICTS if not case.startswith("networks"))


def test_the_doubt_about_the_metre_that_every_data_set_leaves_is_not_worth_the_reader_s_first_minute():
    common = Ambiguity(("measurement_scale", "thermal_expansion", "kinematic"), "all lengths are 0.03 % long")
    assert told(ambiguous=[common]) == VERDICTS["nothing"]


# What could not be tested


@pytest.fixture(scope="module")
def full():
    rng = np.random.default_rng(0)
    return {
        "q_rad": rng.uniform(-3, 3, (POSES, 6)),
        "time_s": np.arange(POSES) * 10.0,
        "row": np.arange(POSES) + 2.0,
        "temperature_c": 20 + 5 * rng.random(POSES),
        "approach": rng.choice([-1.0, 1.0], (POSES, 6)),
    }


def blind(robot, columns, **changes):
    """What cannot be tested, by effect."""
    return {item.effect: item for item in not_testable(robot, Context(**{**columns, **changes}))}


def test_with_everything_recorded_everything_can_be_tested(ur5, full):
    assert blind(ur5, full) == {}


@pytest.mark.parametrize(
    ("lost", "effect", "columns"),
    [
        ("temperature_c", "thermal_expansion", ("temperature_c",)),
        ("time_s", "warmup_drift", ("t_s",)),
        ("approach", "backlash", tuple(f"approach{i}" for i in range(1, 7))),
    ],
)
def test_an_effect_that_could_not_be_tested_comes_with_the_column_to_record_next_time(ur5, full, lost, effect, columns):
    found = blind(ur5, full, **{lost: None})
    assert set(found) == {effect}
    assert found[effect].columns == columns
    assert "recorded" in found[effect].why


def test_a_column_that_was_recorded_but_hardly_varied_tells_nothing_and_that_is_said(ur5, full):
    found = blind(ur5, full, temperature_c=np.full(POSES, 21.0))
    assert set(found) == {"thermal_expansion"}
    assert "hardly varied" in found["thermal_expansion"].why


def test_play_of_a_joint_that_gravity_never_turns_is_said_to_be_invisible_without_directions(ur5, full):
    """The first axis of a UR5 on its foot is vertical, the last is that of a flange without a load."""
    assert "1 and 6 cannot be seen" in blind(ur5, full, approach=None)["backlash"].why


def test_directions_that_were_all_left_at_zero_are_no_directions(ur5, full):
    assert set(blind(ur5, full, approach=np.zeros((POSES, 6)))) == {"backlash"}


def test_a_metre_that_nobody_can_test_is_no_missing_column(ur5):
    assert "measurement_scale" not in blind(ur5, {"q_rad": np.zeros((POSES, 6))})


def test_of_a_robot_that_stood_still_no_effect_of_a_pose_can_be_tested(ur5, full):
    found = blind(ur5, full, q_rad=np.zeros((POSES, 6)))
    assert {"transmission_error", "joint_compliance", "encoder_scale", "axis_wobble"} <= set(found)
    assert all("q1_rad" in found[name].columns for name in ("transmission_error", "axis_wobble"))
