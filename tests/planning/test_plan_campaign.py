"""A small campaign, judged by Drake: possible, in sight, better than chance, and what it promises comes true."""

import itertools

import numpy as np
import pytest
from seen_from import CONE_DEG, FARTHEST_M, NEAREST_M, TRACKER
from truepath.calibrate import calibrate
from truepath.errors import InputError
from truepath.planning.campaign import Pace, plan_campaign
from truepath.planning.design import Wish
from truepath.planning.pose_list import NO_POSE, to_csv
from truepath.planning.setup import stated_noise
from truepath.planning.visits import RUN_UP_RAD
from truepath.virtual.simulate import Campaign, measure

NOISE = stated_noise(0.02, None)


@pytest.fixture(scope="module")
def both_sides(without_a_cell):
    return plan_campaign(without_a_cell, Wish(49, 1), NOISE, ["backlash", "warmup_drift"], candidates=200)


def test_as_many_measurements_as_asked_for_and_the_repeats_among_them(small_plan):
    poses = small_plan.poses
    assert poses.measure.sum() == 26
    visits = np.bincount(poses.pose_id[poses.measure])
    assert sorted(visits) == [1] * 22 + [2] * 2
    assert (poses.pose_id[~poses.measure] == NO_POSE).all()


def test_measured_poses_keep_away_from_the_limits_and_turn_no_joint_more_than_half_a_turn(small_plan):
    assert np.abs(small_plan.poses.q_rad).max() < np.pi - np.radians(2.9)


def test_every_row_and_every_way_between_is_free_of_collision(small_plan, real_ur5):
    q = small_plan.poses.q_rad
    for start, end in itertools.pairwise(q):
        count = max(int(np.abs(end - start).max() / 0.015), 1)
        assert all(real_ur5.is_free(row) for row in np.linspace(start, end, count + 1))


def test_every_measured_pose_passes_the_whole_test_of_poses(small_plan, in_sight):
    assert in_sight.check(small_plan.poses.q_rad[small_plan.poses.measure]).all()


def test_the_robot_starts_and_ends_where_the_cell_has_it_by_default(small_plan):
    home = [0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0]
    np.testing.assert_allclose(small_plan.poses.q_rad[[0, -1]], [home, home], atol=1e-9)
    assert not small_plan.poses.measure[[0, -1]].any()


def test_the_reflector_faces_the_tracker_within_its_range(small_plan):
    from truepath.virtual.real_robot import Imperfection, RealRobot

    perfect = RealRobot("ur5", 0, Imperfection(0, 0, 0, 0, 0))
    X_WE = perfect.reflector_poses(small_plan.poses.q_rad[small_plan.poses.measure])
    beam = TRACKER - X_WE[:, :3, 3]
    distance = np.linalg.norm(beam, axis=1)
    off_axis = np.degrees(np.arccos(np.einsum("ni,ni->n", X_WE[:, :3, 2], beam) / distance))
    assert off_axis.max() < CONE_DEG + 1e-6
    assert distance.min() > NEAREST_M
    assert distance.max() < FARTHEST_M


def test_the_tool_is_promised_to_be_better_known_than_after_any_random_set(small_plan):
    design = small_plan.design
    assert design.tool_sigma_m.mean() < 0.95 * design.random_sigma_m.min()


def test_the_promised_standard_deviations_are_those_that_the_calibration_states(small_plan, real_ur5):
    poses = small_plan.poses
    fit = calibrate(real_ur5.robot, measure(real_ur5, poses.q_rad[poses.measure], Campaign(26, 0.02, seed=1)))
    free = np.array([k for k in range(len(fit.names)) if k not in fit.held])
    stated = fit.sigma[free] * 2e-5 / fit.sigma_position_m
    promised = np.sqrt(np.diag(small_plan.design.covariance)) * small_plan.model.widths
    np.testing.assert_allclose(promised, stated, rtol=0.1)


def test_time_hardly_goes_along_with_any_joint(small_plan):
    q = small_plan.poses.q_rad[small_plan.poses.measure]
    found = [abs(np.corrcoef(np.arange(26), q[:, i])[0, 1]) for i in range(6)]
    assert max(found) < 0.25
    assert max(found) == pytest.approx(np.abs(small_plan.mixing.joints).max())


def test_the_same_seed_gives_the_same_file(without_a_cell):
    one, same, other = (
        to_csv(plan_campaign(without_a_cell, Wish(14, 1), NOISE, candidates=60, seed=seed).poses) for seed in (3, 3, 4)
    )
    assert one == same
    assert one != other


def test_for_play_every_pose_is_approached_from_both_sides(both_sides):
    poses = both_sides.poses
    stops = np.flatnonzero(poses.measure)
    assert len(stops) == 49
    assert (~poses.measure[stops - 1]).all()  # a run-up point before each
    arrival = poses.q_rad[stops] - poses.q_rad[stops - 1]
    np.testing.assert_allclose(np.abs(arrival), RUN_UP_RAD, atol=1e-12)
    for pose in range(24):
        first, second = arrival[poses.pose_id[stops] == pose][:2]
        np.testing.assert_allclose(first, -second, atol=1e-12)
    assert (np.abs(np.sign(arrival).mean(axis=0)) < 0.2).all()


def test_play_is_known_as_well_as_its_readings_allow(both_sides):
    """A joint with a lever of decimetres, seen from both sides 24 times with 0.02 mm, to a few urad; joint 6 worse."""
    model = both_sides.model
    sigma = (np.sqrt(np.diag(both_sides.design.covariance)) * model.widths)[-6:]
    assert [term.joint for term in model.terms] == [1, 2, 3, 4, 5, 6]
    assert (sigma[:3] < 1.5e-5).all()
    assert sigma[5] == max(sigma)


def test_effects_of_time_are_named_as_what_no_choice_of_poses_shows(both_sides):
    assert both_sides.not_planned == ("warmup_drift",)


def test_the_whole_list_takes_as_long_as_its_moves():
    """90 degrees at 30 deg/s with ramps of 30/80 s each: 3.375 s; a move too short for full speed: 2 sqrt(d / a)."""
    q = np.radians([[0.0, 0.0], [90.0, 10.0], [90.0, 15.0]])
    assert Pace(stop_s=4.0).duration_s(q, 2) == pytest.approx(3.375 + 2 * np.sqrt(5 / 80) + 8.0)


@pytest.mark.parametrize(
    ("wish", "effects", "problem"),
    [
        (Wish(11, 0), [], "too few poses"),
        (Wish(30, 20), [], "too few poses"),
        (Wish(14, 0), ["joint_compliance", "encoder_scale"], "too few poses"),
        (Wish(60, 60), [], "no campaign"),
        (Wish(60, 4, "A"), [], "unknown criterion"),
        (Wish(60, 4), ["rust"], "unknown effect"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_plain_words(without_a_cell, wish, effects, problem):
    with pytest.raises(InputError, match=problem) as error:
        plan_campaign(without_a_cell, wish, NOISE, effects, candidates=100)
    assert error.value.expected
