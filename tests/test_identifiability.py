"""Which parameters the data can see: rank by a stated order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from truepath.identifiability import independent_columns
from truepath.measurements import Measurements
from truepath.model import nominal_flange_poses
from truepath.poe import base_slice, parameter_names, tool_slice
from truepath.poe_symbolic import PoseProblem


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def numerical_rank(J):
    length = np.linalg.norm(J, axis=0)
    return np.linalg.matrix_rank(J / np.where(length > 0, length, 1), tol=1e-7)


def test_columns_in_general_position_are_all_seen(rng):
    assert independent_columns(rng.normal(size=(30, 8)), np.arange(8)).all()


def test_of_a_redundant_set_the_first_in_the_stated_order_are_kept(rng):
    a, b = rng.normal(size=(2, 20))
    J = np.stack([a, b, a + b], axis=1)
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0], [2, 1, 0]):
        kept = independent_columns(J, np.argsort(order))
        assert set(np.flatnonzero(kept)) == set(order[:2])


def test_a_parameter_without_any_effect_is_never_seen(rng):
    J = rng.normal(size=(20, 3))
    J[:, 1] = 0
    assert independent_columns(J, np.array([1, 0, 2])).tolist() == [True, False, True]
    assert not independent_columns(np.zeros((20, 3)), np.arange(3)).any()


def test_more_parameters_than_readings_are_seen_as_far_as_the_readings_go(rng):
    assert independent_columns(rng.normal(size=(5, 9)), np.arange(9)).sum() == 5


def test_units_do_not_matter(rng):
    a, b = rng.normal(size=(2, 20))
    J = np.stack([a, 1e-7 * b, 10 * (a + b), 1e3 * rng.normal(size=20)], axis=1)
    assert independent_columns(J, np.arange(4)).tolist() == [True, True, False, True]


def test_a_column_with_a_thousandth_of_its_own_is_seen_and_one_with_a_billionth_is_not(rng):
    a, b = np.linalg.qr(rng.normal(size=(20, 2)))[0].T
    for share, seen in ((1e-3, True), (1e-5, True), (1e-7, False), (1e-9, False)):
        assert independent_columns(np.stack([a, a + share * b], axis=1), np.arange(2)).tolist() == [True, seen], share


def test_the_rows_may_come_as_poses_and_components(rng):
    J = rng.normal(size=(10, 3, 6))
    J[..., 5] = J[..., 0] - 2 * J[..., 3]
    order = np.array([5, 4, 3, 2, 1, 0])
    np.testing.assert_array_equal(independent_columns(J, order), independent_columns(J.reshape(30, 6), order))
    assert not independent_columns(J, order)[0]


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(0, 12))
def test_the_kept_columns_are_as_many_as_the_rank_and_span_all_the_others(seed, columns, rank):
    rng = np.random.default_rng(seed)
    rank = min(rank, columns)
    J = rng.normal(size=(15, rank)) @ rng.normal(size=(rank, columns))
    kept = independent_columns(J, rng.permutation(columns))
    assert kept.sum() == rank == np.linalg.matrix_rank(J[:, kept])


# Arms. A minimal model has four parameters for each revolute joint and six more (Everett, Driels, Mooring 1987);
# of the frames' twelve, six repeat what the axes say. A reflector does not show its three turns.


def arm_jacobian(robot, has_orientation, p_FE=(0.05, -0.03, 0.12), still=()):
    rng = np.random.default_rng(2)
    q = rng.uniform(-2, 2, (80, robot.num_joints))
    q[:, list(still)] = 0.3
    X_FE = np.eye(4)
    X_FE[:3, 3] = p_FE
    X = nominal_flange_poses(robot, q) @ X_FE
    R = X[:, :3, :3] @ Rotation.from_rotvec(1e-3 * rng.normal(size=(80, 3))).as_matrix() if has_orientation else None
    problem = PoseProblem(robot, Measurements(q_rad=q, p_ME=X[:, :3, 3], R_ME=R), np.eye(4), X_FE)
    return problem.evaluate(np.zeros(4 * robot.num_joints + 12))[1]


def frames_first(num_joints):
    """The ranks of ``calibrate``: frames, then the axes from the tool inwards, the four of an axis being equals."""
    return np.concatenate([np.repeat(np.arange(num_joints, 0, -1), 4), np.zeros(12, int)])


@pytest.mark.parametrize("name", ["ur5", "seven"])
@pytest.mark.parametrize("has_orientation", [False, True], ids=["3D", "6D"])
def test_an_arm_that_moves_all_joints_shows_four_parameters_a_joint_and_one_pose_of_the_probe(
    request, name, has_orientation
):
    robot = request.getfixturevalue(name)
    J, n = arm_jacobian(robot, has_orientation), robot.num_joints
    kept = independent_columns(J, frames_first(n))
    assert kept.sum() == numerical_rank(J.reshape(-1, 4 * n + 12)) == 4 * n + (6 if has_orientation else 3)


def test_frames_that_come_first_are_kept_and_the_first_axis_gives_way(ur5):
    kept = independent_columns(arm_jacobian(ur5, True), frames_first(6))
    assert kept[base_slice(6)].all()
    assert kept[tool_slice(6)].all()
    assert not kept[:4].any()  # the base frame says all that there is about axis 1


def test_a_reflector_does_not_show_how_the_tool_frame_is_turned(ur5):
    names = parameter_names(6)
    kept = independent_columns(arm_jacobian(ur5, False), frames_first(6))
    unseen = {str(names[i]) for i in np.flatnonzero(~kept)}
    assert {"tool.rot_x", "tool.rot_y", "tool.rot_z"} <= unseen


@pytest.mark.parametrize("still", [[0], [2], [5], [3, 4]], ids=str)
@pytest.mark.parametrize("has_orientation", [False, True], ids=["3D", "6D"])
def test_joints_that_stand_still_hide_parameters_as_the_singular_values_say(ur5, still, has_orientation):
    J = arm_jacobian(ur5, has_orientation, still=still)
    kept = independent_columns(J, frames_first(6))
    flat = J.reshape(-1, 36)
    assert kept.sum() == numerical_rank(flat) == numerical_rank(flat[:, kept])
    assert kept.sum() < independent_columns(arm_jacobian(ur5, has_orientation), frames_first(6)).sum()


def test_a_reflector_on_the_last_axis_hides_more_than_one_beside_it(ur5):
    beside, on = (arm_jacobian(ur5, False, p_FE) for p_FE in ((0.07, 0, 0.031), (0, 0, 0.031)))
    count = [independent_columns(J, frames_first(6)).sum() for J in (beside, on)]
    assert count == [numerical_rank(J.reshape(-1, 36)) for J in (beside, on)]
    assert count[1] < count[0]
