"""The systems: in a closed diagram with a real robot of Drake's, at the bounds of what can be corrected, converted."""

import time
from dataclasses import replace

import numpy as np
import pytest
from foreign_host import CORNERS, JOINTS, X_FG, X_GT, RealTool, arm_instance, path, some_joints
from hand_made_networks import residual_about
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from truepath.correct import MAX_JOINT_CORRECTION_RAD, correct
from truepath.effects.base import EffectParameter, FittedTerm, Term
from truepath.errors import InputError
from truepath.host import CalibratedRobot, CalibrationPlugin, JointCorrection, JointCorrection_
from truepath.host.one_pose import OnePose
from truepath.host.one_pose_networks import network_shift
from truepath.host.placed_robot import PlacedRobot
from truepath.host.steady_correction import SteadyCorrection
from truepath.kinematics.corrected_joints import corrected_joints
from truepath.model import nominal_model
from truepath.motions import Moves


def output(system, name, value):
    context = system.CreateDefaultContext()
    system.get_input_port(0).FixValue(context, value)
    return system.GetOutputPort(name).Eval(context)


def mean_mm(points, wanted):
    return 1e3 * np.linalg.norm(points - wanted, axis=1).mean()


TRAJECTORY = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, len(CORNERS)), CORNERS.T, True)
PERIOD_S = 0.02


def tool_along(trajectory, correction, cell, rows):
    """Times ``(K,)``, where the real tool was ``(K, 3)``, and whether the correction was all made ``(K,)``."""
    builder = DiagramBuilder()
    source = builder.AddSystem(TrajectorySource(trajectory))
    tool = builder.AddSystem(RealTool(cell, trajectory.rows(), rows))
    sent = source.get_output_port()
    if correction is not None:
        builder.AddSystem(correction)
        builder.Connect(sent, correction.get_input_port(0))
        sent = correction.GetOutputPort("corrected")
        valid = LogVectorOutput(correction.GetOutputPort("valid"), builder, PERIOD_S)
    builder.Connect(sent, tool.get_input_port(0))
    log = LogVectorOutput(tool.get_output_port(0), builder, PERIOD_S)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(trajectory.end_time())
    found = log.FindLog(simulator.get_context())
    ok = valid.FindLog(simulator.get_context()).data()[0] if correction is not None else None
    return found.sample_times(), found.data().T, ok


@pytest.mark.parametrize("name", ["rigid", "soft"])
def test_in_a_simulated_cell_the_tool_error_falls_to_the_held_out_error(name, drawn, request):
    plugin, cell = request.getfixturevalue(name), request.getfixturevalue(f"{name}_cell")
    heldout = plugin.calibration.heldout
    times, today, _ = tool_along(TRAJECTORY, None, cell, np.arange(6))
    _, corrected, valid = tool_along(TRAJECTORY, JointCorrection(plugin), cell, np.arange(6))
    wanted = drawn.poses(TRAJECTORY.vector_values(times).T)[:, :3, 3]
    assert len(times) > 150
    assert valid.all()
    assert mean_mm(today, wanted) > 0.8
    assert mean_mm(corrected, wanted) <= heldout.calibrated.position_mm.mean
    assert 1e3 * np.linalg.norm(corrected - wanted, axis=1).max() <= heldout.calibrated.position_mm.max


def test_with_all_positions_of_the_plant_only_the_arms_own_are_touched(plant, rigid, rigid_cell, drawn):
    rng = np.random.default_rng(0)
    everything = rng.uniform(-0.3, 0.3, (len(CORNERS), plant.num_positions()))
    everything[:, rigid.arm] = CORNERS
    trajectory = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 1.0, len(CORNERS)), everything.T, True)
    times, points, _ = tool_along(trajectory, JointCorrection(rigid, of="plant"), rigid_cell, rigid.arm)
    wanted = drawn.poses(trajectory.vector_values(times)[rigid.arm].T)[:, :3, 3]
    assert mean_mm(points, wanted) <= rigid.calibration.heldout.calibrated.position_mm.mean
    q = everything[1]
    sent = output(JointCorrection(rigid, of="plant"), "corrected", q)
    others = np.setdiff1d(np.arange(plant.num_positions()), rigid.arm)
    assert np.array_equal(sent[others], q[others])
    assert np.array_equal(sent[rigid.arm], output(JointCorrection(rigid), "corrected", CORNERS[1]))


def test_it_gives_what_the_correction_of_a_path_gives(rigid, soft):
    q = path(40)
    for plugin in (rigid, soft):
        system, expected = JointCorrection(plugin), plugin.correct(q).q_rad
        assert np.abs([output(system, "corrected", row) for row in q] - expected).max() < 1e-7


