"""The real robot in a host's own context, judged by Drake: kinematics, inverse kinematics, and what must not change."""

import numpy as np
import pytest
from foreign_host import X_FG, X_GT, RealCell, arm_instance, build_plant, path, plugin_for, some_joints
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, FixedOffsetFrame, SpatialInertia
from pydrake.solvers import Solve
from pydrake.systems.framework import DiagramBuilder
from truepath import plants
from truepath.errors import InputError
from truepath.host import CalibrationPlugin


def bodies_of(plant, *names):
    instances = {int(plant.GetModelInstanceByName(name)) for name in names}
    bodies = [plant.get_body(BodyIndex(b)) for b in range(plant.num_bodies())]
    return [body for body in bodies if int(body.model_instance()) in instances]


def poses_of(context, bodies):
    return np.array([body.EvalPoseInWorld(context).GetAsMatrix4() for body in bodies])


def at(plant, plugin, q):
    """A context with the right arm at joints ``(6,)`` and everything else anywhere."""
    context = plant.CreateDefaultContext()
    positions = plant.GetPositions(context)
    positions[:6] = [0.1, -0.7, 0.9, 0.2, -0.4, 1.0]
    positions[plugin.arm] = q
    plant.SetPositions(context, positions)
    return context


def test_forward_kinematics_of_the_context_are_those_of_the_calibration(plant, rigid):
    model = rigid.calibration.model
    X_WB = rigid.robot.X_WB @ np.linalg.inv(model.X_MB_nominal) @ model.X_MB
    X_FT = model.X_FE @ np.linalg.inv(model.X_FE_nominal) @ X_FG.GetAsMatrix4() @ X_GT.GetAsMatrix4()
    flange = plant.GetFrameByName("flange", arm_instance(plant, "right"))
    tcp = plant.GetFrameByName("tcp", plant.GetModelInstanceByName("right_tool"))
    for q in some_joints(20, 1):
        context = at(plant, rigid, q)
        rigid.apply(context)
        X_WF = X_WB @ model.flange_poses(q[None])[0]
        assert np.abs(flange.CalcPoseInWorld(context).GetAsMatrix4() - X_WF).max() < 1e-9
        # A probe at the tip tells nothing of its own orientation: X_FE has none, the nominal one neither.
        assert np.linalg.norm(tcp.CalcPoseInWorld(context).translation() - (X_WF @ X_FT)[:3, 3]) < 1e-9


def test_it_is_the_real_robot(plant, rigid, rigid_cell, drawn):
    tcp = plant.GetFrameByName("tcp", plant.GetModelInstanceByName("right_tool"))
    off = []
    for q in path(20):
        context = at(plant, rigid, q)
        rigid.apply(context)
        off.append(np.linalg.norm(tcp.CalcPoseInWorld(context).translation() - rigid_cell.poses(q)[0, :3, 3]))
    assert np.linalg.norm((drawn.poses(path(20)) - rigid_cell.poses(path(20)))[:, :3, 3], axis=1).min() > 0.5e-3
    assert max(off) < 0.05e-3


def test_everything_else_stays_to_the_bit(plant, rigid):
    context, untouched = (at(plant, rigid, path(3)[1]) for _ in range(2))
    applied = rigid.apply(context)
    assert (applied.base, applied.tool, applied.left_out) == ("frame", "frame", ())
    assert "wall" in " ".join(applied.frames)
    assert "gripper_mount" in " ".join(applied.frames)
    assert np.array_equal(plant.GetPositionsAndVelocities(context), plant.GetPositionsAndVelocities(untouched))
    others = bodies_of(plant, "WorldModelInstance", "DefaultModelInstance", "left::ur5", "left_tool")
    assert len(others) > 10
    assert np.array_equal(poses_of(context, others), poses_of(untouched, others))
    own = bodies_of(plant, "right::ur5", "right_tool")
    assert (np.abs(poses_of(context, own) - poses_of(untouched, own)).max(axis=(1, 2)) > 1e-5).all()
    moved = {name.split("::")[-1] for name in applied.frames}
    for index in range(plant.num_frames()):
        frame = plant.get_frame(type(plant.world_frame().index())(index))
        if isinstance(frame, FixedOffsetFrame) and (
            frame.name() not in moved or frame.model_instance() == arm_instance(plant, "left")
        ):
            X, X_before = (frame.GetPoseInParentFrame(each).GetAsMatrix4() for each in (context, untouched))
            assert np.array_equal(X, X_before), frame.scoped_name().get_full()


