"""What the controller believes; the truth is Denavit and Hartenberg by hand, Drake and scipy."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from denavit_hartenberg import PUBLISHED, askew, calibration_conf, flange_poses, frames, table
from drake_arm import DrakeArm, random_joints
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from truepath.controller import controller_of, poses_from_vectors, vectors_from_poses
from truepath.controller_files import read_calibration_conf, read_extracted_kinematics
from truepath.errors import InputError

MODELS = {"ur5": "UR5", "ur10": "UR10"}
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
X_0T = np.array([[0, 0, 1, 0.02], [0, 1, 0, -0.01], [-1, 0, 0, 0.15], [0, 0, 0, 1]], float)
NOMINAL_UR5 = """kinematics:
  shoulder: {x: 0, y: 0, z: 0.089159, roll: 0, pitch: 0, yaw: 0}
  upper_arm: {x: 0, y: 0, z: 0, roll: 1.5707963267948966, pitch: 0, yaw: 0}
  forearm: {x: -0.425, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}
  wrist_1: {x: -0.39225, y: 0, z: 0.10915, roll: 0, pitch: 0, yaw: 0}
  wrist_2: {x: 0, y: -0.09465, z: 0, roll: 1.5707963267948966, pitch: 0, yaw: 0}
  wrist_3: {x: 0, y: 0.0823, z: 0, roll: 1.5707963267948966, pitch: 3.141592653589793, yaw: 3.141592653589793}
  hash: calib_12345
"""
CALIBRATED_UR5 = """kinematics:
  shoulder:
    x: 0
    y: 0
    z: 0.0892011
    roll: -0
    pitch: 0
    yaw: 1.5e-05
  upper_arm:
    x: 8.28e-05
    y: 0
    z: 0
    roll: 1.5702793
    pitch: 0
    yaw: 2.4e-03
  forearm:
    x: -0.425146
    y: 0
    z: 0
    roll: 0.0021
    pitch: 0.0013
    yaw: 8.2e-05
  wrist_1:
    x: -0.3923133
    y: 0.0007036
    z: 0.11004902
    roll: 3.1351985
    pitch: -3.1400954
    yaw: 3.1415185
  wrist_2:
    x: 3.65e-05
    y: -0.0947211
    z: 0.000179
    roll: 1.568905
    pitch: 0
    yaw: -1.3e-05
  wrist_3:
    x: 0.00015399
    y: 0.0824213
    z: 0.0001263
    roll: 1.572329
    pitch: 3.1415926535897931
    yaw: -3.14158677
  hash: calib_1
