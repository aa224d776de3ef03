"""Drake trajectories in memory, corrected: where the real tool goes, by Drake, and what becomes of their smoothness."""

import json
from datetime import date

import numpy as np
import pytest
from drake_trajectories import READY, cubic, joints, kinds
from path_truth import Cell
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import (
    FunctionHandleTrajectory,
    PiecewisePolynomial,
)
from truepath.calibration import Calibration
from truepath.errors import CorrectionError, InputError
from truepath.rewriting.trajectory import correct_trajectory

LARGEST_MM = 10.0


@pytest.fixture(scope="module")
def cell():
    return Cell(3, poses=200, fresh_poses=500)


@pytest.fixture(scope="module")
def corrected(cell):
    """Of each kind: the trajectory and what it was corrected to."""
    return {
        name: (given, correct_trajectory(given, cell.calibration, max_correction_mm=LARGEST_MM))
        for name, given in kinds().items()
    }


NAMES = list(kinds())


def real_errors_mm(cell, given, commanded, count=400):
    """Before and after, as Drake has the real robot."""
    times = np.linspace(given.start_time(), given.end_time(), count)
    q, then = given.vector_values(times).T, commanded.vector_values(times).T
    meant = cell.meant(cell.nominal.tool_poses(q))
    return (
        *(1e3 * np.linalg.norm(cell.true_positions(each) - meant, axis=1) for each in (q, then)),
        cell.heldout_mm(q),
    )


@pytest.mark.parametrize("name", NAMES)
def test_the_real_tool_follows_as_well_as_the_calibration_knows_it(cell, corrected, name):
    given, done = corrected[name]
    assert isinstance(done.trajectory, PiecewisePolynomial)
    before, after, heldout = real_errors_mm(cell, given, done.trajectory)
    assert before.min() > 1.0
    assert after.max() < heldout.max() + done.between_mm + 1e-3
    assert after.mean() < heldout.mean() + done.between_mm
    assert done.between_mm < 0.05


@pytest.mark.parametrize("name", NAMES)
def test_it_takes_the_same_time(corrected, name):
    given, done = corrected[name]
    assert (done.trajectory.start_time(), done.trajectory.end_time()) == (given.start_time(), given.end_time())
    assert (done.trajectory.rows(), done.trajectory.cols()) == (6, 1)
    assert done.time_s[[0, -1]].tolist() == [given.start_time(), given.end_time()]


@pytest.mark.parametrize("name", NAMES)
def test_what_is_added_is_smooth(corrected, name):
    """Value and derivative of the difference have no step at any break; the second neither where it had none."""
    given, done = corrected[name]
    breaks = np.array(done.trajectory.get_segment_times())[1:-1]
    step = 1e-7
    for order, most in ((0, 1e-7), (1, 1e-5)):
        theirs, ours = (
            np.array([[part.EvalDerivative(t + side, order).ravel() for side in (-step, step)] for t in breaks])
            for part in (done.trajectory if name == "function" else given, done.trajectory)
        )
        # A function has no derivative that Drake knows of; that one is smooth itself.
        difference = ours if name == "function" else ours - theirs
        assert np.abs(difference[:, 1] - difference[:, 0]).max() < most
    second = done.trajectory.derivative(2)
    if name in ("later", "bspline", "function"):
        steps = np.array([second.value(t + step) - second.value(t - step) for t in breaks])
        assert np.abs(steps).max() < 1e-4


def test_between_its_samples_it_is_the_trajectory_and_a_cubic(corrected):
    given, done = corrected["bspline"]
    start, end = done.time_s[4:6]
    times = np.linspace(start, end, 9)
    added = (done.trajectory.vector_values(times) - given.vector_values(times)).T
    fitted = np.polynomial.polynomial.polyfit(times - start, added, 3)
    told = np.polynomial.polynomial.polyval(times - start, fitted).T
    assert told == pytest.approx(added, abs=1e-12)


def test_what_stands_still_at_the_ends_stays_so(corrected):
    _, done = corrected["cubic"]
    velocity = done.trajectory.derivative(1)
    assert velocity.value(0.0).ravel() == pytest.approx(np.zeros(6), abs=1e-9)
    assert velocity.value(6.0).ravel() == pytest.approx(np.zeros(6), abs=1e-9)


