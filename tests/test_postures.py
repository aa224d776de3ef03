"""Which joints a controller takes for poses; whether they reach is Drake's word, which there are Newton's from many
starts, and where a line leads is followed in small steps.
"""

import time
from dataclasses import replace

import numpy as np
import pytest
from denavit_hartenberg import askew, calibration_conf
from drake_arm import DrakeArm
from scipy.spatial.transform import Rotation
from truepath.controller import controller_of
from truepath.errors import InputError
from truepath.inverse import solve
from truepath.model import nominal_flange_poses, nominal_model
from truepath.postures import follow_targets
from truepath.ur_postures import ThreeParallelAxes

HOME = np.array([0.2, -1.4, 1.3, -1.2, -1.5, 0.3])
TURN = 2 * np.pi


@pytest.fixture
def robot(request):
    """Function: a nominal robot by its name."""
    return request.getfixturevalue


def smooth(count, size=0.6, seed=0):
    """``(count, 6)`` joints that wander about HOME, far from singularities."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, count)[:, None, None]
    waves = np.sin(TURN * (s * rng.uniform(0.5, 2, (3, 6)) + rng.uniform(0, 1, (3, 6))))
    return HOME + size / 3 * waves.sum(axis=1)


def follow(arm, q, *, given=(), near=None, previous=None, start=None, straight=None, X=None):
    """Targets that are the poses at joints ``q``, but for those that are given as joints."""
    robot = getattr(arm, "kinematics", arm)
    stated = np.full(q.shape, np.nan)
    stated[list(given)] = q[list(given)]
    near = np.full(q.shape, np.nan) if near is None else near
    previous = np.arange(len(q)) - 1 if previous is None else np.array(previous)
    X = nominal_flange_poses(robot, q) if X is None else X
    straight = None if straight is None else np.broadcast_to(straight, len(q))
    return follow_targets(arm, X, stated, near, previous, start, straight)


def misses(X, X_goal):
    """Largest position error in m and angle error in rad."""
    angle = Rotation.from_matrix(X[:, :3, :3] @ np.swapaxes(X_goal[:, :3, :3], 1, 2)).magnitude()
    return max(np.linalg.norm(X[:, :3, 3] - X_goal[:, :3, 3], axis=1).max(), angle.max())


def all_solutions(robot, X):
    """``(K, 6)`` all joints in [-pi, pi) that reach a pose, by Newton's method from 400 starts."""
    starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (400, 6))
    forward = nominal_model(robot).flange_poses_and_jacobian
    solution = solve(forward, np.broadcast_to(X, (400, 4, 4)), starts, max_iterations=60)
    q = solution.q_rad[solution.converged]
    q = q - TURN * np.floor((q + np.pi) / TURN)
    different: list = []
    for one in q:
        away = [np.abs((one - other + np.pi) % TURN - np.pi).max() for other in different]
        if min(away, default=1.0) > 1e-4:
            different.append(one)
    return np.array(different)


def with_turns(q, lower, upper):
    """The same joints with all whole turns within limits of at most two turns."""
    turns = np.stack(np.meshgrid(*[[-1, 0, 1]] * 6), axis=-1).reshape(-1, 1, 6)
    found = (q + TURN * turns).reshape(-1, 6)
    return found[((found >= lower) & (found <= upper)).all(axis=1)]


def along_line(robot, q, X_goal, steps=2000):
    """Joints at the end of the straight line from joints ``q``, in small steps."""
    X = nominal_flange_poses(robot, q[None])[0]
    turn = Rotation.from_matrix(X_goal[:3, :3] @ X[:3, :3].T).as_rotvec()
    forward = nominal_model(robot).flange_poses_and_jacobian
    for share in np.arange(1, steps + 1) / steps:
        goal = np.eye(4)
        goal[:3, :3] = Rotation.from_rotvec(share * turn).as_matrix() @ X[:3, :3]
        goal[:3, 3] = (1 - share) * X[:3, 3] + share * X_goal[:3, 3]
        solution = solve(forward, goal[None], q[None])
        assert solution.converged[0]
        assert np.abs(solution.q_rad[0] - q).max() < 0.1
        q = solution.q_rad[0]
    return q