def test_reset_brings_the_drawing_back_to_the_bit(plant, rigid):
    context, untouched = (at(plant, rigid, path(3)[1]) for _ in range(2))
    rigid.apply(context)
    rigid.apply(context)  # not added to what is there
    twice = poses_of(context, bodies_of(plant, "right_tool"))
    once = at(plant, rigid, path(3)[1])
    rigid.apply(once)
    assert np.array_equal(twice, poses_of(once, bodies_of(plant, "right_tool")))
    rigid.reset(context)
    bodies = [plant.get_body(BodyIndex(b)) for b in range(plant.num_bodies())]
    assert np.array_equal(poses_of(context, bodies), poses_of(untouched, bodies))


def test_a_robot_without_errors_is_left_where_it_is(plant, drawn):
    plugin = plugin_for(plant)
    q = some_joints(60, 7)
    plugin.calibrate(plugin.measurements(q, drawn.measure(q, 0, noise_mm=0.0)), effects=())
    context, untouched = (at(plant, plugin, path(3)[1]) for _ in range(2))
    plugin.apply(context)
    bodies = bodies_of(plant, "right::ur5", "right_tool")
    assert np.abs(poses_of(context, bodies) - poses_of(untouched, bodies)).max() < 1e-6


def test_drakes_inverse_kinematics_find_joints_that_take_the_real_tool_there(plant, rigid, rigid_cell, drawn):
    q_start = path(5)[2]
    goal = drawn.poses(q_start)[0]
    tcp = plant.GetFrameByName("tcp", plant.GetModelInstanceByName("right_tool"))

    def solved(context):
        problem = InverseKinematics(plant, context)
        problem.AddPositionConstraint(tcp, [0, 0, 0], plant.world_frame(), goal[:3, 3], goal[:3, 3])
        guess = plant.GetPositions(context)
        others = np.setdiff1d(np.arange(plant.num_positions()), rigid.arm)
        problem.prog().AddBoundingBoxConstraint(guess[others], guess[others], problem.q()[others])
        problem.prog().SetInitialGuess(problem.q(), guess)
        result = Solve(problem.prog())
        assert result.is_success()
        return result.GetSolution(problem.q())[rigid.arm]

    nominal, calibrated_ = at(plant, rigid, q_start + 0.05), at(plant, rigid, q_start + 0.05)
    rigid.apply(calibrated_)
    missed = [
        np.linalg.norm(rigid_cell.poses(solved(context))[0, :3, 3] - goal[:3, 3]) for context in (nominal, calibrated_)
    ]
    assert missed[0] > 0.5e-3
    assert missed[1] < 0.05e-3


def test_the_context_of_a_diagram_will_do_and_collisions_are_those_of_the_real_robot(rigid):
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    build_plant(plant)
    diagram = builder.Build()
    plugin = plugin_for(plant)
    plugin.use(rigid.calibration)
    root = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(root)
    arm = arm_instance(plant, "right")
    plant.SetPositions(own, arm, np.insert(path(3)[1], 2, 0.0))

    def hand():
        query = plant.get_geometry_query_input_port().Eval(own)
        link = plant.GetBodyByName("wrist_3_link", arm)
        shape = query.inspector().GetGeometries(plant.GetBodyFrameIdOrThrow(link.index()))[0]
        return query.GetPoseInWorld(shape).GetAsMatrix4()

    before = hand()
    plugin.apply(root)
    assert 1e-4 < np.linalg.norm((hand() - before)[:3, 3]) < 5e-3
    plugin.reset(own)
    assert np.array_equal(hand(), before)
    with pytest.raises(InputError, match="does not belong to the plant"):
        plugin.apply(build_plant().CreateDefaultContext())


def test_base_and_tool_can_be_left_as_drawn(plant, rigid):
    context = at(plant, rigid, path(3)[1])
    applied = rigid.apply(context, base=False, tool=False)
    assert (applied.base, applied.tool) == ("as drawn", "as drawn")
    for name in ("wall", "gripper_mount"):
        frame = plant.GetFrameByName(name)
        X, X_drawn = (frame.GetPoseInParentFrame(each) for each in (context, plant.CreateDefaultContext()))
        assert X.IsExactlyEqualTo(X_drawn)


def test_the_report_says_what_no_frame_can_carry(plant, soft):
    assert soft.apply(at(plant, soft, path(3)[1])).left_out == ("joint_compliance",)


# Hosts that weld without frames of their own


def plain_host(tool_frame=False, base_frame=False):
    """A single UR5 with a tool; base and tool welded with or without a frame of their own."""
    plant = MultibodyPlant(0.0)
    (arm,) = plants.make_parser(plant).AddModels(str(plants.resolve("ur5")))
    X_WB, X_FT = RigidTransform(RollPitchYaw(0.2, 0.1, 0.5), [0.3, 0.2, 0.9]), RigidTransform([0.0, 0.05, 0.1])
    base, flange = plant.GetBodyByName("base_link", arm).body_frame(), plant.GetFrameByName("flange", arm)
    tool = plant.AddRigidBody("pen", plant.AddModelInstance("pen"), SpatialInertia.SolidCubeWithDensity(500.0, 0.05))
    if base_frame:
        mount = plant.AddFrame(FixedOffsetFrame("plinth", plant.world_frame(), X_WB))
        plant.AddFrame(FixedOffsetFrame("lamp", mount, RigidTransform([0.0, 0.0, 1.0])))
        plant.WeldFrames(mount, base)
    else:
        plant.WeldFrames(plant.world_frame(), base, X_WB)
    if tool_frame:
        holder = plant.AddFrame(FixedOffsetFrame("holder", flange, X_FT))
        plant.WeldFrames(holder, tool.body_frame())
    else:
        plant.WeldFrames(flange, tool.body_frame(), X_FT)
    plant.Finalize()
    return plant


