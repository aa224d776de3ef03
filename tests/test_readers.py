"""Data sets by format: truepath's own CSV and the two published sets, real and synthetic, and spoilt files."""

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from truepath.errors import InputError
from truepath.readers import READERS, read_measurements, with_nominal_frames

CSV = (
    "q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,x_mm,y_mm,z_mm,qw,qx,qy,qz,t_s,temperature_c,"
    "approach1,approach2,approach3,approach4,approach5,approach6,pose_id\n"
    "0.1,-1.2,1.3,-1.4,-1.5,0.6,100.5,-200.25,300.0,1,0,0,0,0,20.5,1,0,-1,1,1,1,a\n"
    "0.2,-1.1,1.2,-1.3,-1.4,0.5,110.5,-210.25,310.0,0.6,0,0.8,0,4.5,20.5,1,0,-1,1,1,1,b\n"
    "0.1,-1.2,1.3,-1.4,-1.5,0.6,120.5,-220.25,320.0,0,0,0,-1,9.0,20.6,1,0,-1,1,-1,1,a\n"
)
JACOBI = (
    "step_order,x_t,y_t,z_t,x_dif,y_dif,z_dif,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6\n"
    "0,-430,-6,-98,-2.5,-3.5,0.75,-22.5,-43.75,135.5,-94.75,55.5,-5.5\n"
    "3,-463,-4,-104,-2.25,-2.75,-0.25,-19.5,-45.75,127.5,-71.5,63.25,-12.75\n"
)
LANDGRAF = (
    "Timestamp;Goal x;Goal y;Goal z;Goal roll;Goal pitch;Goal yaw;shoulder_pan_joint;shoulder_lift_joint;"
    "elbow_joint;wrist_1_joint;wrist_2_joint;wrist_3_joint;measurement_temperature;measurement_x;measurement_y;"
    "measurement_z;measurement_rx;measurement_ry;measurement_rz\n"
    "20200714235950;0,4;0,1;1,4;1,5;1,5;1,5;-1,5;-1,25;0,5;-1,5;0,25;0,125;23,5;2361,5;-1368,25;119,5;-90,5;-59,5;-90,25\n"
    "20200715000010;0,8;0,6;0,9;1,7;1,5;1,5;-2,25;-2,5;-0,75;-0,25;0,5;-0,5;23,75;1685,5;-1665,5;-415,75;10;20;30\n"
)
SAMPLES = {"csv": CSV, "jacobi2025": JACOBI, "landgraf2021": LANDGRAF}


@pytest.fixture
def write(tmp_path):
    def write(content):
        path = tmp_path / "data.csv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def refusal(path, robot, format) -> InputError:
    with pytest.raises(InputError) as caught:
        read_measurements(path, robot, format)
    return caught.value


def test_every_format_has_a_sample_here():
    assert set(READERS) == set(SAMPLES)


@pytest.mark.parametrize("format", SAMPLES)
def test_every_format_keeps_lines_name_and_hash_of_its_file(write, ur10, format):
    data = read_measurements(write(SAMPLES[format]), ur10, format)
    assert data.line.tolist() == list(range(2, 2 + len(data)))
    assert data.source == "data.csv"
    assert data.sha256 == hashlib.sha256(SAMPLES[format].encode()).hexdigest()


def test_an_unknown_format_is_refused_and_the_known_ones_are_told(write, ur5):
    error = refusal(write(CSV), ur5, "smith1999")
    assert "unknown format 'smith1999'" in error.problem
    assert error.expected == "one of csv, jacobi2025, landgraf2021"


@pytest.mark.parametrize("format", SAMPLES)
def test_a_file_of_another_format_is_recognised_and_its_format_told(write, ur10, format):
    for other in set(SAMPLES) - {format}:
        error = refusal(write(SAMPLES[other]), ur10, format)
        assert error.problem == "this looks like data of another format"
        assert (error.line, f"--format {other}" in error.found) == (1, True)


@pytest.mark.parametrize("format", SAMPLES)
def test_missing_files_and_folders_are_refused_in_every_format(tmp_path, ur10, format):
    assert refusal(tmp_path / "nowhere.csv", ur10, format).problem == "no such file"
    assert refusal(tmp_path, ur10, format).problem == "this is not a file"


@pytest.mark.parametrize("format", ["jacobi2025", "landgraf2021"])
def test_the_published_sets_are_refused_for_a_robot_of_seven_joints(write, seven, format):
    error = refusal(write(SAMPLES[format]), seven, format)
    assert "six-joint robots" in error.problem
    assert error.found == "seven with 7"


@pytest.mark.parametrize("format", SAMPLES)
def test_joint_limits_are_checked_in_every_format(write, ur10, format):
    number = {"csv": ("-1.1", "-11"), "jacobi2025": ("127.5", "1127.5"), "landgraf2021": ("-0,75", "-7,5")}[format]
    error = refusal(write(SAMPLES[format].replace(*number)), ur10, format)
    assert (error.problem, error.line) == ("an angle lies far beyond the joint limits", 3)


