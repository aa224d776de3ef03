"""The systems in other scalars: cloned, converted to derivatives; and where the real robot is predicted to go."""

import numpy as np
import pytest
from foreign_host import CORNERS, X_FG, X_GT, arm_instance, path, some_joints
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from truepath.host import CalibratedRobot, CalibrationPlugin, JointCorrection, JointCorrection_
from truepath.host.placed_robot import PlacedRobot
from truepath.model import nominal_model


def output(system, name, value):
    context = system.CreateDefaultContext()
    system.get_input_port(0).FixValue(context, value)
    return system.GetOutputPort(name).Eval(context)


# The predicted robot


def test_the_predicted_tool_is_that_of_the_real_robot(soft, soft_cell):
    system = CalibratedRobot(soft)
    for q in path(10):
        assert np.linalg.norm(output(system, "tool_pose", q).translation() - soft_cell.poses(q)[0, :3, 3]) < 0.05e-3


def test_with_measured_orientations_it_is_turned_like_the_real_one(fresh, soft_cell):
    q = some_joints(80, 7)
    poses = soft_cell.poses(q)
    fresh.calibrate(fresh.measurements(q, poses[:, :3, 3], poses[:, :3, :3]), effects=("joint_compliance",))
    system = CalibratedRobot(fresh)
    for q, real in zip(path(10), soft_cell.poses(path(10)), strict=True):
        tool, flange = (output(system, name, q).GetAsMatrix4() for name in ("tool_pose", "flange_pose"))
        assert np.abs(tool - real).max() < 1e-5
        model = fresh.calibration.model
        mounted = model.X_FE @ np.linalg.inv(model.X_FE_nominal) @ X_FG.GetAsMatrix4() @ X_GT.GetAsMatrix4()
        assert np.abs(flange @ mounted - tool).max() < 1e-12


def test_it_takes_all_positions_of_the_plant_too(plant, rigid):
    q = np.zeros(plant.num_positions())
    q[rigid.arm] = CORNERS[0]
    whole = output(CalibratedRobot(rigid, of="plant"), "tool_pose", q)
    assert whole.IsExactlyEqualTo(output(CalibratedRobot(rigid), "tool_pose", CORNERS[0]))


def test_without_errors_it_is_the_drawing(ur5, rigid):
    plugin = CalibrationPlugin(rigid.plant, model_instance="left::ur5")
    flange = rigid.plant.GetFrameByName("flange", arm_instance(rigid.plant, "left"))
    context = rigid.plant.CreateDefaultContext()
    positions = rigid.plant.GetPositions(context)
    positions[plugin.arm] = CORNERS[0]
    rigid.plant.SetPositions(context, positions)
    placed = PlacedRobot(nominal_model(ur5), rigid.calibration.region.region(), plugin.robot.X_WB, np.eye(4))
    predicted = output(CalibratedRobot(placed), "flange_pose", CORNERS[0])
    assert predicted.IsNearlyEqualTo(flange.CalcPoseInWorld(context), 1e-12)


# Scalars


def diagram_of(system):
    builder = DiagramBuilder()
    builder.AddNamedSystem("system", system)
    constant = np.resize(CORNERS[0], system.get_input_port(0).size())
    source = builder.AddSystem(ConstantVectorSource(constant))
    builder.Connect(source.get_output_port(), system.get_input_port(0))
    builder.ExportOutput(system.get_output_port(0))
    return builder.Build()


def of_states(plugin):
    return JointCorrection(plugin, takes="state")


@pytest.mark.parametrize("make", [JointCorrection, of_states, CalibratedRobot])
def test_a_diagram_with_it_can_be_cloned_and_converted_to_derivatives(make, rigid):
    diagram = diagram_of(make(rigid))
    value = diagram.get_output_port(0).Eval(diagram.CreateDefaultContext())
    clone = diagram.Clone()
    again = clone.get_output_port(0).Eval(clone.CreateDefaultContext())
    assert value.IsExactlyEqualTo(again) if make is CalibratedRobot else np.array_equal(value, again)
    converted = diagram.ToAutoDiffXd()
    converted.get_output_port(0).Eval(converted.CreateDefaultContext())
    with pytest.raises(RuntimeError, match="does not support scalar conversion"):
        diagram.ToSymbolic()


def test_derivatives_of_the_corrected_joints_are_those_of_a_path(soft):
    q, direction = CORNERS[1], np.array([0.3, -0.2, 0.5, 0.1, 0.4, -0.6])
    system = JointCorrection(soft).ToAutoDiffXd()
    assert isinstance(system, JointCorrection_[AutoDiffXd])
    found = output(system, "corrected", InitializeAutoDiff(q, direction[:, None]).ravel())
    h = 1e-3
    slope = (soft.correct(q + h * direction).q_rad[0] - soft.correct(q - h * direction).q_rad[0]) / (2 * h)
    assert np.abs(ExtractGradient(found)[:, 0] - slope).max() < 1e-5
    assert np.abs(slope - direction).max() > 1e-5
    assert output(system, "valid", InitializeAutoDiff(q).ravel())[0].value() == 1.0
    assert output(system, "inside", InitializeAutoDiff(q).ravel())[0].value() == 1.0


def test_derivatives_of_the_predicted_pose(soft):
    q = CORNERS[1]
    pose = output(CalibratedRobot(soft).ToAutoDiffXd(), "flange_pose", InitializeAutoDiff(q).ravel())
    jacobian = ExtractGradient(pose.translation())
    model = soft.calibration.model
    rigid_part = model.flange_poses_and_jacobian(q)[1][0, 3:]
    X_WB = PlacedRobot.of(soft).X_WB_real
    assert np.abs(jacobian - X_WB[:3, :3] @ rigid_part).max() < 5e-3  # effects change it by parts in a thousand
    h = 1e-4
    for joint, unit in enumerate(np.eye(6)):
        ahead, behind = (PlacedRobot.of(soft).flange_poses((q + s * h * unit)[None])[0] for s in (1, -1))
        slope = (ahead - behind) / (2 * h)
        assert np.abs(jacobian[:, joint] - slope[:3, 3]).max() < 1e-7
        turned = np.array([[ExtractGradient(np.array([a]))[0, joint] for a in row] for row in pose.rotation().matrix()])
        assert np.abs(turned - slope[:3, :3]).max() < 1e-7


def test_derivatives_of_the_corrected_velocities_are_those_of_neighbouring_states(soft):
    system, state = JointCorrection(soft, takes="state"), np.concatenate([CORNERS[1], [0.4, -0.3, 0.6, 0.2, -0.5, 0.3]])
    h, slopes = 1e-3, []
    for unit in np.eye(12):
        ahead, behind = (output(system, "corrected", state + s * h * unit) for s in (1, -1))
        slopes.append((ahead - behind) / (2 * h))
    found = ExtractGradient(output(system.ToAutoDiffXd(), "corrected", InitializeAutoDiff(state).ravel()))
    expected = np.array(slopes).T
    assert np.abs(found - expected).max() < 1e-4
    assert np.abs(expected[6:, :6]).max() > 1e-3  # a velocity changes with the posture, too
    constant = output(system.ToAutoDiffXd(), "corrected", InitializeAutoDiff(state, np.zeros((12, 0))).ravel())
    assert np.array_equal(ExtractValue(constant).ravel(), output(system, "corrected", state))
