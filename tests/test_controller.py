"""What the controller believes; the truth is Denavit and Hartenberg by hand, Drake and scipy."""

from dataclasses import replace

import numpy as np
import pytest
from denavit_hartenberg import PUBLISHED, calibration_conf, flange_poses, table
from drake_arm import DrakeArm, random_joints
from published_arms import MODELS, X_0T, joints, robot_of, written
from scipy.spatial.transform import Rotation
from truepath.controller import controller_of, poses_from_vectors, vectors_from_poses
from truepath.errors import InputError
from truepath.plants import load_robot

HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


# As published


def test_a_ur5_with_all_joints_at_zero_is_where_its_table_says(ur5):
    X = controller_of(ur5).tool_poses(np.zeros((1, 6)), np.eye(4))[0]
    # Stretched along -x: a2 + a3; to the side d4 + d6; up d1, down d5.
    assert X[:3, 3] == pytest.approx([-0.425 - 0.39225, -0.10915 - 0.0823, 0.089159 - 0.09465], abs=1e-12)
    assert X[:3, :3] == pytest.approx(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), abs=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_tool_poses_are_those_of_the_published_parameters_and_of_drake(name):
    controller = controller_of(load_robot(name))
    q = joints()
    X_CT = controller.tool_poses(q, X_0T)
    assert np.abs(X_CT - flange_poses(table(MODELS[name]), q) @ X_0T).max() < 1e-12
    assert np.abs(controller.X_BC @ X_CT - DrakeArm(name).flange_poses(q) @ controller.X_F0 @ X_0T).max() < 1e-9
    assert MODELS[name] in controller.source


@pytest.mark.parametrize("model", PUBLISHED)
def test_every_published_model_is_known_by_its_axes(ur5, model):
    controller = controller_of(robot_of(ur5, model))
    assert controller.source == f"{model} as published"
    assert np.abs(controller.tool_poses(joints(), np.eye(4)) - flange_poses(table(model), joints())).max() < 1e-9


def test_a_base_turned_as_in_ros_and_a_flange_turned_are_found(ur5):
    """base_link against base; and the flange of REP-103 with x ahead."""
    X_0F = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]], float)
    turned = replace(
        ur5,
        X_BA=HALF_TURN @ ur5.X_BA,
        X_BF=HALF_TURN @ ur5.X_BF @ X_0F,
        p_BoLcm_B=ur5.p_BoLcm_B * [-1, -1, 1],
        gravity_B=ur5.gravity_B * [-1, -1, 1],
    )
    controller = controller_of(turned)
    assert np.array_equal(controller.X_BC, HALF_TURN)
    assert np.abs(X_0F @ controller.X_F0 - np.eye(4)).max() < 1e-9
    assert np.abs(controller.tool_poses(joints(), np.eye(4)) - flange_poses(table("UR5"), joints())).max() < 1e-12
    assert controller.kinematics.gravity_torque(joints()) == pytest.approx(ur5.gravity_torque(joints()), abs=1e-9)


def test_an_arm_that_is_nearly_a_ur_is_taken_from_its_plant(ur5):
    longer = ur5.X_BA.copy()
    longer[1:, 2, 3] += 2e-5
    controller = controller_of(replace(ur5, X_BA=longer))
    assert controller.source == "the plant of ur5"
    assert np.array_equal(controller.X_BC, np.eye(4))


def test_another_arm_is_taken_from_its_plant(seven, seven_joint_arm):
    controller = controller_of(seven)
    q = random_joints(seven, 10, 0)
    assert np.abs(controller.tool_poses(q, X_0T) - DrakeArm(seven_joint_arm).flange_poses(q) @ X_0T).max() < 1e-9


def test_joints_are_found_back_from_tool_poses(ur10):
    controller = controller_of(ur10)
    q = [0.3, -1.4, 1.2, -1.3, -1.5, 0.4] + 0.3 * joints() / np.pi
    solution = controller.joints(flange_poses(table("UR10"), q) @ X_0T, X_0T, q + 0.02)
    assert solution.converged.all()
    assert np.abs(solution.q_rad - q).max() < 1e-7


# Vectors p[x, y, z, rx, ry, rz]


def test_vectors_are_place_and_rotation_vector():
    vectors = np.array([[0.1, -0.2, 0.3, 0, np.pi, 0], [0, 0, 1, 0.4, -0.5, 0.6], [0.5, 0, 0, 0, 0, 0]])
    poses = poses_from_vectors(vectors)
    assert poses[0] == pytest.approx(
        np.array([[-1, 0, 0, 0.1], [0, 1, 0, -0.2], [0, 0, -1, 0.3], [0, 0, 0, 1]]), abs=1e-12
    )
    assert poses[1, :3, :3] == pytest.approx(Rotation.from_rotvec([0.4, -0.5, 0.6]).as_matrix(), abs=1e-12)
    assert vectors_from_poses(poses[1:]) == pytest.approx(vectors[1:], abs=1e-12)
    long = vectors_from_poses(poses_from_vectors(np.array([[0, 0, 0, 4.0, 0, 0]])))
    assert long[0, 3:] == pytest.approx([4 - 2 * np.pi, 0, 0], abs=1e-12)


# Other files


def test_other_files_are_refused(ur5, seven, tmp_path):
    for robot, path, problem in (
        (ur5, tmp_path / "none.conf", "no such file"),
        (ur5, tmp_path, "unknown kind of file"),
        (ur5, written(tmp_path / "kinematics.json", "{}"), "unknown kind of file"),
        (ur5, written(tmp_path / "large.conf", b" " * (2 << 20)), "larger than"),
        (ur5, written(tmp_path / "latin.yaml", b"kinematics: \xff"), "not UTF-8"),
        (
            seven,
            written(tmp_path / "calibration.conf", calibration_conf("UR5", table("UR5"))),
            "only a Universal Robot",
        ),
    ):
        with pytest.raises(InputError, match=problem):
            controller_of(robot, path)
