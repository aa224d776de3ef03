"""The ways between targets as they are sampled: where they go, and where the robot cannot follow them."""

import time

import numpy as np
import pytest
from drake_arm import DrakeArm
from hand_made import ARC, JOINT, LINEAR, PROCESS, THROUGH, at, motions
from scipy.spatial.transform import Rotation
from truepath.controller import controller_of
from truepath.correct import correct
from truepath.errors import CorrectionError
from truepath.model import CalibratedModel, nominal_model
from truepath.rewriting.plan import plan_targets
from truepath.rewriting.vias import choose_vias
from truepath.rewriting.ways import sample_ways

READY = [0.3, -1.6, -1.8, -1.2, 1.5, 0.2]
DOWN = (2.2, 2.2, 0.0)
TOOL = at(0.03, -0.05, 0.14, (0.2, -0.4, 0.1))


@pytest.fixture(scope="module")
def controller(ur5):
    return controller_of(ur5)


@pytest.fixture(scope="module")
def bent(ur5):
    """A UR5 whose axes are off by tenths of a millimetre and of a milliradian."""
    p = np.concatenate([np.random.default_rng(4).normal(scale=4e-4, size=24), np.zeros(12)])
    return CalibratedModel(ur5, p, np.eye(4), np.eye(4), np.eye(4), np.eye(4))


def sampled(made, robot, controller, model=None):
    """Plan, ways and findings of motions."""
    plan = plan_targets(made, robot, controller, "x.script", None)
    ways, findings = sample_ways(plan, model or nominal_model(robot), controller, 5.0, "x.script")
    return plan, ways, findings


def after_joints(poses, kinds=None, **options):
    """Motions to poses after one of the joints to READY."""
    X = np.full((len(poses) + 1, 4, 4), np.nan)
    X[1:] = poses
    q = np.full((len(poses) + 1, 6), np.nan)
    q[0] = READY
    return motions([JOINT, *(kinds or [LINEAR] * len(poses))], X, q, **options)


def test_a_line_is_straight_and_turns_evenly(ur5, controller):
    one, two = at(0.25, -0.4, 0.2, DOWN), at(0.5, -0.25, 0.4, (2.0, 2.1, 0.4))
    made = after_joints([one, two], tools=[TOOL])
    _, ways, findings = sampled(made, ur5, controller)
    assert findings == []
    assert ways.followed.all()
    X = ways.X_CT[ways.samples(1)]
    share = ways.share[ways.samples(1)]
    assert np.diff(share, prepend=0, append=1).max() * ways.length_m[1] <= 0.020 + 1e-9
    assert X[:, :3, 3] == pytest.approx(one[:3, 3] + share[:, None] * (two - one)[:3, 3], abs=1e-12)
    whole = Rotation.from_matrix(one[:3, :3].T @ two[:3, :3]).as_rotvec()
    steps = Rotation.from_matrix(one[:3, :3].T @ X[:, :3, :3]).as_rotvec()
    assert steps == pytest.approx(share[:, None] * whole, abs=1e-9)
    assert ways.length_m[1] == pytest.approx(np.linalg.norm((two - one)[:3, 3]))
    assert ways.turn_rad[1] == pytest.approx(np.linalg.norm(whole))


def test_the_joints_on_the_way_are_those_that_drake_has(ur5, controller, bent):
    made = after_joints([at(0.25, -0.4, 0.2, DOWN), at(0.5, -0.25, 0.4, (2.0, 2.1, 0.4))], tools=[TOOL])
    _, ways, _ = sampled(made, ur5, controller, bent)
    drake = DrakeArm("ur5")
    assert drake.flange_poses(ways.q_rad) @ TOOL == pytest.approx(ways.X_CT, abs=1e-8)
    assert drake.flange_poses(ways.q_corrected_rad) @ TOOL == pytest.approx(ways.X_CT_commanded, abs=1e-8)
    assert bent.flange_poses(ways.q_corrected_rad) @ TOOL == pytest.approx(ways.X_CT, abs=1e-6)
    assert np.abs(ways.X_CT_commanded - ways.X_CT).max() > 1e-4