# All postures


@pytest.mark.parametrize("name", ["ur5", "ur10"])
def test_all_eight_postures_reach_the_pose(robot, name):
    drake, q = DrakeArm(name), np.random.default_rng(1).uniform(-np.pi, np.pi, (40, 6))
    X = drake.flange_poses(q)
    found = ThreeParallelAxes.of(robot(name)).solve(X).q_rad
    assert (np.nanmin(np.abs(found - q.T).max(axis=1), axis=0) < 1e-7).all()
    for posture in found:
        there = ~np.isnan(posture[0])
        assert there.sum() > 20
        assert misses(drake.flange_poses(posture[:, there].T), X[there]) < 1e-7


@pytest.mark.parametrize("seed", range(6))
def test_there_are_no_others(ur5, seed):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, 6)
    X = nominal_flange_poses(ur5, q[None])
    found = ThreeParallelAxes.of(ur5).solve(X).q_rad[..., 0]
    found = found[~np.isnan(found[:, 0])]
    truth = all_solutions(ur5, X[0])
    assert len(found) == len(truth)
    assert np.abs(found[:, None] - truth).max(axis=2).min(axis=0).max() < 1e-6


def test_arms_of_another_kind_are_told(seven, ur5):
    assert ThreeParallelAxes.of(seven) is None
    tilted = ur5.X_BA.copy()
    tilted[3, :3, :3] = Rotation.from_rotvec([0.3, 0, 0]).as_matrix() @ tilted[3, :3, :3]
    assert ThreeParallelAxes.of(replace(ur5, X_BA=tilted)) is None
    apart = ur5.X_BA.copy()
    apart[4, 0, 3] += 0.05
    assert ThreeParallelAxes.of(replace(ur5, X_BA=apart)) is None


# Along a program


@pytest.mark.parametrize("name", ["ur5", "ur10"])
@pytest.mark.parametrize("straight", [False, True])
def test_a_path_of_poses_is_followed_from_joints_that_are_given(robot, name, straight):
    q, drake = smooth(300), DrakeArm(name)
    found = follow(robot(name), q, given=[0], straight=straight, X=drake.flange_poses(q))
    assert np.abs(found.q_rad - q).max() < 1e-7
    assert found.reached.all()
    assert found.certain.all()
    assert not (found.ambiguous | found.start_unknown).any()


def test_joints_that_are_given_stay_and_what_follows_starts_from_them(ur5):
    q = np.concatenate([smooth(20), smooth(20)])
    q[:, 5] -= 1.5
    q[20:, 5] += TURN
    found = follow(ur5, q, given=[0, 20])
    assert np.array_equal(found.q_rad[[0, 20]], q[[0, 20]])
    assert np.abs(found.q_rad - q).max() < 1e-7


def test_the_start_may_be_stated_apart(ur5):
    q = smooth(20)
    assert np.abs(follow(ur5, q, start=q[0] + 0.05).q_rad - q).max() < 1e-7
    other = follow(ur5, q, start=q[0] + [0, 0, 0, 0, 0, -TURN]).q_rad
    assert np.abs(other - q - [0, 0, 0, 0, 0, -TURN]).max() < 1e-7


def test_joints_near_a_pose_count_for_more_than_what_is_before_it(ur5):
    q = smooth(10)
    others = all_solutions(ur5, nominal_flange_poses(ur5, q[5:6])[0])
    near = np.full((10, 6), np.nan)
    for other in others:
        near[5] = other + np.random.default_rng(0).normal(scale=0.02, size=6)
        found = follow(ur5, q, given=[0], near=near)
        assert np.abs(found.q_rad[5] - other).max() < 1e-5
        assert found.certain[5]
        assert np.abs(found.q_rad[:5] - q[:5]).max() < 1e-7