def test_results_do_not_depend_on_what_was_asked_before(soft):
    system, q = JointCorrection(soft), path(20)
    context = system.CreateDefaultContext()

    def ask(row):
        system.get_input_port(0).FixValue(context, row)
        return system.GetOutputPort("corrected").Eval(context).tobytes()

    assert [ask(row) for row in q] == [ask(row) for row in q[::-1]][::-1]
    assert system.HasAnyDirectFeedthrough()
    assert context.is_stateless()


def test_a_calibration_alone_will_do_for_the_arm(rigid):
    alone = JointCorrection(rigid.calibration)
    with_plant = output(JointCorrection(rigid), "corrected", CORNERS[0])
    assert np.array_equal(output(alone, "corrected", CORNERS[0]), with_plant)
    with pytest.raises(InputError, match="knows no plant"):
        JointCorrection(rigid.calibration, of="plant")


def test_velocities_are_those_of_the_corrected_path(soft):
    times = np.array([0.7, 1.9, 3.1])
    system, h = JointCorrection(soft, takes="state"), 1e-3
    for t in times:
        state = np.concatenate([TRAJECTORY.value(t).ravel(), TRAJECTORY.EvalDerivative(t).ravel()])
        sent = output(system, "corrected", state)
        before, after = (soft.correct(TRAJECTORY.value(t + dt).T).q_rad[0] for dt in (-h, h))
        assert np.abs(sent[6:] - (after - before) / (2 * h)).max() < 1e-5
        assert np.abs(sent[6:] - state[6:]).max() > 1e-5
    still = output(system, "corrected", np.concatenate([CORNERS[0], np.zeros(6)]))
    assert np.array_equal(still[6:], np.zeros(6))


def test_state_of_a_whole_plant(plant, rigid):
    rng = np.random.default_rng(1)
    state = rng.uniform(-0.2, 0.2, plant.num_positions() + plant.num_velocities())
    joints = [plant.GetJointByName(f"{name}_joint", arm_instance(plant, "right")) for name in JOINTS]
    velocity_rows = plant.num_positions() + np.array([joint.velocity_start() for joint in joints])
    state[rigid.arm], own = CORNERS[2], np.concatenate([rigid.arm, velocity_rows])
    sent = output(JointCorrection(rigid, takes="state", of="plant"), "corrected", state)
    assert np.array_equal(sent[own], output(JointCorrection(rigid, takes="state"), "corrected", state[own]))
    assert np.array_equal(np.delete(sent, own), np.delete(state, own))


# Where a correction would be refused


def test_towards_a_singularity_the_correction_fades_and_never_jumps(rigid):
    """Wrist 2 goes through zero, where the wrist is singular and the needed motions grow without bound."""
    q = np.repeat(CORNERS[:1], 4001, axis=0)
    q[:, 4] = np.linspace(0.05, -0.05, len(q))
    correct_one = SteadyCorrection(rigid.calibration.model)
    found = [correct_one(row) for row in q]
    change = np.array([each.q_rad for each in found]) - q
    valid = np.array([each.valid for each in found])
    assert np.abs(change).max() <= 2 * MAX_JOINT_CORRECTION_RAD
    assert valid[0]
    assert valid[-1]
    assert not valid.all()
    # A step of the programmed joints is 25 urad: what is sent may move some hundred times as fast there, not jump.
    assert np.abs(np.diff(change, axis=0)).max() < 0.02
    finer = np.linspace(q[valid.argmin() - 1], q[valid.argmin() + 1], 400)
    steps = np.diff([correct_one(row).q_rad for row in finer], axis=0)
    assert np.abs(steps).max() < 4e-4


def test_a_large_correction_fades_between_its_bound_and_twice_that(rigid):
    model, q = rigid.calibration.model, CORNERS[1]
    whole = SteadyCorrection(model)(q)
    size = corrected_joints(model, q[None], exact_below=0.0).displacement_mm[0]
    shares = []
    for bound in (1.01 * size, size / 1.01, size / 1.5, size / 1.99, size / 2.0):
        part = SteadyCorrection(model, bound)(q)
        change, all_of_it = part.q_rad - q, whole.q_rad - q
        shares.append(float(change @ all_of_it / (all_of_it @ all_of_it)))
        assert np.allclose(change, shares[-1] * all_of_it, atol=1e-12)
        assert part.valid == (bound > size)
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == 1.0
    assert abs(shares[2] - 0.5) < 1e-6
    assert shares[-1] < 1e-9
    system = JointCorrection(rigid, max_correction_mm=size / 1.5)
    assert output(system, "valid", q) == [0.0]
    with pytest.raises(InputError, match="no bound"):
        SteadyCorrection(model, 0.0)