# Jacobi 2025


def test_jacobi_measured_positions_are_target_plus_difference(write, ur5):
    data = read_measurements(write(JACOBI), ur5, "jacobi2025")
    np.testing.assert_allclose(data.p_ME, [[-0.4325, -0.0095, -0.09725], [-0.46525, -0.00675, -0.10425]], rtol=1e-12)
    np.testing.assert_allclose(data.q_rad[1], np.array([-19.5, -45.75, 127.5, -71.5, 63.25, -12.75]) * np.pi / 180)
    assert not data.has_orientation
    assert data.time_s is None


def test_jacobi_states_both_frames(write, ur5):
    data = read_measurements(write(JACOBI), ur5, "jacobi2025")
    np.testing.assert_array_equal(data.X_MB_nominal, np.eye(4))
    np.testing.assert_array_equal(data.X_FE_nominal[:3, 3], [0, 0, 0.031])
    np.testing.assert_array_equal(data.X_FE_nominal[:3, :3], np.eye(3))


@pytest.mark.parametrize("name", JACOBI.splitlines()[0].split(",")[1:])
def test_jacobi_misses_each_of_its_columns_by_name(write, ur5, name):
    # x_dif is by what the format is known, so the name must stay in the line.
    header, _, rows = JACOBI.partition("\n")
    columns = ["step_order_x_dif" if c == "step_order" else "gone" if c == name else c for c in header.split(",")]
    error = refusal(write(",".join(columns) + "\n" + rows), ur5, "jacobi2025")
    assert (error.problem, error.line, error.column) == ("a column is missing", 1, name)


def test_jacobi_tells_a_bad_cell_with_its_place(write, ur5):
    error = refusal(write(JACOBI.replace("-2.75", "lost")), ur5, "jacobi2025")
    assert (error.problem, error.line, error.column) == ("text where a number belongs", 3, "y_dif")


def test_the_real_jacobi_set_is_read_and_its_targets_are_the_nominal_robot(data_dir, ur5):
    path = data_dir / "ur5_jacobi2025" / "grid.csv"
    data = read_measurements(path, ur5, "jacobi2025")
    assert len(data) == 800
    raw = np.genfromtxt(path, delimiter=",", names=True)
    targets = np.stack([raw[c] for c in ("x_t", "y_t", "z_t")], axis=1) / 1000
    q = np.radians(np.stack([raw[f"joint_{i}"] for i in range(1, 7)], axis=1))
    np.testing.assert_allclose(data.q_rad, q, rtol=1e-14)
    # The published UR5 table, with the reflector 31 mm out on the flange. The targets lie 0.09 mm above it
    # throughout; but for that they agree to 0.02 mm on average.
    p = np.array([_dh_ur5(row) @ [0, 0, 0.031, 1] for row in q])[:, :3]
    offset = (targets - p).mean(axis=0)
    np.testing.assert_allclose(offset, [0, 0, 0.09e-3], atol=0.01e-3)
    assert np.linalg.norm(targets - p - offset, axis=1).mean() < 0.02e-3
    error_mm = 1e3 * np.linalg.norm(data.p_ME - targets, axis=1)
    assert 2.0 < error_mm.mean() < 3.5