@pytest.mark.parametrize("tolerance_mm", [0.2, 0.02, 0.004, 0.0005])
def test_as_many_samples_as_the_tolerance_takes(cell, tolerance_mm):
    model = cell.calibration.model
    given = cubic()
    done = correct_trajectory(given, cell.calibration, tolerance_mm=tolerance_mm, max_correction_mm=LARGEST_MM)
    times = np.random.default_rng(0).uniform(0, 6, 2000)
    q = given.vector_values(times).T
    meant = cell.meant(cell.nominal.tool_poses(q))
    told = model.predict(done.trajectory.vector_values(times).T)[:, :3, 3]
    assert 1e3 * np.linalg.norm(told - meant, axis=1).max() < tolerance_mm
    coarse = correct_trajectory(given, cell.calibration, tolerance_mm=1.0, max_correction_mm=LARGEST_MM)
    told = model.predict(coarse.trajectory.vector_values(times).T)[:, :3, 3]
    enough = 1e3 * np.linalg.norm(told - meant, axis=1).max() < 0.8 * tolerance_mm
    assert enough or len(done.time_s) > len(coarse.time_s)


def test_a_diagram_can_play_it(corrected):
    given, done = corrected["cubic"]
    builder = DiagramBuilder()
    source = builder.AddSystem(TrajectorySource(done.trajectory, output_derivative_order=1))
    log = LogVectorOutput(source.get_output_port(), builder, publish_period=0.1)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(6.0)
    data = log.FindLog(simulator.get_context())
    times = data.sample_times()
    assert data.data()[:6] == pytest.approx(done.trajectory.vector_values(times), abs=1e-12)
    assert data.data()[6:] == pytest.approx(given.MakeDerivative().vector_values(times), abs=0.02)


def test_the_summary_is_plain_json(corrected):
    _, done = corrected["composite"]
    summary = json.loads(json.dumps(done.summary()))
    assert summary["schema"] == "truepath.trajectory/1"
    assert (summary["start_s"], summary["end_s"]) == (0.0, 8.0)
    assert summary["samples"] == len(done.time_s)
    assert summary["predicted_error_before_mm"]["mean"] > 1.0
    assert summary["predicted_error_after_mm"]["max"] < 1e-4
    assert summary["path"] == {"off_after_mm": done.between_mm, "tolerance_mm": 0.05}


def refuse(cell, given, **options):
    with pytest.raises(CorrectionError) as caught:
        correct_trajectory(given, cell.calibration, **{"max_correction_mm": LARGEST_MM, **options})
    return caught.value


def test_too_large_a_correction_is_refused_with_its_time(cell):
    error = refuse(cell, cubic(), max_correction_mm=2.0)
    assert error.problem == "the correction is larger than allowed at 0.000 s"
    assert error.line is None


def test_a_joint_beyond_its_limit_is_refused_with_its_time(cell):
    upper = cell.calibration.model.robot.upper_rad[5]
    q = np.array([READY, READY, READY])
    q[1, 5], q[2, 5] = upper - 0.2, upper + 0.3
    error = refuse(cell, cubic(q, 20.0))
    assert "passes a joint limit at 1" in error.problem
    assert error.column.startswith("q6")


def test_a_trajectory_that_is_too_fast_by_itself_is_warned_of(cell):
    robot = cell.calibration.model.robot
    limit = robot.velocity_rad_s[0]
    still = np.tile(READY, (3, 1))

    def steady(speed):
        """The first joint at one speed, where the correction makes it go faster or slower by some 1e-4."""
        q = still.copy()
        q[:, 0] += speed * np.array([-0.2, 0.0, 0.2])
        return PiecewisePolynomial.FirstOrderHold([0, 0.2, 0.4], q.T)

    fast = correct_trajectory(steady(1.05 * limit), cell.calibration, max_correction_mm=LARGEST_MM)
    assert {(finding.level, finding.guard) for finding in fast.findings} == {("warning", "joint-speed")}
    assert all("at 0." in finding.message for finding in fast.findings)
    slow = correct_trajectory(steady(0.5 * limit), cell.calibration, max_correction_mm=LARGEST_MM)
    assert slow.findings == ()