def test_far_targets_are_reached_in_the_posture_nearest_of_all_that_there_are(ur5):
    rng = np.random.default_rng(7)
    q = rng.uniform(-np.pi, np.pi, (60, 6))
    found = follow(ur5, q, given=[0])
    assert found.reached.all()
    told = 0
    for k in range(1, 60):
        all_there_are = with_turns(
            all_solutions(ur5, nominal_flange_poses(ur5, q[k : k + 1])[0]), ur5.lower_rad, ur5.upper_rad
        )
        away = np.linalg.norm(all_there_are - found.q_rad[k - 1], axis=1)
        nearest = np.sort(away)
        assert np.linalg.norm(found.q_rad[k] - found.q_rad[k - 1]) == pytest.approx(nearest[0], abs=1e-6)
        if not found.ambiguous[k]:
            assert np.abs(found.q_rad[k] - all_there_are[np.argmin(away)]).max() < 1e-5
            assert nearest[1] > 1.09 * nearest[0]
            told += 1
    assert 15 < told < 59  # by chance some are nearly as near as others


def test_targets_may_be_written_in_any_order_and_several_may_follow_one(ur5):
    q = smooth(30)
    order = np.random.default_rng(0).permutation(30)
    place = np.argsort(order)  # target k of the path is written at place[k]
    previous = np.array([place[order[i] - 1] if order[i] > 0 else -1 for i in range(30)])
    found = follow(ur5, q[order], given=[place[0]], previous=previous)
    assert np.abs(found.q_rad - q[order]).max() < 1e-7
    fan = follow(ur5, q, given=[0], previous=[-1] + [0] * 29)
    assert np.abs(fan.q_rad - q).max() < 1e-7


def test_a_controllers_own_frames_and_kinematics_are_taken(ur10, tmp_path):
    arm, rows = askew("UR10", 1)
    path = tmp_path / "calibration.conf"
    path.write_text(calibration_conf("UR10", rows))
    controller = controller_of(ur10, path)
    q = smooth(200)
    for straight in (False, True):
        found = follow(controller, q, given=[0], straight=straight, X=arm(q))
        assert np.abs(found.q_rad - q).max() < 1e-7
        assert found.certain.all()


def test_an_arm_that_is_askew_reaches_all_that_it_says(ur10):
    """Poses all over the place, the start of each known: what is not told as ambiguous is the nearest."""
    rng = np.random.default_rng(3)
    error = np.tile(np.eye(4), (6, 1, 1))
    error[:, :3, :3] = Rotation.from_rotvec(rng.normal(scale=1e-3, size=(6, 3))).as_matrix()
    error[:, :3, 3] = rng.normal(scale=3e-4, size=(6, 3))
    arm = replace(ur10, X_BA=ur10.X_BA @ error)
    q = rng.uniform(-3, 3, (4000, 6))
    near = q + rng.normal(scale=0.003, size=q.shape)
    found = follow(arm, q, near=near)
    X = nominal_flange_poses(arm, q)
    assert misses(nominal_flange_poses(arm, found.q_rad[found.reached]), X[found.reached]) < 1e-6
    assert found.reached.mean() > 0.999
    farther = np.linalg.norm(found.q_rad - near, axis=1) > 1.05 * np.linalg.norm(q - near, axis=1) + 1e-3
    assert farther.sum() < 0.01 * len(q)
    assert (farther & ~found.ambiguous).sum() < 0.001 * len(q)
    assert found.ambiguous.mean() < 0.05


# Whole turns


def in_one_posture(robot):
    """The same arm with limits that leave room for joint 6 only."""
    lower, upper = HOME - 0.3, HOME + 0.3
    lower[5], upper[5] = -TURN, TURN
    return replace(robot, lower_rad=lower, upper_rad=upper)


def test_a_joint_turns_on_past_half_a_turn_and_back(ur5):
    q = np.tile(HOME, (200, 1))
    q[:, 5] = 5.9 * np.sin(np.linspace(0, TURN, 200))
    q[:, 0] = -3.5 * np.sin(np.linspace(0, TURN, 200))
    for straight in (False, True):
        found = follow(ur5, q, given=[0], straight=straight)
        assert np.abs(found.q_rad - q).max() < 1e-7


