"""The file that ``ur_calibration`` extracts is read as a chain of links, or refused with its line."""

import contextlib

import numpy as np
import pytest
from denavit_hartenberg import PUBLISHED, flange_poses, table
from hypothesis import given
from hypothesis import strategies as st
from published_arms import X_0T, joints, robot_of, written
from scipy.spatial.transform import Rotation
from truepath.controller import controller_of
from truepath.controller_files import read_extracted_kinematics
from truepath.errors import InputError

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


def test_a_nominal_file_is_the_published_arm(ur5, tmp_path):
    controller = controller_of(ur5, written(tmp_path / "kinematics.yaml", NOMINAL_UR5))
    assert np.abs(controller.tool_poses(joints(), X_0T) - flange_poses(table("UR5"), joints()) @ X_0T).max() < 1e-12


def test_an_extracted_file_is_a_chain_of_links(ur5, tmp_path):
    controller = controller_of(ur5, written(tmp_path / "kinematics.yaml", CALIBRATED_UR5))
    expected = np.array([chain_of(CALIBRATED_UR5, q) for q in joints()])
    assert np.abs(controller.tool_poses(joints(), np.eye(4)) - expected).max() < 1e-12


def test_the_file_is_the_same_arm_as_the_parameters_from_which_it_was_extracted(ur5, tmp_path):
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
    controller = controller_of(ur5, written(tmp_path / "kinematics.yml", "\n".join(lines)))
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
def test_a_bad_extracted_file_is_refused_with_its_line(ur5, tmp_path, old, new, problem, line):
    assert old in CALIBRATED_UR5
    path = written(tmp_path / "kinematics.yaml", CALIBRATED_UR5.replace(old, new, 1))
    with pytest.raises(InputError, match=problem) as caught:
        controller_of(ur5, path)
    assert caught.value.file == path
    assert line is None or caught.value.line == line


def test_the_extracted_file_of_a_similar_model_is_refused_and_it_is_named(ur5, tmp_path):
    """A UR3e is 19 mm and 10 mm off a UR3."""
    d1, a2, a3, d4, d5, d6 = PUBLISHED["UR3e"]
    d1_5, a2_5, a3_5, d4_5, d5_5, d6_5 = PUBLISHED["UR5"]
    text = NOMINAL_UR5
    for old, new in ((d1_5, d1), (a2_5, a2), (a3_5, a3), (d4_5, d4), (-d5_5, -d5), (d6_5, d6)):
        assert f": {old}," in text
        text = text.replace(f": {old},", f": {new},")
    path = written(tmp_path / "kinematics.yaml", text)
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