def test_an_arc_is_sampled_on_its_circle(ur5, controller):
    centre = np.array([0.35, -0.4, 0.25])
    points = [centre + 0.1 * np.array([np.cos(a), np.sin(a), 0.0]) for a in (0.0, 1.0, 2.5)]
    poses = [at(*points[0], DOWN), at(*points[1], DOWN), at(*points[2], (2.0, 2.1, 0.4))]
    _, ways, findings = sampled(after_joints(poses, [LINEAR, THROUGH, ARC]), ur5, controller)
    assert findings == []
    assert ways.target.tolist() == [1, 3]
    assert ways.length_m[1] == pytest.approx(0.25)
    share, X = ways.share[ways.samples(1)], ways.X_CT[ways.samples(1)]
    angle = 2.5 * share[:, None]
    expected = centre + 0.1 * np.hstack([np.cos(angle), np.sin(angle), 0 * angle])
    assert X[:, :3, 3] == pytest.approx(expected, abs=1e-9)
    whole = Rotation.from_matrix(poses[0][:3, :3].T @ poses[2][:3, :3]).as_rotvec()
    steps = Rotation.from_matrix(poses[0][:3, :3].T @ X[:, :3, :3]).as_rotvec()
    assert steps == pytest.approx(share[:, None] * whole, abs=1e-9)


def test_with_another_tool_the_line_begins_where_that_tool_is(ur5, controller):
    one, two = at(0.25, -0.4, 0.3, DOWN), at(0.45, -0.25, 0.35, DOWN)
    made = after_joints([one, two], tools=[np.eye(4), TOOL], tool=[0, 0, 1])
    _, ways, _ = sampled(made, ur5, controller)
    begins = one @ TOOL
    share = ways.share[ways.samples(1)][:, None]
    X = ways.X_CT[ways.samples(1)]
    assert X[:, :3, 3] == pytest.approx(begins[:3, 3] + share * (two - begins)[:3, 3], abs=1e-9)
    assert ways.length_m[1] == pytest.approx(np.linalg.norm((two - begins)[:3, 3]))


def test_a_change_of_the_tool_alone_adds_nothing(ur5, controller):
    """What is added is for the errors of the robot; this one has none."""
    one, two = at(0.25, -0.4, 0.3, DOWN), at(0.45, -0.25, 0.35, DOWN)
    for kinds in ([LINEAR, LINEAR], [LINEAR, PROCESS]):
        plan, ways, _ = sampled(
            after_joints([one, two], kinds, tools=[np.eye(4), TOOL], tool=[0, 0, 1]), ur5, controller
        )
        X_end = controller.tool_poses(plan.q_rad, plan.motions.X_0T)
        vias = choose_vias(plan, ways, X_end, 0.001, lambda at: True)
        assert vias.before_mm == pytest.approx(0, abs=1e-6)
        assert vias.added == []


def test_an_arc_begins_where_the_tool_in_force_is(ur5, controller):
    points = [at(0.35 + 0.1 * np.cos(a), -0.35 + 0.1 * np.sin(a), 0.3, DOWN) for a in (0.0, 1.0, 2.0)]
    kinds = [LINEAR, THROUGH, ARC]
    plan, ways, _ = sampled(
        after_joints([points[0] @ np.linalg.inv(TOOL), *points[1:]], kinds, tools=[np.eye(4), TOOL], tool=[0, 0, 1, 1]),
        ur5,
        controller,
    )
    assert ways.length_m[1] == pytest.approx(0.2)
    X_end = controller.tool_poses(plan.q_rad, plan.motions.X_0T)
    assert choose_vias(plan, ways, X_end, 0.001, lambda at: True).before_mm[1] == pytest.approx(0, abs=1e-6)


def test_targets_that_coincide_have_no_way_between_them(ur5, controller, bent):
    X = at(0.3, -0.4, 0.25, DOWN)
    plan, ways, findings = sampled(after_joints([X, X, X], [LINEAR, PROCESS, LINEAR]), ur5, controller, bent)
    assert findings == []
    assert np.diff(ways.first)[1:].tolist() == [0, 0]
    assert ways.length_m[1:] == pytest.approx(0)
    X_end = controller.tool_poses(plan.q_rad, np.eye(4))
    vias = choose_vias(plan, ways, X_end, 0.001, lambda at: True)
    assert vias.before_mm[1:] == pytest.approx(0)
    assert not [via for via in vias.added if via.target > 1]


def test_a_turn_on_the_spot_is_looked_at_too(ur5, controller, bent):
    here = at(0.3, -0.4, 0.25, DOWN)
    turned = here @ at(0, 0, 0, (0.3, 0.9, 0.0))
    plan, ways, findings = sampled(after_joints([here, turned]), ur5, controller, bent)
    assert findings == []
    assert ways.length_m[1] == pytest.approx(0, abs=1e-12)
    samples = ways.samples(1)
    assert samples.stop - samples.start >= 3
    assert ways.X_CT[samples][:, :3, 3] == pytest.approx(np.tile(here[:3, 3], (samples.stop - samples.start, 1)))
    X_end = controller.tool_poses(ways.q_corrected_rad[:1], np.eye(4)).repeat(3, axis=0)
    assert np.isfinite(choose_vias(plan, ways, X_end, 0.05, lambda at: True).after_mm).all()


