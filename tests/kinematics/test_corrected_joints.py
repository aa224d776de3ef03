"""Joints for a whole path: the same that Newton's method finds for each waypoint, whatever else is in the path."""

import os
from dataclasses import replace

import numpy as np
import pytest
from drake_arm import random_joints
from every_effect import afflicted
from hand_made_networks import residual_about
from truepath import inverse, lie
from truepath.kinematics.corrected_joints import corrected_joints
from truepath.model import nominal_flange_poses, nominal_model

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
NEAR_SINGULAR = 0.03


@pytest.fixture(scope="module")
def path():
    """Joints of a smooth path away from singularities."""
    s = np.linspace(0, 1, 150)[:, None]
    return HOME + s * [0.5, 0.3, -0.4, 0.2, 0.4, 0.6]


@pytest.fixture(scope="module")
def model(ur5):
    return afflicted(ur5)


def solved(model, q):
    return corrected_joints(model, q, exact_below=NEAR_SINGULAR)


def by_newton(model, q, monkeypatch, tolerance=2e-13):
    """Goals, and joints that reach them as exactly as can be."""
    goal = model.goal_flange_poses(nominal_flange_poses(model.robot, q))
    with monkeypatch.context() as exact:
        exact.setattr(inverse, "POSITION_TOLERANCE_M", tolerance)
        exact.setattr(inverse, "ANGLE_TOLERANCE_RAD", tolerance)
        return goal, inverse.solve(model.flange_poses_and_jacobian, goal, q)


def askew(model):
    """The same with stated frames that are not where they should be."""
    step = lie.make_pose(lie.from_rotation_vector(np.array([2e-3, -1e-3, 3e-3])), np.array([1e-3, -5e-4, 8e-4]))
    return replace(
        model, X_MB=step @ model.X_MB, X_FE_nominal=model.X_FE @ step, base_is_given=True, tool_is_given=True
    )


@pytest.mark.parametrize("change", ["as it is", "frames askew", "no effects", "networks", "networks that turn"])
def test_joints_are_those_that_newtons_method_finds(model, path, change, monkeypatch):
    model = {
        "as it is": lambda: model,
        "frames askew": lambda: askew(model),
        "no effects": lambda: replace(model, effects=()),
        "networks": lambda: model.with_residual(residual_about(HOME)),
        "networks that turn": lambda: askew(model).with_residual(residual_about(HOME, outputs=6)),
    }[change]()
    found = solved(model, path)
    goal, exact = by_newton(model, path, monkeypatch)
    assert np.abs(found.q_rad - path).max() > 1e-4
    np.testing.assert_allclose(found.q_rad, exact.q_rad, atol=1e-9)
    assert np.median(np.abs(found.q_rad - exact.q_rad)) < 1e-10
    error = lie.pose_error(goal, model.flange_poses(found.q_rad))
    assert np.abs(error).max() < 1e-9
    assert max(found.position_error_m.max(), found.angle_error_rad.max()) < 1e-9


def test_errors_and_displacement_are_those_of_the_model(model, path):
    model = askew(model)
    found = solved(model, path)
    goal = model.goal_flange_poses(nominal_flange_poses(model.robot, path))
    for q, stated in ((path, found.error_before_mm), (found.q_rad, found.error_after_mm)):
        tool = (model.flange_poses(q) @ model.X_FE)[:, :3, 3] - (goal @ model.X_FE)[:, :3, 3]
        np.testing.assert_allclose(stated, 1e3 * np.linalg.norm(tool, axis=1), atol=1e-6)
    moved = nominal_flange_poses(model.robot, found.q_rad) - nominal_flange_poses(model.robot, path)
    np.testing.assert_allclose(found.displacement_mm, 1e3 * np.linalg.norm(moved[:, :3, 3], axis=1), atol=1e-9)


def test_anywhere_in_its_space_the_arm_is_corrected_to_a_nanometre(model):
    """Also where effects fade, where a load changes sides, and near singularities, if anything converges there."""
    q = random_joints(model.robot, 3000, 5)
    found = solved(model, q)
    goal = model.goal_flange_poses(nominal_flange_poses(model.robot, q))
    error = np.abs(lie.pose_error(goal, model.flange_poses(found.q_rad))).max(axis=1)
    reached = (found.position_error_m < 1e-9) & (found.angle_error_rad < 1e-9)
    assert reached.mean() > 0.97
    assert error[reached].max() < 1e-9
    same = inverse.solve(model.flange_poses_and_jacobian, goal, q).converged
    assert not (same & ~reached).any()


def test_each_waypoint_is_solved_as_if_it_were_alone(model, path, monkeypatch):
    q = np.tile(path, (12, 1)) + np.linspace(0, 0.2, 12 * len(path))[:, None]
    together = solved(model, q)
    for rows in ([17], range(700, 760), range(0, len(q), 40)):
        alone = solved(model, q[rows])
        for name in ("q_rad", "error_before_mm", "error_after_mm", "displacement_mm", "smallest_singular_value"):
            assert np.array_equal(getattr(alone, name), getattr(together, name)[rows]), name
    for cores in (1, 3):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _, cores=cores: set(range(cores)))
        again = solved(model, q)
        assert np.array_equal(again.q_rad, together.q_rad)
        assert np.array_equal(again.error_after_mm, together.error_after_mm)


def test_singular_values_are_exact_where_small_and_bounds_elsewhere(model):
    q = np.tile(HOME, (200, 1))
    q[:, 4] = np.linspace(-0.5, -0.02, 200)
    found = solved(model, q)
    true = np.linalg.svd(model.flange_poses_and_jacobian(found.q_rad)[1], compute_uv=False)[:, -1]
    small = found.smallest_singular_value < NEAR_SINGULAR
    assert small.any()
    assert not small.all()
    np.testing.assert_allclose(found.smallest_singular_value[small], true[small], atol=1e-12)
    assert (found.smallest_singular_value[~small] <= true[~small]).all()
    assert not (true[~small] < NEAR_SINGULAR).any()


def test_a_robot_without_errors_stays_where_it_is_bit_for_bit(ur5, path):
    found = solved(nominal_model(ur5), path)
    assert np.array_equal(found.q_rad, path)
    assert found.displacement_mm.max() == 0.0


def test_a_base_that_is_turned_far_is_left_to_newtons_method(model, path, monkeypatch):
    """Half a turn between base and drawing: no small turn, whose formulas would take it for none at all."""
    turned = replace(model, X_MB=np.diag([-1.0, -1.0, 1.0, 1.0]) @ model.X_MB, base_is_given=True)
    found = solved(turned, path[:5])
    goal, exact = by_newton(turned, path[:5], monkeypatch, tolerance=1e-9)
    assert np.array_equal(found.q_rad, exact.q_rad)
    error = lie.pose_error(goal, turned.flange_poses(found.q_rad))
    np.testing.assert_allclose(found.angle_error_rad, np.linalg.norm(error[:, :3], axis=1), atol=1e-12)


def test_a_redundant_arm_takes_the_shortest_way_as_newtons_method_does(seven, monkeypatch):
    model, q = afflicted(seven), 0.3 + np.linspace(0, 1, 20)[:, None] * [0.5, 0.3, -0.4, 0.2, 0.1, 0.6, 0.4]
    _, exact = by_newton(model, q, monkeypatch, tolerance=1e-9)
    assert np.array_equal(solved(model, q).q_rad, exact.q_rad)