def test_at_its_limit_a_joint_turns_back_by_a_whole_turn_but_not_along_a_line(ur5):
    arm = in_one_posture(ur5)
    q = np.tile(HOME, (80, 1))
    q[:, 5] = np.linspace(5.5, 7.0, 80)
    beyond = q[:, 5] > TURN
    found = follow(arm, q, given=[0])
    assert found.reached.all()
    assert np.abs(found.q_rad - q + np.outer(beyond, [0, 0, 0, 0, 0, TURN])).max() < 1e-7
    line = follow(arm, q, given=[0], straight=True)
    assert np.array_equal(line.reached, ~beyond)
    assert np.abs(line.q_rad - q)[~beyond].max() < 1e-7
    first = int(np.argmax(beyond))
    assert not line.start_unknown[: first + 1].any()
    assert line.start_unknown[first + 1 :].all()


def test_half_a_turn_either_way_is_ambiguous_unless_a_limit_forbids_one(ur5):
    arm = in_one_posture(ur5)
    q = np.stack([HOME, HOME])
    q[1, 5] += np.pi - 0.01
    assert follow(arm, q, given=[0]).ambiguous.tolist() == [False, True]
    bounded = replace(arm, lower_rad=np.array([*arm.lower_rad[:5], -1.0]))
    assert not follow(bounded, q, given=[0]).ambiguous.any()


def test_joints_many_turns_away_are_no_place_to_start_from(ur5):
    q = np.stack([HOME, HOME])
    q[0, 0] = 1e4
    found = follow(ur5, q, given=[0])
    assert found.start_unknown.tolist() == [False, True]
    assert np.isnan(found.q_rad[1]).all()


# Straight lines


@pytest.mark.parametrize(
    "q",
    [
        [[0.2, -0.2, 0.4, 0.0, -2.0, 0.1], [1.1, -1.6, 1.4, -2.0, -1.1, 1.3]],
        [[0.8, -1.5, 0.5, -0.1, -2.8, -0.2], [1.5, -2.0, 2.2, -0.8, -0.4, 2.0]],
    ],
    ids=["elbow", "shoulder"],
)
def test_along_a_line_the_posture_stays_although_another_is_nearer(ur5, q):
    q = np.array(q)
    X = nominal_flange_poses(ur5, q)
    line, way = follow(ur5, q, given=[0], straight=True), follow(ur5, q, given=[0])
    assert np.abs(along_line(ur5, q[0], X[1], steps=150) - q[1]).max() < 1e-6
    assert np.abs(line.q_rad[1] - q[1]).max() < 1e-6
    others = with_turns(all_solutions(ur5, X[1]), ur5.lower_rad, ur5.upper_rad)
    nearest = others[np.argmin(np.linalg.norm(others - q[0], axis=1))]
    assert np.abs(way.q_rad[1] - nearest).max() < 1e-6
    assert np.abs(nearest - q[1]).max() > 0.5
    assert line.certain.all()


def test_lines_end_where_small_steps_lead(ur5):
    rng = np.random.default_rng(5)
    followed = 0
    for _ in range(12):
        q = HOME + rng.uniform(-0.9, 0.9, (2, 6))
        q[1, 3:] += rng.uniform(-1.2, 1.2, 3)
        line = follow(ur5, q, given=[0], straight=True)
        try:
            end = along_line(ur5, q[0], nominal_flange_poses(ur5, q)[1], steps=60)
        except AssertionError:
            continue  # the line itself is out of reach somewhere, or singular
        assert np.abs(line.q_rad[1] - end).max() < 1e-6
        followed += 1
    assert followed > 3