def _dh_ur5(q):
    X = np.eye(4)
    half = np.pi / 2
    rows = zip(
        q,
        (0.089159, 0, 0, 0.10915, 0.09465, 0.0823),
        (0, -0.425, -0.39225, 0, 0, 0),
        (half, 0, 0, half, -half, 0),
        strict=True,
    )
    for t, d, a, alpha in rows:
        ct, s, ca, sa = np.cos(t), np.sin(t), np.cos(alpha), np.sin(alpha)
        X = X @ [[ct, -s * ca, s * sa, a * ct], [s, ct * ca, -ct * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
    return X


# Landgraf 2021


def test_landgraf_is_read_with_decimal_commas_millimetres_and_seconds_since_its_first_row(write, ur10):
    data = read_measurements(write(LANDGRAF), ur10, "landgraf2021")
    np.testing.assert_allclose(data.p_ME, [[2.3615, -1.36825, 0.1195], [1.6855, -1.6655, -0.41575]], rtol=1e-12)
    assert data.q_rad[1].tolist() == [-2.25, -2.5, -0.75, -0.25, 0.5, -0.5]
    assert data.time_s.tolist() == [0, 20]  # over midnight
    assert data.temperature_c.tolist() == [23.5, 23.75]
    assert data.X_MB_nominal is None
    assert data.X_FE_nominal is None


def test_landgraf_angles_are_intrinsic_x_y_z_in_degrees(write, ur10):
    data = read_measurements(write(LANDGRAF), ur10, "landgraf2021")
    (cx, cy, cz), (sx, sy, sz) = (f(np.radians([10, 20, 30])) for f in (np.cos, np.sin))
    rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    np.testing.assert_allclose(data.R_ME[1], rx @ ry @ rz, atol=1e-14)


@pytest.mark.parametrize("stamp", ["2020071500001", "20201315000010", "20200715006010", "yesterday", "", "2020-07-15"])
def test_landgraf_refuses_what_is_no_time_stamp(write, ur10, stamp):
    error = refusal(write(LANDGRAF.replace("20200715000010", stamp)), ur10, "landgraf2021")
    assert (error.problem, error.line, error.column) == ("not a time stamp", 3, "Timestamp")
    assert error.found == stamp


def test_landgraf_refuses_a_decimal_point(write, ur10):
    error = refusal(write(LANDGRAF.replace("1685,5", "1685.5")), ur10, "landgraf2021")
    assert (error.problem, error.line, error.column) == ("text where a number belongs", 3, "measurement_x")


@pytest.mark.parametrize("name", [c for c in LANDGRAF.splitlines()[0].split(";") if "joint" in c or "measure" in c])
def test_landgraf_misses_each_of_its_columns_by_name(write, ur10, name):
    error = refusal(write(LANDGRAF.replace(name, "gone", 1)), ur10, "landgraf2021")
    assert (error.problem, error.line, error.column) == ("a column is missing", 1, name)


def test_the_real_landgraf_set_is_read_and_measures_the_commanded_poses(data_dir, ur10):
    path = data_dir / "ur10_landgraf2021" / "series_a.csv"
    data = read_measurements(path, ur10, "landgraf2021")
    assert len(data) == 11_911
    assert data.has_orientation
    assert 22 < data.temperature_c.min() < data.temperature_c.max() < 24
    # Whatever the two unknown frames: X_ME = X_MB X_BF X_FE, so the angle between two poses of the probe is
    # that between the two commanded poses of the flange. This judges the Euler convention and the joints' order.
    rows = path.read_text().replace(",", ".").splitlines()[1:]
    goals = Rotation.from_euler("xyz", [[float(c) for c in row.split(";")[4:7]] for row in rows])
    measured = Rotation.from_matrix(data.R_ME)
    between_goals = (goals[:-1].inv() * goals[1:]).magnitude()
    between_measured = (measured[:-1].inv() * measured[1:]).magnitude()
    assert np.median(np.abs(between_goals - between_measured)) < 3e-3


# Nominal frames


def test_stated_frames_replace_what_the_reader_knew_and_none_leaves_it(write, ur5):
    data = read_measurements(write(JACOBI), ur5, "jacobi2025")
    X = np.diag([1.0, -1, -1, 1])
    both = with_nominal_frames(data, X, X)
    assert both.X_MB_nominal is X
    assert both.X_FE_nominal is X
    neither = with_nominal_frames(data, None, None)
    assert neither.X_MB_nominal is data.X_MB_nominal
    assert neither.X_FE_nominal is data.X_FE_nominal


# Spoilt files


@pytest.mark.parametrize("format", SAMPLES)
@settings(max_examples=200)
@given(data=st.data())
def test_a_spoilt_file_is_read_or_refused_and_nothing_else(tmp_path_factory, ur10, spoilt, format, data):
    path = tmp_path_factory.getbasetemp() / f"spoilt_{format}.csv"
    path.write_bytes(data.draw(spoilt(SAMPLES[format].encode())))
    try:
        read = read_measurements(path, ur10, format)
    except InputError:
        return
    assert np.isfinite(read.q_rad).all()
    assert np.isfinite(read.p_ME).all()
    assert read.q_rad.shape == (len(read), 6)
    assert read.p_ME.shape == (len(read), 3)


@pytest.mark.parametrize("format", SAMPLES)
def test_a_file_cut_off_anywhere_never_yields_more_or_other_rows_than_were_whole(write, ur10, format):
    good = SAMPLES[format].encode()
    whole = read_measurements(write(good), ur10, format)
    outcomes = set()
    for cut in range(len(good)):
        try:
            part = read_measurements(write(good[:cut]), ur10, format)
        except InputError:
            outcomes.add("refused")
            continue
        outcomes.add("read")
        rows = len(part)
        assert rows <= len(whole)
        # The last cell of the last row, an angle in one format, may have lost digits: nothing gives that away.
        np.testing.assert_array_equal(part.q_rad[:-1], whole.q_rad[: rows - 1])
        np.testing.assert_array_equal(part.q_rad[:, :-1], whole.q_rad[:rows, :-1])
        np.testing.assert_array_equal(part.p_ME, whole.p_ME[:rows])
    assert outcomes == {"read", "refused"}
