"""Causes that the virtual robot hides: they are in the data, the seed decides them, and a diagnosis names them."""

import json
from typing import get_type_hints

import numpy as np
import pytest
from command import is_refused
from truepath.cli_virtual import simulate
from truepath.diagnose import diagnose
from truepath.errors import InputError
from truepath.readers import read_measurements
from truepath.validate import validate
from truepath.virtual.hidden_causes import CAUSES, draw_causes
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure, to_csv, truth_json
from truth_by_drake import reflector_poses

POSES = 300
SEEDS = (2, 4)
every_cause = pytest.mark.parametrize("name", CAUSES)
every_seed = pytest.mark.parametrize("seed", SEEDS)


@pytest.fixture(scope="module")
def robots():
    """By seed."""
    return {seed: RealRobot("ur5", seed) for seed in SEEDS}


@pytest.fixture(scope="module")
def joints(robots):
    """Enough for one campaign and a second one of fifty."""
    return free_poses(robots[SEEDS[0]], POSES + 50, np.random.default_rng(0))


# What is hidden is in the data


@every_seed
@every_cause
def test_the_truth_file_and_drake_account_for_every_reading(robots, joints, name, seed):
    exact, causes = Campaign(noise_mm=0.0, orientation_noise_mrad=0.0), draw_causes(robots[seed], [name])
    data = measure(robots[seed], joints[:60], exact, causes)
    truth = json.loads(truth_json(robots[seed], exact, causes))
    by_hand = reflector_poses(truth, joints[:60], data.time_s, data.approach)
    assert np.abs(data.p_ME - by_hand[:, :3, 3]).max() < 1e-7
    assert np.abs(data.R_ME - by_hand[:, :3, :3]).max() < 1e-7


@every_seed
@every_cause
def test_it_stands_out_from_the_noise_of_a_tracker_and_is_no_wreck(robots, joints, name, seed):
    exact = Campaign(noise_mm=0.0)
    with_it, without = (
        measure(robots[seed], joints[:60], exact, causes).p_ME for causes in (draw_causes(robots[seed], [name]), None)
    )
    assert 0.02e-3 < np.linalg.norm(with_it - without, axis=1).mean() < 1e-3


def test_several_causes_work_together(robots, joints):
    exact, causes = Campaign(noise_mm=0.0), draw_causes(robots[2], list(CAUSES))
    data = measure(robots[2], joints[:60], exact, causes)
    truth = json.loads(truth_json(robots[2], exact, causes))
    by_hand = reflector_poses(truth, joints[:60], data.time_s, data.approach)
    assert np.abs(data.p_ME - by_hand[:, :3, 3]).max() < 1e-7


def test_a_tracker_that_slips_turns_the_scene_about_itself(robots, joints):
    """Seen from a tracker that stands metres away the world moves rigidly, once."""
    real, causes = robots[2], draw_causes(robots[2], ["frame_drift"])
    exact = Campaign(noise_mm=0.0, orientation_noise_mrad=0.0, tracker=True)
    before, after = (measure(real, joints[:60], exact, hidden) for hidden in ({}, causes))
    (size,) = causes["frame_drift"].sizes
    late = after.time_s > size["moment_s"]
    assert 0.2 < late.mean() < 0.8
    assert np.array_equal(after.p_ME[~late], before.p_ME[~late])
    expected = size["shift_m"] + np.cross(size["turn_rad"], before.p_ME[late])
    assert np.abs(after.p_ME[late] - before.p_ME[late] - expected).max() < 1e-6


# The seed of the robot decides


@every_cause
def test_the_same_seed_hides_the_same_cause_in_another_campaign_and_another_seed_another(robots, name):
    again = draw_causes(RealRobot("ur5_cell", 2), [name])[name]
    assert again == draw_causes(robots[2], [name])[name]
    assert again.sizes != draw_causes(robots[4], [name])[name].sizes


def test_a_cause_is_the_same_whatever_else_is_hidden(robots):
    together = draw_causes(robots[2], list(CAUSES))
    assert together == {name: draw_causes(robots[2], [name])[name] for name in CAUSES}


@pytest.mark.parametrize("name", ["transmission_error", "joint_compliance", "backlash"])
def test_one_or_two_joints_have_it_where_an_arm_shows_it(name):
    found = {tuple(draw_causes(RealRobot("ur5", seed), [name])[name].joints) for seed in range(12)}
    assert {len(joints) for joints in found} == {1, 2}
    sensible = {2, 3} if name == "joint_compliance" else {1, 2, 3}
    assert set().union(*found) == sensible


# The file