def test_a_joint_that_turns_far_on_a_line_is_followed_all_the_way(ur5):
    """Past the axis of the base, tool down: joint 1 sweeps by nearly half a turn, joint 6 by as much the other way."""
    q = np.array([1.2, -1.9, 2.3, -1.97, -np.pi / 2, 0.4])
    X = nominal_flange_poses(ur5, q[None])[0]
    goal = X.copy()
    goal[:2, 3] = X[:2, 3] - 2 * 0.999 * X[:2, 3] + 0.25 * np.array([-X[1, 3], X[0, 3]]) / np.hypot(*X[:2, 3])
    end = along_line(ur5, q, goal, steps=500)
    assert np.abs(end - q).max() > 2.0
    found = follow(ur5, np.stack([q, end]), given=[0], straight=True, X=np.stack([X, goal]))
    assert np.abs(found.q_rad[1] - end).max() < 1e-6
    assert found.certain[1]


def test_a_line_through_a_singularity_is_ambiguous(ur5):
    """Axis 5 upright and the tool level, never turning: joints 1 and 5 turn alike, and joint 5 through zero."""
    q = np.array([[0.3, -1.2, 1.9, -0.7, 0.3, 0.4], [-0.3, -1.2, 1.9, -0.7, -0.3, 0.4]])
    X = nominal_flange_poses(ur5, q)
    assert np.abs(X[0, :3, :3] - X[1, :3, :3]).max() < 1e-12
    found = follow(ur5, q, given=[0], straight=True)
    assert found.ambiguous.tolist() == [False, True]
    assert found.reached.all()


# What cannot be told


def test_a_wrist_in_line_leaves_joints_4_and_6_open(ur5):
    q = np.stack([HOME, HOME, HOME])
    q[1, 4] = 0.0
    found = follow(ur5, q, given=[0])
    assert found.ambiguous.tolist() == [False, True, False]
    assert found.certain.tolist() == [True, False, False]
    assert misses(DrakeArm("ur5").flange_poses(found.q_rad), DrakeArm("ur5").flange_poses(q)) < 1e-7


def test_joints_with_the_wrist_in_line_and_the_elbow_stretched_are_a_start(ur5):
    """The home position of every UR: known as joints, but a line from there may go either way."""
    q = np.stack([[0, -np.pi / 2, 0, -np.pi / 2, 0, 0], [0.1, -1.4, 0.5, -1.2, -0.4, 0.1]])
    found = follow(ur5, q, given=[0])
    assert np.abs(found.q_rad - q).max() < 1e-7
    assert follow(ur5, q, given=[0], straight=True).ambiguous.tolist() == [False, True]


def test_poses_out_of_reach_are_not_reached_and_after_them_nothing_is_known(ur5):
    q = smooth(6)
    X = nominal_flange_poses(ur5, q)
    X[2, :3, 3] *= 3
    found = follow(ur5, q, given=[0, 4], X=X)
    assert found.reached.tolist() == [True, True, False, False, True, True]
    assert found.start_unknown.tolist() == [False, False, False, True, False, False]
    assert np.isnan(found.q_rad[2:4]).all()
    assert found.certain.tolist() == found.reached.tolist()


def test_a_pose_inside_the_column_of_the_shoulder_is_out_of_reach(ur5):
    q = smooth(2)
    X = nominal_flange_poses(ur5, q)
    X[1, :3, 3] = [0.0, 0.0, 0.6]
    X[1, :3, :3] = np.diag([1.0, -1.0, -1.0])
    assert follow(ur5, q, given=[0], X=X).reached.tolist() == [True, False]


def test_a_start_that_nobody_knows_is_told_until_joints_are_known_again(ur5):
    q = smooth(8)
    found = follow(ur5, q, given=[4], previous=[-1, 0, 1, 2, 3, 4, -1, 6])
    assert found.start_unknown.tolist() == [True] * 4 + [False, False, True, True]
    assert np.isnan(found.q_rad[found.start_unknown]).all()
    assert np.abs(found.q_rad - q)[4:6].max() < 1e-7
    assert not found.reached[found.start_unknown].any()


def test_targets_that_run_in_circles_have_no_start_unless_joints_are_among_them(ur5):
    q = smooth(6)
    circle = follow(ur5, q, previous=[2, 0, 1, 5, 3, 4], given=[3])
    assert circle.start_unknown.tolist() == [True] * 3 + [False] * 3
    assert np.abs(circle.q_rad - q)[3:].max() < 1e-7


