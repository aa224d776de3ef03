"""How far the probe goes when something small moves: Drake moves it, and finite differences tell."""

import numpy as np
import pytest
from deviated_plant import DeviatedPlant, pose, step
from scipy.spatial.transform import Rotation
from truepath.motions import COMPONENTS, ChainPoses, Moves
from truepath.plants import load_plant

STEP = 1e-5  # m and rad, to either side
ALL_SIX = ("x", "y", "z", "rx", "ry", "rz")


class Chain:
    """An arm with deviated axes that stands askew before the tracker, with a probe off the flange; 6 poses."""

    def __init__(self, robot, plant):
        rng = np.random.default_rng(3)
        n = robot.num_joints
        self.robot, self.q = robot, rng.uniform(-2, 2, (6, n))
        self.p = np.concatenate([1e-2 * rng.uniform(-1, 1, 4 * n), np.zeros(12)])
        self.X_MB = pose(Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix(), [3.0, -1.0, 0.5])
        self.X_FE = pose(Rotation.from_rotvec([-0.7, 0.2, 0.9]).as_matrix(), [0.05, -0.02, 0.13])
        self.drake = DeviatedPlant(robot, plant, self.p)
        self.chain = ChainPoses.of(robot, self.p, self.q, self.X_MB, self.X_FE)

    def probe_poses(self, flange_pose=None, X_MB=None, X_FE=None):
        """``(6, 4, 4)`` by Drake; ``flange_pose`` takes joints to X_BF."""
        X_MB, X_FE = (self.X_MB if X_MB is None else X_MB), (self.X_FE if X_FE is None else X_FE)
        return np.stack([X_MB @ (flange_pose or self.drake.flange_pose)(q) @ X_FE for q in self.q])

    def slope(self, moved):
        """``(6, 6)`` shift and turn of the probe by unit step, where ``moved(h)`` are its poses after a step h."""
        before, after = moved(-STEP), moved(STEP)
        turn = Rotation.from_matrix(after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], 1, 2)).as_rotvec()
        return np.concatenate([after[:, :3, 3] - before[:, :3, 3], turn], axis=1) / (2 * STEP)


@pytest.fixture(scope="module")
def ur5_chain(ur5):
    return Chain(ur5, load_plant("ur5"))


@pytest.fixture(scope="module")
def seven_chain(seven, seven_joint_arm):
    return Chain(seven, load_plant(seven_joint_arm))


@pytest.fixture(params=["ur5_chain", "seven_chain"])
def arm(request):
    return request.getfixturevalue(request.param)


def small(component, size):
    """A step of one component."""
    k = ALL_SIX.index(component)
    return step(*(size * np.eye(6)[k]))


def assert_agree(displacement, slopes):
    np.testing.assert_allclose(displacement, np.stack(slopes, axis=2), atol=1e-8)


def test_the_probe_of_the_chain_is_where_drake_has_it(arm):
    np.testing.assert_allclose(arm.chain.X_ME, arm.probe_poses(), atol=1e-9)


def test_a_joint_that_turns_a_little_further_moves_the_probe_as_in_drake(arm):
    for joint in range(1, arm.robot.num_joints + 1):
        e = np.eye(arm.robot.num_joints)[joint - 1]
        slope = arm.slope(lambda h, e=e: arm.probe_poses(lambda q: arm.drake.flange_pose(q + h * e)))
        assert_agree(arm.chain.displacement(Moves.JOINT, joint), [slope])


def test_what_an_axis_carries_moves_in_the_frame_of_that_axis_as_in_drake(arm):
    for joint in range(1, arm.robot.num_joints + 1):
        slopes = []
        for name in COMPONENTS[Moves.AXIS]:

            def moved(h, joint=joint, name=name):
                return arm.probe_poses(lambda q: arm.drake.flange_pose_with_axis_moved(joint, small(name, h), q))

            slopes.append(arm.slope(moved))
        assert_agree(arm.chain.displacement(Moves.AXIS, joint), slopes)


