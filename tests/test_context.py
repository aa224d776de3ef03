"""What is known about poses besides their joints, and what is not."""

from dataclasses import replace

import numpy as np
import pytest
from truepath.context import RECORDED, Context, as_context
from truepath.measurements import Measurements

POSES = 12


@pytest.fixture
def joints():
    return np.random.default_rng(0).uniform(-2, 2, (POSES, 6))


@pytest.fixture
def measurements(joints):
    rng = np.random.default_rng(1)
    return Measurements(
        joints,
        rng.normal(size=(POSES, 3)),
        time_s=np.sort(rng.uniform(0, 100, POSES)),
        temperature_c=rng.uniform(20, 25, POSES),
        payload_kg=rng.uniform(0, 3, POSES),
        approach=rng.choice([-1.0, 1.0], (POSES, 6)),
        line=np.arange(POSES) + 2,
    )


def test_a_context_of_measurements_knows_all_that_was_recorded(measurements):
    context = Context.of(measurements)
    for name in ("q_rad", "p_ME", "time_s", "temperature_c", "payload_kg", "approach"):
        np.testing.assert_array_equal(getattr(context, name), getattr(measurements, name))
    np.testing.assert_array_equal(context.row, measurements.line)
    assert len(context) == POSES


def test_what_nobody_recorded_is_none_and_not_zero(joints):
    context = Context.of(Measurements(joints, np.zeros((POSES, 3))))
    for name in ("time_s", "temperature_c", "payload_kg", "approach"):
        assert getattr(context, name) is None


def test_the_line_in_another_file_says_nothing_about_the_campaign_of_the_model(measurements):
    assert Context.of(measurements, same_campaign=False).row is None
    assert Context.of(measurements, same_campaign=False).time_s is not None


def test_a_joint_came_from_where_it_was_at_the_pose_before():
    q = np.array([[0.0, 1.0], [0.5, 1.0], [0.2, -1.0]])
    came_by = Context.of(Measurements(q, np.zeros((3, 3)))).came_by
    np.testing.assert_array_equal(came_by, [[0, 0], [1, 0], [-1, -1]])


def test_the_clock_is_the_recorded_time_or_else_the_order_of_measurement(measurements, joints):
    assert Context.of(measurements).clock == "time_s"
    assert Context.of(Measurements(joints, np.zeros((POSES, 3)))).clock == "row"


@pytest.mark.parametrize("rows", [np.array([3, 0, 7]), np.arange(POSES) % 3 == 0], ids=["numbers", "mask"])
def test_some_poses_keep_their_own_circumstances(measurements, rows):
    turned = np.broadcast_to(np.eye(3), (POSES, 3, 3)) * np.arange(1, POSES + 1)[:, None, None]
    whole = replace(Context.of(measurements), R_MF=turned)
    some = whole.subset(rows)
    for name in ("q_rad", "payload_kg", *RECORDED):
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[rows])


def test_some_poses_still_came_from_where_they_came_from(measurements):
    """Not from the pose before them among the chosen ones."""
    whole = Context.of(measurements)
    np.testing.assert_array_equal(whole.subset(np.array([5, 9])).came_by, whole.came_by[[5, 9]])


def test_one_payload_for_all_poses_is_that_of_each(joints):
    assert Context(joints, 2.5).subset(np.array([1, 2])).payload_kg == 2.5
    assert Context(joints).subset(np.array([1, 2])).payload_kg is None


def test_bare_joints_are_a_context_of_which_nothing_else_is_known(joints):
    context = as_context(joints)
    np.testing.assert_array_equal(context.q_rad, joints)
    assert all(getattr(context, name) is None for name in ("payload_kg", *RECORDED))


def test_one_row_of_joints_is_one_pose(joints):
    assert as_context(joints[0]).q_rad.shape == (1, 6)


def test_a_context_is_taken_as_it_is(measurements):
    context = Context.of(measurements)
    assert as_context(context) is context