def test_a_corrected_joint_stops_at_its_limit(rigid):
    q = CORNERS[0]
    change = rigid.correct(q).q_rad[0] - q
    joint = int(np.argmax(np.abs(change)))
    robot = rigid.calibration.model.robot
    limit = "upper_rad" if change[joint] > 0 else "lower_rad"
    tight = np.array(getattr(robot, limit))
    tight[joint] = q[joint] + 0.5 * change[joint]
    model = replace(rigid.calibration.model, robot=replace(robot, **{limit: tight}))
    sent = SteadyCorrection(model)(q)
    assert not sent.valid
    assert abs(sent.q_rad[joint] - tight[joint]) < 1e-8
    assert np.allclose(np.delete(sent.q_rad - q, joint), np.delete(change, joint), atol=1e-7)
    beyond = q + np.eye(6)[joint] * change[joint]
    assert abs(SteadyCorrection(model)(beyond).q_rad[joint] - beyond[joint]) < 1e-12


def test_what_is_no_number_is_passed_on_and_called_invalid(rigid):
    q = np.array([0.0, np.nan, 1.0, np.inf, 0.2, 0.3])
    system = JointCorrection(rigid)
    assert np.array_equal(output(system, "corrected", q), q, equal_nan=True)
    assert output(system, "valid", q) == [0.0]


def test_it_says_where_the_calibration_was_not_measured(rigid):
    system = JointCorrection(rigid)
    assert output(system, "inside", CORNERS[0]) == [1.0]
    assert output(system, "inside", CORNERS[0] + [0, 0, 0, 0, 0, 3.0]) == [0.0]


def test_wrong_words_and_missing_calibrations_are_refused(rigid, fresh):
    for make in (
        lambda: JointCorrection(rigid, takes="torques"),
        lambda: JointCorrection(rigid, of="cell"),
        lambda: CalibratedRobot(rigid, of="cell"),
        lambda: CalibratedRobot(rigid.calibration, of="plant"),
        lambda: JointCorrection(fresh),
        lambda: JointCorrection("calibration.json"),
        lambda: CalibratedRobot(fresh),
    ):
        with pytest.raises(InputError):
            make()


# One pose at a time


def waves(joint, amplitude, limits=(-2.0, 2.0)):
    rng = np.random.default_rng(joint)
    names = [f"{wave} {k}" for k in (1, 3, 9) for wave in ("cos", "sin")]
    term = Term(
        "transmission_error",
        Moves.JOINT,
        joint,
        ("theta",),
        (("lower_rad", limits[0]), ("upper_rad", limits[1])),
        tuple(EffectParameter(name, "rad", 0.0, "") for name in names),
    )
    return FittedTerm(term, rng.normal(scale=amplitude, size=len(names)))


def one(effect, moves, joint, inputs, constants, *parameters):
    names = tuple(EffectParameter(name, unit, 0.0, "") for name, unit, _ in parameters)
    return FittedTerm(Term(effect, moves, joint, inputs, constants, names), np.array([v for *_, v in parameters]))


ALL = (("lower_rad", -2.0), ("upper_rad", 2.0))
EFFECTS = {
    "none": (),
    "waves": tuple(waves(joint, 3e-5) for joint in range(1, 7)),
    "compliance": tuple(
        one("joint_compliance", Moves.JOINT, joint, ("gravity_torque",), ALL, ("compliance", "rad/(N m)", 4e-5))
        for joint in (2, 3)
    ),
    "backlash": (
        one(
            "backlash",
            Moves.JOINT,
            2,
            ("gravity_torque",),
            (*ALL, ("soft_torque", 2.0)),
            ("width", "rad", 3e-4),
        ),
    ),
    "wobble": (
        one("axis_wobble", Moves.AXIS, 1, ("theta",), ALL, ("x cos 1", "m", 1e-4), ("rx sin 2", "rad", 2e-4)),
        one("axis_wobble", Moves.AXIS, 4, ("theta",), ALL, ("z sin 3", "m", 5e-5), ("ry cos 1", "rad", -1e-4)),
    ),
    "growth": (
        one(
            "thermal_expansion",
            Moves.ROBOT_LENGTHS,
            None,
            ("temperature_c",),
            (("reference_c", 20.0), ("default temperature_c", 27.0)),
            ("expansion", "1/K", 1.2e-5),
        ),
    ),
}