def of_plain_host(plant, rigid):
    """A plugin for it with the errors that the rigid cell has, base and tool included."""
    plugin = CalibrationPlugin(plant, model_instance="ur5", tool_frame="pen")
    return plugin, plugin.use(rigid.calibration).model


@pytest.mark.parametrize("base_frame", [False, True])
def test_a_base_that_cannot_be_moved_alone_is_carried_by_the_first_joint(rigid, base_frame):
    """It cannot be moved where its weld has no frame, or where a lamp hangs on that frame too."""
    plant = plain_host(tool_frame=True, base_frame=base_frame)
    plugin, model = of_plain_host(plant, rigid)
    X_WB = plugin.robot.X_WB @ np.linalg.inv(model.X_MB_nominal) @ model.X_MB
    assert np.abs(X_WB - plugin.robot.X_WB).max() > 1e-4
    flange, base = plant.GetFrameByName("flange"), plant.GetFrameByName("base_link")
    context, drawn = plant.CreateDefaultContext(), plant.CreateDefaultContext()
    assert plugin.apply(context).base == "joints"
    for q in some_joints(5, 2):
        plant.SetPositions(context, q)
        expected = X_WB @ model.flange_poses(q[None])[0]
        assert np.abs(flange.CalcPoseInWorld(context).GetAsMatrix4() - expected).max() < 1e-9
    assert base.CalcPoseInWorld(context).IsExactlyEqualTo(base.CalcPoseInWorld(drawn))
    if base_frame:
        lamp = plant.GetFrameByName("lamp")
        assert lamp.CalcPoseInWorld(context).IsExactlyEqualTo(lamp.CalcPoseInWorld(drawn))


def test_a_tool_that_cannot_be_moved_is_told_and_nothing_is_set_by_halves(rigid):
    plant = plain_host()
    plugin = of_plain_host(plant, rigid)[0]
    context, drawn = plant.CreateDefaultContext(), plant.CreateDefaultContext()
    with pytest.raises(InputError, match=r"FixedOffsetFrame\(name, flange"):
        plugin.apply(context)
    bodies = bodies_of(plant, "ur5", "pen")
    assert np.array_equal(poses_of(context, bodies), poses_of(drawn, bodies))
    assert plugin.apply(context, tool=False).tool == "as drawn"
    tool, flange = plant.GetFrameByName("pen"), plant.GetFrameByName("flange")
    on_flange = [tool.CalcPose(each, flange).GetAsMatrix4() for each in (context, drawn)]
    assert np.abs(on_flange[0] - on_flange[1]).max() < 1e-12


def test_both_arms_of_a_cell_can_be_set_one_after_the_other(plant, rigid):
    left = CalibrationPlugin(plant, model_instance="left::ur5")
    left.use(rigid.calibration)
    context = at(plant, rigid, path(3)[1])
    rigid.apply(context)
    right_alone = poses_of(context, bodies_of(plant, "right::ur5", "right_tool"))
    left.apply(context)
    assert np.array_equal(poses_of(context, bodies_of(plant, "right::ur5", "right_tool")), right_alone)
    left.reset(context)
    untouched = at(plant, rigid, path(3)[1])
    both = bodies_of(plant, "left::ur5", "left_tool")
    assert np.array_equal(poses_of(context, both), poses_of(untouched, both))


def test_calibrated_from_poses_with_orientation_the_tool_is_turned_too(plant):
    cell = RealCell(seed=9)
    cell.move(cell.plant.GetFrameByName("gripper_mount"), RigidTransform(RollPitchYaw(2e-3, -1e-3, 3e-3), [0, 0, 0]))
    plugin, q = plugin_for(plant), some_joints(80, 7)
    poses = cell.poses(q)
    plugin.calibrate(plugin.measurements(q, poses[:, :3, 3], poses[:, :3, :3]), effects=())
    tcp = plant.GetFrameByName("tcp", plant.GetModelInstanceByName("right_tool"))
    for joints in some_joints(5, 3):
        context = at(plant, plugin, joints)
        plugin.apply(context)
        assert np.abs(tcp.CalcPoseInWorld(context).GetAsMatrix4() - cell.poses(joints)[0]).max() < 2e-6