@pytest.mark.parametrize("previous", [[-1, -1, 1], [-1, 0, -1]])
def test_a_line_from_nobody_knows_where_is_not_looked_at(ur5, controller, previous):
    poses = [at(0.25, -0.4, 0.2, DOWN), at(0.45, -0.25, 0.4, DOWN)]
    made = after_joints(poses, previous=previous)
    made.q_near_rad[[k for k in (1, 2) if previous[k] < 0]] = READY
    _, ways, findings = sampled(made, ur5, controller)
    assert ways.target.tolist() == [k for k in (1, 2) if previous[k] >= 0]
    assert findings == []


def test_a_line_through_a_wrist_singularity_is_said_not_to_be_followed(ur5, controller, bent):
    """The fifth joint goes from one side of zero to the other; a line that misses zero turns others by half a turn."""
    drake = DrakeArm("ur5")
    two = drake.flange_poses([[0.3, -1.6, -1.8, -1.2, -0.35, 0.2]])[0]
    two[:3, 3] += [0.02, 0.05, 0.03]
    two[:3, :3] = two[:3, :3] @ Rotation.from_rotvec([0.05, 0.0, 0.1]).as_matrix()
    q = np.full((2, 6), np.nan)
    q[0] = [0.3, -1.6, -1.8, -1.2, 0.35, 0.2]
    made = motions([JOINT, LINEAR], [np.full((4, 4), np.nan), two], q)
    plan, ways, findings = sampled(made, ur5, controller, bent)
    assert not ways.followed[0]
    assert [(finding.level, finding.line) for finding in findings] == [("warning", 11)]
    assert "singularity" in findings[0].message
    X_end = controller.tool_poses(plan.q_rad, np.eye(4))
    vias = choose_vias(plan, ways, X_end, 0.01, lambda at: True)
    assert (vias.added, vias.after_mm.tolist()) == ([], [0.0])


def test_a_line_through_the_column_of_the_robot_is_said_not_to_be_followed(ur5, controller):
    """Both ends can be reached, the middle of the way cannot: the shoulder keeps the wrist off its own axis."""
    drake = DrakeArm("ur5")
    q_one = np.array([0.0, -1.2, -2.0, -1.5, 1.57, 0.0])
    one = drake.flange_poses([q_one])[0]
    two = one.copy()
    two[:2, 3] *= -1
    q = np.full((2, 6), np.nan)
    q[0] = q_one
    made = motions([JOINT, LINEAR], [np.full((4, 4), np.nan), two], q)
    made.q_near_rad[1] = q_one + np.array([np.pi, 0, 0, 0, 0, np.pi])
    _, ways, findings = sampled(made, ur5, controller)
    assert not ways.followed[0]
    assert [finding.guard for finding in findings] == ["path"]


def test_a_correction_on_the_way_that_is_too_large_is_refused_with_its_line(ur5, controller, bent):
    made = after_joints([at(0.25, -0.4, 0.2, DOWN), at(0.5, -0.25, 0.4, DOWN)])
    plan = plan_targets(made, ur5, controller, "x.script", None)
    with pytest.raises(CorrectionError, match="larger than allowed") as caught:
        sample_ways(plan, bent, controller, 0.01, "x.script")
    assert caught.value.line == 11
    assert caught.value.file == "x.script"


def zigzag(count, step_m):
    """Poses on a plane, rows to and fro, all a step apart."""
    per_row = int(0.3 / step_m)
    row, column = np.divmod(np.arange(count), per_row)
    x = 0.25 + step_m * np.where(row % 2 == 0, column, per_row - 1 - column)
    y = -0.45 + step_m * np.abs((row + per_row) % (2 * per_row) - per_row)
    X = np.broadcast_to(at(0, 0, 0.2, DOWN), (count, 4, 4)).copy()
    X[:, 0, 3], X[:, 1, 3] = x, y
    return X


@pytest.mark.parametrize(("count", "step_m", "most_s"), [(100_000, 0.001, 1.0), (20_000, 0.020, 3.0)])
def test_very_many_short_lines_take_little_time(ur5, controller, bent, count, step_m, most_s):
    made = after_joints(zigzag(count, step_m))
    plan = plan_targets(made, ur5, controller, "x.script", None)
    corrected = correct(bent, plan.q_rad, previous=plan.motions.previous)
    X_end = controller.tool_poses(corrected.q_rad, np.eye(4))
    start = time.perf_counter()
    ways, findings = sample_ways(plan, bent, controller, 5.0, "x.script")
    vias = choose_vias(plan, ways, X_end, 0.05, lambda at: True)
    seconds = time.perf_counter() - start
    assert ways.followed.all()
    assert findings == []
    assert len(vias.added) < 100
    assert seconds < most_s
