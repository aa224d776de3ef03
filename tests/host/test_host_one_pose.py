"""One pose at a time, for a control loop: the same robot and the same solution as for a path."""

from dataclasses import replace

import numpy as np
import pytest
from foreign_host import CORNERS, some_joints
from hand_made_networks import residual_about
from truepath.correct import correct
from truepath.effects.base import EffectParameter, FittedTerm, Term
from truepath.errors import InputError
from truepath.host.one_pose import OnePose
from truepath.host.one_pose_networks import network_shift
from truepath.host.placed_robot import PlacedRobot
from truepath.host.steady_correction import SteadyCorrection
from truepath.kinematics.corrected_joints import corrected_joints
from truepath.model import nominal_model
from truepath.motions import Moves


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