def test_time_is_recorded_and_with_play_the_direction_of_arrival(robots, joints, tmp_path):
    for name in CAUSES:
        data = measure(robots[2], joints[:20], Campaign(repeats=2), draw_causes(robots[2], [name]))
        (tmp_path / "m.csv").write_text(to_csv(data))
        read = read_measurements(tmp_path / "m.csv", robots[2].robot)
        assert np.array_equal(read.time_s, data.time_s)
        assert (np.diff(read.time_s) > 0).all()
        if name == "backlash":
            travel = np.diff(read.q_rad, axis=0)
            assert np.array_equal(read.approach[1:], np.sign(travel))
        else:
            assert read.approach is None


def test_without_a_cause_nothing_more_is_recorded(robots, joints):
    data = measure(robots[2], joints[:20], Campaign())
    assert data.time_s is None
    assert data.approach is None
    assert "hidden_causes" not in truth_json(robots[2], Campaign())


# A diagnosis


@pytest.mark.parametrize("seed", [SEEDS[0], *(pytest.param(seed, marks=pytest.mark.slow) for seed in SEEDS[1:])])
@every_cause
def test_a_diagnosis_names_it_with_its_joints_and_a_second_campaign_agrees(robots, joints, name, seed):
    real, causes = robots[seed], draw_causes(robots[seed], [name])
    diagnosis = diagnose(real.robot, measure(real, joints[:POSES], Campaign(seed=seed), causes), plan=False)
    assert [(finding.effect, list(finding.joints)) for finding in diagnosis.findings] == [(name, causes[name].joints)]
    assert not diagnosis.unexplained.structured
    second = measure(real, joints[POSES:], Campaign(seed=seed + 1), causes)
    assert validate(diagnosis.calibration.model, second).calibrated.position_mm.mean < 0.05


# The command


def test_simulate_hides_what_it_is_told_to_and_the_truth_lists_it(truepath, tmp_path):
    at_once = ("simulate", "--seed", 3, "--poses", 30, "--truth", tmp_path / "truth.json", "-o", tmp_path / "a.csv")
    outcome = truepath(*at_once, "--hide", "backlash, tool_shift")
    assert outcome.code == 0, outcome.err
    header = (tmp_path / "a.csv").read_text().splitlines()[0]
    assert header.endswith("z_mm,t_s,approach1,approach2,approach3,approach4,approach5,approach6")
    listed = json.loads((tmp_path / "truth.json").read_text())["hidden_causes"]
    assert [cause["effect"] for cause in listed] == ["backlash", "tool_shift"]
    assert listed[0]["joints"] == [size["joint"] for size in listed[0]["sizes"]] != []
    assert listed[1]["joints"] == []
    one_by_one = ("--hide", "backlash", "--hide", "tool_shift")
    truepath("simulate", "--seed", 3, "--poses", 30, *one_by_one, "-o", tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_bytes() == (tmp_path / "a.csv").read_bytes()


def test_other_poses_of_the_same_robot_hide_the_same(truepath, tmp_path):
    told = []
    for poses_seed in (0, 1):
        folder = tmp_path / str(poses_seed)
        folder.mkdir()
        files = ("-o", folder / "m.csv", "--truth", folder / "truth.json")
        truepath("simulate", "--poses", 10, "--poses-seed", poses_seed, "--hide", "frame_drift", *files)
        told.append(json.loads((folder / "truth.json").read_text()))
    assert told[0]["hidden_causes"] == told[1]["hidden_causes"]
    assert told[0]["hidden_frame_errors"] == told[1]["hidden_frame_errors"]
    assert told[0]["campaign"] != told[1]["campaign"]


@pytest.mark.parametrize("names", ["gremlins", "backlash,gremlins", "backlash,", ""])
def test_an_unknown_cause_is_refused_with_the_list_of_known_ones(truepath, tmp_path, names):
    outcome = truepath("simulate", "--hide", names, "-o", tmp_path / "m.csv")
    assert is_refused(outcome, *CAUSES)
    assert list(tmp_path.iterdir()) == []


def test_the_help_names_every_cause_that_there_is():
    (option,) = get_type_hints(simulate, include_extras=True)["hide"].__metadata__
    assert option.help.endswith(": " + ", ".join(CAUSES))


def test_a_robot_that_weighs_nothing_cannot_be_soft(robots, monkeypatch):
    monkeypatch.setattr(RealRobot, "gravity_torques", lambda self, q_rad: np.zeros_like(q_rad))
    with pytest.raises(InputError, match="gravity"):
        draw_causes(robots[2], ["joint_compliance"])