def test_a_joint_that_the_correction_makes_too_fast_is_refused(cell):
    """A joint at a steady 99.999 % of its limit: at some places the correction makes it faster, at others slower."""
    robot = cell.calibration.model.robot
    refused = []
    for place in (-1.5, -0.5, 0.5, 1.5):
        q = np.tile(READY, (2, 1))
        q[:, 0] += place + 0.99999 * robot.velocity_rad_s[0] * np.array([-0.05, 0.05])
        given = PiecewisePolynomial.FirstOrderHold([0, 0.1], q.T)
        refused.append(outcome(cell, given))
    messages = [each for each in refused if each is not None]
    assert messages
    for message in messages:
        assert message.startswith("joint-speed")
        assert "q1 (shoulder_pan_joint)" in message
        assert "after the correction, 3.14 before; its limit is 3.14" in message


def outcome(cell, given):
    """The message of a refusal; None if there is none, and then no joint is too fast."""
    try:
        done = correct_trajectory(given, cell.calibration, max_correction_mm=LARGEST_MM)
    except CorrectionError as error:
        return error.problem
    times = np.linspace(given.start_time(), given.end_time(), 999)
    fastest = np.abs(done.trajectory.derivative(1).vector_values(times)).max(axis=1)
    assert (fastest <= cell.calibration.model.robot.velocity_rad_s * (1 + 1e-5)).all()
    return None


def test_an_old_calibration_and_a_stranger_region_are_told(cell):
    done = correct_trajectory(cubic(), cell.calibration, max_correction_mm=LARGEST_MM, today=date(2040, 1, 1))
    assert [finding.guard for finding in done.findings] == ["calibration-age"]
    region = cell.calibration.region
    narrow = region.model_copy(update={"upper_rad": [0.0] * 6})
    calibration = cell.calibration.model_copy(update={"region": narrow})
    done = correct_trajectory(cubic(), calibration, max_correction_mm=LARGEST_MM)
    assert "outside the joints that were measured (first at 0.000 s)" in done.warnings[0]
    assert done.summary()["outside_calibrated_region"] > 0


def test_less_room_in_the_cell_is_told_with_its_time(cell):
    """The arm sinks until it nearly touches the table; meant for a robot that stands lower, it goes into it."""
    X_MB = cell.calibration.base.nominal.matrix()
    X_MB[2, 3] -= 0.006
    lower = cell.calibration.base.model_copy(update={"nominal": type(cell.calibration.base.nominal).of(X_MB)})
    content = cell.calibration.model_dump(by_alias=True)
    calibration = Calibration.model_validate({**content, "base": lower.model_dump(by_alias=True)})
    home = np.array([0.0, -1.57, 1.57, -1.57, -1.57, 0.2])
    free, touching = 0.0, 1.0
    for _ in range(12):
        middle = 0.5 * (free + touching)
        is_free = cell.real.is_free(home + np.eye(6)[1] * middle)
        free, touching = (middle, touching) if is_free else (free, middle)
    near = cubic(np.array([home, home + np.eye(6)[1] * (free + 0.007)]))
    done = correct_trajectory(near, calibration, max_correction_mm=LARGEST_MM, cell="ur5_cell")
    assert done.summary()["cell"] == "ur5_cell"
    assert {finding.guard for finding in done.findings} == {"collision"}
    for finding in done.findings:
        assert finding.message.startswith("at ")
        assert "after the correction" in finding.message
    assert correct_trajectory(near, calibration, max_correction_mm=LARGEST_MM).findings == ()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (PiecewisePolynomial.FirstOrderHold([0, 1.0], np.zeros((5, 2))), "5 rows"),
        (PiecewisePolynomial.ZeroOrderHold([0, 1.0, 2.0], joints(0, 3).T), "jumps"),
        (PiecewisePolynomial(READY), "no duration"),
        (FunctionHandleTrajectory(lambda t: np.full((6, 1), np.nan if t > 2 else 0.1), 6, 1, 0.0, 3.0), "no number"),
        (FunctionHandleTrajectory(lambda t: (READY + 0.1 * (t > 1.234))[:, None], 6, 1, 0.0, 3.0), "1.234"),
    ],
)
def test_what_is_no_trajectory_of_this_robot_is_refused(cell, given, says):
    with pytest.raises(InputError, match=says):
        correct_trajectory(given, cell.calibration)


@pytest.mark.parametrize("tolerance_mm", [0.0, -1.0, np.nan])
def test_a_tolerance_that_is_none_is_refused(cell, tolerance_mm):
    with pytest.raises(InputError, match="no length"):
        correct_trajectory(cubic(), cell.calibration, tolerance_mm=tolerance_mm)