@pytest.mark.parametrize("name", EFFECTS)
def test_one_pose_is_solved_as_a_path_is_with_every_effect(name, rigid):
    """By the model's own forward kinematics, which are tested elsewhere."""
    model = replace(rigid.calibration.model, effects=EFFECTS[name], payload_kg=1.5)
    plain = replace(rigid.calibration.model, payload_kg=1.5)
    solver, q = OnePose(model), some_joints(40, 3)
    usable = np.array([np.linalg.svd(model.flange_poses_and_jacobian(row)[1][0])[1][-1] for row in q]) > 0.05
    found = [solver.solve(row) for row in q[usable]]
    assert usable.sum() > 15
    assert all(each.converged for each in found)
    solved = np.array([each.q_rad for each in found])
    goal = PlacedRobot.of(rigid).programmed_tool_poses(q[usable])
    X_WB = rigid.robot.X_WB @ np.linalg.inv(model.X_MB_nominal) @ model.X_MB
    reached = X_WB @ model.flange_poses(solved) @ PlacedRobot.of(rigid).X_FT_real
    assert np.abs(reached - goal).max() < 3e-9
    expected = corrected_joints(model, q[usable], exact_below=0.0)
    assert np.abs(solved - expected.q_rad).max() < 1e-7
    assert np.abs([1e3 * each.displacement_m for each in found] - expected.displacement_mm).max() < 1e-5
    if name != "none":
        assert np.abs(solved - corrected_joints(plain, q[usable], exact_below=0.0).q_rad).max() > 1e-5


def test_an_arm_with_a_joint_too_many_takes_the_shortest_step(seven):
    p = np.zeros(40)
    p[:28] = np.random.default_rng(0).normal(scale=5e-4, size=28)
    model = replace(nominal_model(seven), p=p)
    q = np.random.default_rng(1).uniform(0.7 * seven.lower_rad, 0.7 * seven.upper_rad, (20, 7))
    solver, expected = OnePose(model), corrected_joints(model, q, exact_below=0.0)
    assert np.abs([solver.solve(row).q_rad for row in q] - expected.q_rad).max() < 1e-7
    assert np.abs(expected.q_rad - q).max() > 1e-4


def test_an_arm_with_too_few_joints_is_refused(rigid):
    robot = replace(rigid.robot, joint_names=rigid.robot.joint_names[:5])
    with pytest.raises(InputError, match="six or more"):
        SteadyCorrection(replace(rigid.calibration.model, robot=robot))


@pytest.mark.parametrize("outputs", [3, 6])
def test_networks_say_of_one_pose_what_they_say_of_many(outputs):
    residual = residual_about(CORNERS[0], outputs=outputs)
    q = CORNERS[0] + np.random.default_rng(0).normal(scale=0.3, size=(300, 6))
    expected, function = residual.shift(q), network_shift(residual)
    assert (np.abs(expected).max(axis=1) == 0).any()
    assert (np.abs(expected).max(axis=1) > 1e-5).any()
    assert np.abs(np.array([np.array(function(row))[:, 0] for row in q]) - expected).max() < 1e-12


@pytest.mark.parametrize("outputs", [3, 6])
def test_networks_are_in_it(outputs, rigid):
    centre = CORNERS[0]
    q = centre + np.linspace(0.0, 0.8, 30)[:, None] * np.array([1.0, 0.5, -0.5, 0.3, 0.1, 0.7])  # out of their reach
    model = rigid.calibration.model.with_residual(residual_about(centre, outputs=outputs))
    solved = np.array([SteadyCorrection(model)(row).q_rad for row in q])
    assert np.abs(solved - correct(model, q).q_rad).max() < 1e-7
    without = np.abs(solved - correct(rigid.calibration.model, q).q_rad).max(axis=1)
    assert without[0] > 1e-5
    assert without[-1] < 1e-7


def test_one_evaluation_is_fast_enough_for_a_control_loop(rigid):
    """Some 60 us where nobody else is working; the bound leaves room for whoever is."""
    system = JointCorrection(rigid)
    context, q, port = system.CreateDefaultContext(), path(200), system.GetOutputPort("corrected")
    took = []
    for row in q:
        system.get_input_port(0).FixValue(context, row)
        start = time.perf_counter()
        port.Eval(context)
        took.append(time.perf_counter() - start)
    assert np.median(took) < 5e-4


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
    source = builder.AddSystem(ConstantVectorSource(CORNERS[0]))
    builder.Connect(source.get_output_port(), system.get_input_port(0))
    builder.ExportOutput(system.get_output_port(0))
    return builder.Build()


@pytest.mark.parametrize("make", [JointCorrection, CalibratedRobot])
def test_a_diagram_with_it_can_be_cloned_and_converted_to_derivatives(make, rigid):
    diagram = diagram_of(make(rigid))
    value = diagram.get_output_port(0).Eval(diagram.CreateDefaultContext())
    clone = diagram.Clone()
    again = clone.get_output_port(0).Eval(clone.CreateDefaultContext())
    assert np.array_equal(value, again) if make is JointCorrection else value.IsExactlyEqualTo(again)
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


def test_velocities_have_no_derivatives(rigid):
    with pytest.raises(InputError, match="no derivatives"):
        JointCorrection(rigid, takes="state").ToAutoDiffXd()