"""


@pytest.fixture
def robot(request):
    """Function: a nominal robot by its name."""
    return request.getfixturevalue


@pytest.fixture
def write(tmp_path):
    def write(name, text):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def joints(count=30, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 6))


def robot_of(ur5, model):
    """A robot with the axes of a published model."""
    seven = np.array(frames(table(model), np.zeros(6)))
    return replace(ur5, name=model, X_BA=seven[:6], X_BF=seven[6])


def chain_of(text, q):
    """The arm of an extracted file, by hand."""
    X, blocks = np.eye(4), text.split("kinematics:\n")[1].split("\n  hash")[0]
    numbers = [float(line.split(":")[1]) for line in blocks.splitlines() if line.split(":")[1].strip()]
    for (x, y, z, *angles), angle in zip(np.reshape(numbers, (6, 6)), q, strict=True):
        link, turn = np.eye(4), np.eye(4)
        link[:3, :3], link[:3, 3] = Rotation.from_euler("XYZ", angles).as_matrix(), (x, y, z)
        turn[:3, :3] = Rotation.from_rotvec([0, 0, angle]).as_matrix()
        X = X @ link @ turn
    return X


# As published


def test_a_ur5_with_all_joints_at_zero_is_where_its_table_says(ur5):
    X = controller_of(ur5).tool_poses(np.zeros((1, 6)), np.eye(4))[0]
    # Stretched along -x: a2 + a3; to the side d4 + d6; up d1, down d5.
    assert X[:3, 3] == pytest.approx([-0.425 - 0.39225, -0.10915 - 0.0823, 0.089159 - 0.09465], abs=1e-12)
    assert X[:3, :3] == pytest.approx(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), abs=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_tool_poses_are_those_of_the_published_parameters_and_of_drake(robot, name):
    controller = controller_of(robot(name))
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


# calibration.conf


@pytest.mark.parametrize("name", MODELS)
def test_deltas_are_added_to_the_published_parameters(robot, write, name):
    rows = table(MODELS[name]) + np.random.default_rng(1).normal(scale=1e-3, size=(6, 4))
    controller = controller_of(robot(name), write("calibration.conf", calibration_conf(MODELS[name], rows)))
    assert np.abs(controller.tool_poses(joints(), X_0T) - flange_poses(rows, joints()) @ X_0T).max() < 1e-12
    assert controller.source == f"{MODELS[name]} as calibrated in calibration.conf"


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_lengths_of_metres_that_cancel_are_no_fault(robot, write, name, seed):
    arm, rows = askew(MODELS[name], seed)
    assert np.abs(rows[:, 2]).max() > 1.5  # metres, for a tilt of some milliradians
    controller = controller_of(robot(name), write("calibration.conf", calibration_conf(MODELS[name], rows)))
    assert np.abs(controller.tool_poses(joints(), np.eye(4)) - arm(joints())).max() < 1e-10
    assert np.abs(controller.kinematics.X_BA[:, :3, 3]).max() < 1.5
    assert np.abs(controller.kinematics.X_BA[:, :3, 3] - robot(name).X_BA[:, :3, 3]).max() < 0.02


def test_the_file_of_another_size_of_arm_is_refused_and_its_size_named(ur5, write):
    path = write("calibration.conf", calibration_conf("UR10", askew("UR10", 2)[1]))
    with pytest.raises(InputError, match="does not fit the robot") as caught:
        controller_of(ur5, path)
    assert caught.value.file == path
    assert "UR5" in caught.value.expected
    assert "UR10" in caught.value.found


GOOD_CONF = calibration_conf("UR5", table("UR5") + 1e-4)


@pytest.mark.parametrize(
    ("old", "new", "problem", "line"),
    [
        ("[mounting]", "[moving]", "section is missing", None),
        ("[mounting]\n", "", "no calibration.conf", 1),
        ("delta_d = [", "delta_e = [", "entry is missing", None),
        ("delta_a = [ ", "delta_a = [ 0, ", "six numbers", 3),
        ("delta_a = [ ", "delta_a = ", "six numbers", 3),
        ("delta_a = [ ", "delta_a = [ __import__('os').getcwd() + ", "not a number", 3),
        ("delta_d = [ ", "delta_d = [ nan #", "six numbers", 4),
        ("delta_d = [ ", "delta_d = [ 1", "does not fit", None),
        ("delta_alpha = [ ", "delta_alpha = [ 1_", "not a number", 5),
        ("delta_alpha = [ ", "delta_alpha = [ 1e9 #", "six numbers", 5),
        ("delta_theta = [ ", "delta_theta = [ 99999", "beyond all reason", 2),
        ("delta_alpha = [ ", "delta_theta = [ ", "no calibration.conf", 5),
        ("calibration_status = 2", "calibration_status = 0", "not calibrated", 7),
        ("calibration_status = 2", "calibration_status = 7", "unknown calibration status", 7),
        ("delta_theta", "\x00", "entry is missing", None),
    ],
)
def test_a_bad_conf_is_refused_with_its_line(ur5, write, old, new, problem, line):
    assert old in GOOD_CONF
    path = write("calibration.conf", GOOD_CONF.replace(old, new, 1))
    with pytest.raises(InputError, match=problem) as caught:
        controller_of(ur5, path)
    assert (caught.value.file, caught.value.line) == (path, line)


def test_a_file_of_zeros_that_says_not_calibrated_is_the_published_arm(ur5, write):
    text = calibration_conf("UR5", table("UR5")).replace("status = 2", "status = 0")
    controller = controller_of(ur5, write("calibration.conf", text))
    assert np.array_equal(controller.kinematics.X_BF, controller_of(ur5).kinematics.X_BF)


@given(data=st.data())
def test_no_spoilt_conf_does_anything_but_be_read_or_refused(data, spoilt, tmp_path_factory):
    path = tmp_path_factory.mktemp("spoilt") / "calibration.conf"
    path.write_bytes(data.draw(spoilt(GOOD_CONF.encode())))
    with contextlib.suppress(InputError):
        assert np.isfinite(read_calibration_conf(path)).all()


# The file of ur_calibration


def test_a_nominal_file_is_the_published_arm(ur5, write):
    controller = controller_of(ur5, write("kinematics.yaml", NOMINAL_UR5))
    assert np.abs(controller.tool_poses(joints(), X_0T) - flange_poses(table("UR5"), joints()) @ X_0T).max() < 1e-12


def test_an_extracted_file_is_a_chain_of_links(ur5, write):
    controller = controller_of(ur5, write("kinematics.yaml", CALIBRATED_UR5))
    expected = np.array([chain_of(CALIBRATED_UR5, q) for q in joints()])
    assert np.abs(controller.tool_poses(joints(), np.eye(4)) - expected).max() < 1e-12


def test_the_file_is_the_same_arm_as_the_parameters_from_which_it_was_extracted(ur5, write):
    """ur_calibration writes Tx(a) Rx(alpha) of one row with Rz(theta) Tz(d) of the next as one link, angles by XYZ."""
    rows = table("UR5") + np.random.default_rng(4).normal(scale=2e-3, size=(6, 4))
    rows[5, [1, 3]] = 0.0
    lines = ["kinematics:"]
    for i, link in enumerate(("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")):
        theta, _, d, _ = rows[i]
        X = np.eye(4) if i == 0 else step_of(0, rows[i - 1, 1], 0, rows[i - 1, 3])
        X = X @ step_of(theta, 0, d, 0)
        values = [*X[:3, 3], *Rotation.from_matrix(X[:3, :3]).as_euler("XYZ")]
        lines.append(f"  {link}:")
        lines += [
            f"    {key}: {float(v)!r}" for key, v in zip(("x", "y", "z", "roll", "pitch", "yaw"), values, strict=True)
        ]
    controller = controller_of(ur5, write("kinematics.yml", "\n".join(lines)))
    assert np.abs(controller.tool_poses(joints(), X_0T) - flange_poses(rows, joints()) @ X_0T).max() < 1e-12


def step_of(theta, a, d, alpha):
    X = np.eye(4)
    X[:3, :3] = (Rotation.from_rotvec([0, 0, theta]) * Rotation.from_rotvec([alpha, 0, 0])).as_matrix()
    X[:3, 3] = Rotation.from_rotvec([0, 0, theta]).apply([a, 0, d])
    return X


@pytest.mark.parametrize(
    ("old", "new", "problem", "line"),
    [
        ("  wrist_2:", "  wrist_9:", "unknown entry", 30),
        ("    yaw: 2.4e-03\n", "", "entry is missing in upper_arm", 10),
        ("yaw: 2.4e-03", "yaw: 2.4e-03\n    yaw: 0", "stands twice", 16),
        ("z: 0.0892011", "z: high", "not a number", 5),
        ("z: 0.0892011", "z: [0.1]", "not a number", 5),
        ("z: 0.0892011", "z: .inf", "not a number", 5),
        ("z: 0.0892011", "z: 1e400", "beyond all reason", 5),
        ("z: 0.0892011", "z: !!python/object/apply:os.getcwd []", "not a number", 5),
        ("z: 0.0892011", "z: 0.1273", "does not fit", None),
        ("yaw: 1.5e-05", "yaw: 0.2", "does not fit", None),
        ("kinematics:", "kinetics:", "unknown entry", 1),
        ("kinematics:", "- kinematics:", "has no entries", 1),
        ("kinematics:", "kinematics: 1 #", "no YAML", 2),
        ("  hash: calib_1", "  hash: {", "no YAML", 45),
        (CALIBRATED_UR5, "", "has no entries", None),
        (CALIBRATED_UR5, "[" * 2000, "no YAML", None),
    ],
)
def test_a_bad_extracted_file_is_refused_with_its_line(ur5, write, old, new, problem, line):
    assert old in CALIBRATED_UR5
    path = write("kinematics.yaml", CALIBRATED_UR5.replace(old, new, 1))
    with pytest.raises(InputError, match=problem) as caught:
        controller_of(ur5, path)
    assert caught.value.file == path
    assert line is None or caught.value.line == line


def test_the_extracted_file_of_a_similar_model_is_refused_and_it_is_named(ur5, write):
    """A UR3e is 19 mm and 10 mm off a UR3."""
    d1, a2, a3, d4, d5, d6 = PUBLISHED["UR3e"]
    d1_5, a2_5, a3_5, d4_5, d5_5, d6_5 = PUBLISHED["UR5"]
    text = NOMINAL_UR5
    for old, new in ((d1_5, d1), (a2_5, a2), (a3_5, a3), (d4_5, d4), (-d5_5, -d5), (d6_5, d6)):
        assert f": {old}," in text
        text = text.replace(f": {old},", f": {new},")
    path = write("kinematics.yaml", text)
    assert controller_of(robot_of(ur5, "UR3e"), path).source == "UR3e as calibrated in kinematics.yaml"
    for model in ("UR3", "UR5", "UR10"):
        with pytest.raises(InputError, match="does not fit the robot") as caught:
            controller_of(robot_of(ur5, model), path)
        assert "it would fit UR3e" in caught.value.found


@given(data=st.data())
def test_no_spoilt_extracted_file_does_anything_but_be_read_or_refused(data, spoilt, tmp_path_factory):
    path = tmp_path_factory.mktemp("spoilt") / "kinematics.yaml"
    path.write_bytes(data.draw(spoilt(CALIBRATED_UR5.encode())))
    with contextlib.suppress(InputError):
        assert np.isfinite(read_extracted_kinematics(path).X_CA).all()


# Neither


def test_other_files_are_refused(ur5, seven, write, tmp_path):
    for robot, path, problem in (
        (ur5, tmp_path / "none.conf", "no such file"),
        (ur5, tmp_path, "unknown kind of file"),
        (ur5, write("kinematics.json", "{}"), "unknown kind of file"),
        (ur5, write("large.conf", b" " * (2 << 20)), "larger than"),
        (ur5, write("latin.yaml", b"kinematics: \xff"), "not UTF-8"),
        (seven, write("calibration.conf", GOOD_CONF), "only a Universal Robot"),
    ):
        with pytest.raises(InputError, match=problem):
            controller_of(robot, path)