def test_no_targets_are_no_fault(ur5):
    found = follow(ur5, np.empty((0, 6)))
    assert found.q_rad.shape == (0, 6)
    assert found.certain.shape == (0,)


# Other arms


@pytest.fixture
def bent(ur5):
    """Six joints of which only 2 and 3 are parallel."""
    X_BA = ur5.X_BA.copy()
    X_BA[3, :3, :3] = Rotation.from_rotvec([0, 0, 0.7]).as_matrix() @ X_BA[3, :3, :3]
    return replace(ur5, name="bent", X_BA=X_BA)


@pytest.mark.parametrize("straight", [False, True])
def test_an_arm_without_a_closed_form_is_followed_in_small_steps(bent, straight):
    assert ThreeParallelAxes.of(bent) is None
    q = smooth(12)
    found = follow(bent, q, given=[0, 7], previous=[-1, 0, 1, 2, 2, -1, 5, -1, 7, 8, 9, 10], straight=straight)
    known = np.ones(12, bool)
    known[5:7] = False
    assert np.abs(found.q_rad - q)[known].max() < 1e-6
    assert np.array_equal(found.start_unknown, ~known)
    assert np.array_equal(found.certain, known)


def test_such_an_arm_says_what_it_cannot_reach(bent):
    q = smooth(4)
    X = nominal_flange_poses(bent, q)
    X[1, :3, 3] *= 3
    near = np.full((4, 6), np.nan)
    near[3] = q[3] + 0.05
    found = follow(bent, q, given=[0], X=X, near=near)
    assert found.reached.tolist() == [True, False, False, True]
    assert found.start_unknown.tolist() == [False, False, True, False]
    assert np.abs(found.q_rad[3] - q[3]).max() < 1e-6


# Refusals and speed


def test_poses_for_seven_joints_are_refused_but_joints_are_not(seven):
    q = np.zeros((2, 7))
    assert follow(seven, q, given=[0, 1]).reached.all()
    with pytest.raises(InputError, match="six joints"):
        follow(seven, q, given=[0])


@pytest.mark.parametrize(
    ("change", "column"),
    [
        ({"previous": [-1, 2, 1]}, None),
        ({"previous": [-1, 3, 1]}, "previous"),
        ({"previous": [-2, 0, 1]}, "previous"),
        ({"previous": [-1, 0]}, "previous"),
        ({"near": np.full((3, 5), np.nan)}, "q_near_rad"),
        ({"near": np.array([[np.nan] * 5 + [1]] * 3)}, "q_near_rad"),
        ({"near": np.full((3, 6), np.inf)}, "q_near_rad"),
        ({"X": np.full((3, 4, 4), np.nan)}, "X"),
        ({"X": np.zeros((3, 3, 4))}, "X"),
        ({"start": np.full(6, np.nan)}, "q_start"),
        ({"start": np.zeros(5)}, "q_start"),
    ],
)
def test_what_does_not_go_together_is_refused(ur5, change, column):
    q = smooth(3)
    if column is None:
        assert follow(ur5, q, given=[0], **change).start_unknown.tolist() == [False, True, True]
        return
    with pytest.raises(InputError) as caught:
        follow(ur5, q, given=[0], **change)
    assert caught.value.column == column


@pytest.mark.parametrize("straight", [False, True])
def test_a_hundred_thousand_poses_take_about_a_second(ur5, straight):
    q = smooth(100_000)
    X = np.concatenate([nominal_flange_poses(ur5, part) for part in np.array_split(q, 100)])
    spent = []
    for _ in range(3):
        start = time.process_time()
        found = follow(ur5, q, given=[0], straight=straight, X=X)
        spent.append(time.process_time() - start)
    assert np.abs(found.q_rad - q).max() < 1e-7
    assert min(spent) < 2.0  # 0.4 and 0.8 s where nobody else is at work