def test_a_base_that_moves_carries_everything_along(arm):
    slopes = [arm.slope(lambda h, c=c: arm.probe_poses(X_MB=arm.X_MB @ small(c, h))) for c in COMPONENTS[Moves.BASE]]
    assert_agree(arm.chain.displacement(Moves.BASE), slopes)


def test_a_probe_that_slips_shifts_along_and_turns_about_the_axes_of_the_flange(arm):
    def slipped(name, h):
        X_FE, by = arm.X_FE.copy(), small(name, h)
        X_FE[:3, 3] += by[:3, 3]
        X_FE[:3, :3] = by[:3, :3] @ X_FE[:3, :3]
        return arm.probe_poses(X_FE=X_FE)

    slopes = [arm.slope(lambda h, c=c: slipped(c, h)) for c in COMPONENTS[Moves.PROBE]]
    assert_agree(arm.chain.displacement(Moves.PROBE), slopes)


def test_longer_links_shift_the_flange_away_from_the_base_and_turn_nothing(ur5):
    """Every joint frame and the flange at (1 + s) times its place in the frame before it, by Drake; no deviations."""
    arm = Chain(ur5, load_plant("ur5"))
    arm.p = np.zeros_like(arm.p)
    arm.drake = DeviatedPlant(ur5, arm.drake.plant, arm.p)

    def grown(s):
        context = arm.drake.context
        frames = [joint.frame_on_parent() for joint in arm.drake.joints]
        before = [frame.GetPoseInParentFrame(context) for frame in frames]
        X_LF = arm.drake.X_LF
        try:
            for joint, X in zip(arm.drake.joints, before, strict=True):
                longer = X.GetAsMatrix4()
                longer[:3, 3] *= 1 + s
                arm.drake._place(joint, longer)
            arm.drake.X_LF = X_LF.copy()
            arm.drake.X_LF[:3, 3] *= 1 + s
            return arm.probe_poses()
        finally:
            arm.drake.X_LF = X_LF
            for frame, X in zip(frames, before, strict=True):
                frame.SetPoseInParentFrame(context, X)

    chain = ChainPoses.of(ur5, arm.p, arm.q, arm.X_MB, arm.X_FE)
    assert_agree(chain.displacement(Moves.ROBOT_LENGTHS), [arm.slope(grown)])


def test_a_tracker_with_a_longer_metre_shifts_every_reading_away_from_itself(arm):
    def misread(s):
        X_ME = arm.probe_poses()
        X_ME[:, :3, 3] *= 1 + s
        return X_ME

    assert_agree(arm.chain.displacement(Moves.MEASURED_LENGTHS), [arm.slope(misread)])


def test_a_reading_moves_along_the_axes_of_the_tracker_whatever_the_robot_does(arm):
    slopes = [arm.slope(lambda h, c=c: arm.probe_poses(X_MB=small(c, h) @ arm.X_MB)) for c in ("x", "y", "z")]
    assert_agree(arm.chain.displacement(Moves.READING), slopes)


def test_every_kind_of_motion_says_what_each_of_its_components_does(arm):
    for moves, components in COMPONENTS.items():
        joint = 2 if moves in (Moves.JOINT, Moves.AXIS) else None
        assert arm.chain.displacement(moves, joint).shape == (6, 6, len(components))


def test_some_of_the_poses_give_their_own_rows(arm):
    rows = np.array([4, 1])
    for moves, joint in ((Moves.JOINT, 3), (Moves.AXIS, 1), (Moves.BASE, None), (Moves.ROBOT_LENGTHS, None)):
        own = arm.chain.subset(rows).displacement(moves, joint)
        np.testing.assert_array_equal(own, arm.chain.displacement(moves, joint)[rows])


def test_five_motions_of_each_axis_leave_no_sixth_that_a_joint_does_not_make(arm):
    """Shift along x, y, z and tilt about x, y by the axis, the turn about z by its joint: all six that there are."""
    for joint in range(1, arm.robot.num_joints + 1):
        moved = [arm.chain.displacement(kind, joint) for kind in (Moves.AXIS, Moves.JOINT)]
        assert (np.linalg.matrix_rank(np.concatenate(moved, axis=2)) == 6).all()
