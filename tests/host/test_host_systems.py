"""The systems: in a closed diagram with a real robot of Drake's, at the bounds of what can be corrected, converted."""

import time
from dataclasses import replace

import numpy as np
import pytest
from foreign_host import CORNERS, JOINTS, RealTool, arm_instance, path
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from truepath.correct import MAX_JOINT_CORRECTION_RAD
from truepath.errors import InputError
from truepath.host import CalibratedRobot, JointCorrection
from truepath.host.steady_correction import SteadyCorrection
from truepath.kinematics.corrected_joints import corrected_joints


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
