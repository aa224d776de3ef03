"""A measured data set: which columns it may have, in which units, and how each fault of a file is told."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truepath.errors import InputError
from truepath.measurements import Measurements, check_joint_limits
from truepath.readers import read_measurements

JOINTS = [f"q{i}_rad" for i in range(1, 7)]
POSITION = ["x_mm", "y_mm", "z_mm"]
Q = [[0.1, -1.2, 1.3, -1.4, -1.5, 0.6], [0.2, -1.0, 1.1, -1.2, -1.3, 0.4], [-0.3, -0.9, 1.0, -1.1, -1.2, 0.3]]
P = [[100.5, -200.25, 300.0], [110.5, -210.25, 310.0], [120.5, -220.25, 320.0]]


class Sheet:
    """Columns of text under names: a good data set of three poses, for tests to spoil."""

    def __init__(self):
        self.columns = {name: [repr(row[i]) for row in Q] for i, name in enumerate(JOINTS)}
        self.columns |= {name: [repr(row[i]) for row in P] for i, name in enumerate(POSITION)}

    def add(self, **columns):
        self.columns |= {name: [str(cell) for cell in cells] for name, cells in columns.items()}
        return self

    def drop(self, *names):
        for name in names:
            del self.columns[name]
        return self

    def rename(self, **names):
        self.columns = {names.get(name, name): cells for name, cells in self.columns.items()}
        return self

    def set(self, name, line, cell):
        self.columns[name][line - 2] = cell
        return self

    def text(self):
        lines = [",".join(self.columns), *map(",".join, zip(*self.columns.values(), strict=True))]
        return "\n".join(lines) + "\n"


@pytest.fixture
def sheet():
    return Sheet()


@pytest.fixture
def read(tmp_path, ur5):
    def read(content, robot=ur5):
        path = tmp_path / "poses.csv"
        text = content.text() if isinstance(content, Sheet) else content
        path.write_bytes(text.encode())
        return read_measurements(path, robot)

    return read


@pytest.fixture
def refusal(read):
    def refusal(content) -> InputError:
        with pytest.raises(InputError) as caught:
            read(content)
        assert "poses.csv" in str(caught.value)
        return caught.value

    return refusal


def place(error: InputError):
    return error.problem, error.line, error.column


# What is read


def test_the_required_columns_alone_make_a_data_set(read, sheet):
    data = read(sheet)
    np.testing.assert_array_equal(data.q_rad, Q)
    np.testing.assert_allclose(data.p_ME, np.array(P) / 1000, rtol=1e-15)
    assert len(data) == 3
    assert not data.has_orientation
    for name in (
        "R_ME",
        "time_s",
        "temperature_c",
        "payload_kg",
        "approach",
        "pose_id",
        "X_MB_nominal",
        "X_FE_nominal",
    ):
        assert getattr(data, name) is None, name


def test_degrees_and_metres_are_read_by_the_names_of_their_columns(read, sheet):
    same = read(sheet)
    other = Sheet().drop(*JOINTS, *POSITION)
    other.add(**{f"q{i + 1}_deg": [str(np.degrees(row[i])) for row in Q] for i in range(6)})
    other.add(**{f"{axis}_m": [repr(row[i] / 1000) for row in P] for i, axis in enumerate("xyz")})
    data = read(other)
    np.testing.assert_allclose(data.q_rad, same.q_rad, rtol=1e-15)
    np.testing.assert_allclose(data.p_ME, same.p_ME, rtol=1e-15)


def test_the_order_of_the_columns_does_not_matter_and_extra_ones_are_ignored(read, sheet):
    expected = read(sheet)
    sheet.add(operator=["Ann", "", "nan"], step=[7, 8, 9])
    sheet.columns = dict(reversed(sheet.columns.items()))
    data = read(sheet)
    np.testing.assert_array_equal(data.q_rad, expected.q_rad)
    np.testing.assert_array_equal(data.p_ME, expected.p_ME)


def test_orientation_is_read_from_a_scalar_first_quaternion_and_normalised(read, sheet):
    R = Rotation.from_rotvec([[0.1, -0.4, 2.0], [0, 0, 0], [1.0, 1.0, -1.0]])
    x, y, z, w = (R.as_quat() * [[1.0005], [1.0], [0.9995]]).T
    data = read(sheet.add(qw=w, qx=x, qy=y, qz=z))
    assert data.has_orientation
    np.testing.assert_allclose(data.R_ME, R.as_matrix(), atol=1e-14)


def test_the_context_is_read(read, sheet):
    sheet.add(t_s=[0, 4.5, 4.5], temperature_c=[20.5, -1, 22], payload_kg=[0, 1.25, 3])
    sheet.add(**{f"approach{i}": ["-1", "0", "+1"] for i in range(1, 7)})
    data = read(sheet)
    assert data.time_s.tolist() == [0, 4.5, 4.5]
    assert data.temperature_c.tolist() == [20.5, -1, 22]
    assert data.payload_kg.tolist() == [0, 1.25, 3]
    assert data.approach.tolist() == [[-1] * 6, [0] * 6, [1] * 6]


def test_equal_pose_ids_whatever_their_text_are_visits_of_one_pose(read, sheet):
    for name in JOINTS:
        sheet.set(name, 4, sheet.columns[name][0])
    groups = read(sheet.add(pose_id=["left", "right", "left"])).groups()
    assert groups[0] == groups[2] != groups[1]
    assert sorted(set(groups)) == [0, 1]


def test_one_pose_id_for_different_joints_is_refused(refusal, sheet):
    error = refusal(sheet.add(pose_id=["left", "right", "left"]))
    assert place(error) == ("one pose_id stands for different poses", 4, "pose_id")
    assert "line 2" in error.expected


def test_a_negative_payload_is_refused(refusal, sheet):
    error = refusal(sheet.add(payload_kg=["0", "1.5", "-0.1"]))
    assert place(error) == ("a payload cannot be negative", 4, "payload_kg")


def test_an_approach_of_a_joint_that_the_robot_does_not_have_is_refused(refusal, sheet):
    directions = {f"approach{i}": ["1", "0", "-1"] for i in range(1, 8)}
    assert place(refusal(sheet.add(**directions)))[2] == "approach7"


def test_without_pose_ids_every_row_is_a_pose_of_its_own(read, sheet):
    assert read(sheet).groups().tolist() == [0, 1, 2]


def test_the_data_knows_its_file_its_hash_and_its_lines(read, sheet):
    data = read(sheet)
    assert data.source == "poses.csv"
    assert data.sha256 == hashlib.sha256(sheet.text().encode()).hexdigest()
    assert data.line.tolist() == [2, 3, 4]


def test_a_byte_order_mark_and_blank_lines_at_the_end_are_accepted(read, sheet):
    data = read("\ufeff" + sheet.text() + "\n \n,,,\n")
    np.testing.assert_array_equal(data.q_rad, Q)


def test_as_many_joints_are_read_as_the_robot_has(read, sheet, seven):
    data = read(sheet.add(q7_rad=[0.5, 0.6, 0.7]), seven)
    assert data.q_rad.shape == (3, 7)
    assert data.q_rad[:, 6].tolist() == [0.5, 0.6, 0.7]


# Columns that are wrong


@pytest.mark.parametrize("name", [*JOINTS, *POSITION])
def test_each_required_column_is_missed_by_name(refusal, sheet, name):
    assert place(refusal(sheet.drop(name))) == ("a column is missing", 1, name)


def test_a_misspelt_column_is_recognised(refusal, sheet):
    error = refusal(sheet.rename(q3_rad="Q3_rad"))
    assert place(error) == ("a column is missing", 1, "q3_rad")
    assert "did you mean 'Q3_rad'?" in error.found


def test_a_doubled_column_is_refused(refusal, sheet):
    text = sheet.text().replace("y_mm", "x_mm")
    assert place(refusal(text)) == ("a column appears twice", 1, "x_mm")


@pytest.mark.parametrize(
    ("name", "wrong", "expected"),
    [
        ("q2_rad", "q2_grad", "q2_rad or q2_deg"),
        ("q2_rad", "q2_DEG", "q2_rad or q2_deg"),
        ("y_mm", "y_inch", "y_mm or y_m"),
        ("t_s", "t_ms", "t_s"),
        ("temperature_c", "temperature_f", "temperature_c"),
        ("payload_kg", "payload_lb", "payload_kg"),
    ],
)
def test_an_unknown_unit_is_refused_and_the_known_ones_are_told(refusal, sheet, name, wrong, expected):
    sheet.add(t_s=[1, 2, 3], temperature_c=[20, 20, 20], payload_kg=[0, 0, 0])
    error = refusal(sheet.rename(**{name: wrong}))
    assert place(error) == (f"unknown unit {wrong.split('_')[1]!r}", 1, wrong)
    assert error.expected == expected


@pytest.mark.parametrize(("name", "other", "both"), [("q4_rad", "q4_deg", "rad and deg"), ("z_mm", "z_m", "mm and m")])
def test_units_that_differ_between_columns_are_refused(refusal, sheet, name, other, both):
    error = refusal(sheet.rename(**{name: other}))
    assert error.problem.startswith("the units of ")
    assert error.problem.endswith(" differ")
    assert (error.line, error.found) == (1, both)


def test_a_quantity_in_two_units_is_refused(refusal, sheet):
    error = refusal(sheet.add(x_m=[0.1, 0.2, 0.3]))
    assert place(error) == ("a quantity appears in two units", 1, "x_m")
    assert error.found == "x_mm and x_m"


@pytest.mark.parametrize("name", ["q7_rad", "q0_rad", "q01_rad", "q12_deg", "q" + "9" * 5000 + "_rad"])
def test_a_joint_that_the_robot_does_not_have_is_refused(refusal, sheet, name):
    error = refusal(sheet.add(**{name: [0, 0, 0]}))
    assert place(error) == ("a column for a joint that the robot does not have", 1, name)
    assert error.expected == "q1 to q6"


@pytest.mark.parametrize("missing", ["qw", "qx", "qy", "qz"])
def test_part_of_a_quaternion_is_refused(refusal, sheet, missing):
    sheet.add(qw=[1, 1, 1], qx=[0, 0, 0], qy=[0, 0, 0], qz=[0, 0, 0]).drop(missing)
    assert place(refusal(sheet)) == ("a column is missing", 1, missing)


def test_directions_of_arrival_are_wanted_for_every_joint_or_for_none(refusal, sheet):
    sheet.add(**{f"approach{i}": [1, 1, 1] for i in (1, 2, 3, 4, 6)})
    assert place(refusal(sheet)) == ("a column is missing", 1, "approach5")


# Cells that are wrong

CONTEXT = {"t_s": [1, 2, 3], "temperature_c": [20, 21, 22], "payload_kg": [0, 1, 2]}
QUATERNION = {"qw": [1, 1, 1], "qx": [0, 0, 0], "qy": [0, 0, 0], "qz": [0, 0, 0]}
APPROACH = {f"approach{i}": [1, 0, -1] for i in range(1, 7)}


@pytest.mark.parametrize("name", ["q1_rad", "q6_rad", "z_mm", "qy", "t_s", "temperature_c", "payload_kg", "approach4"])
@pytest.mark.parametrize(
    ("cell", "problem"),
    [
        ("", "a number is missing"),
        ("zero", "text where a number belongs"),
        ("1_000", "text where a number belongs"),
        ("NaN", "not a number (NaN)"),
        ("inf", "an infinite number"),
        ('"1,5"', "a decimal comma where a decimal point belongs"),
    ],
)
def test_in_every_column_a_cell_that_is_no_number_is_told_with_its_place(refusal, sheet, name, cell, problem):
    sheet.add(**CONTEXT, **QUATERNION, **APPROACH).set(name, 3, cell)
    assert place(refusal(sheet)) == (problem, 3, name)


def test_a_decimal_comma_without_quotes_makes_a_ragged_row(refusal, sheet):
    error = refusal(sheet.text().replace("110.5", "110,5"))
    assert (error.problem, error.line) == ("a row has too many or too few cells", 3)


@pytest.mark.parametrize(("w", "length"), [(1.002, "1.002000"), (0.998, "0.998000"), (0, "0.000000"), (2, "2.000000")])
def test_a_quaternion_that_is_not_of_unit_length_is_refused(refusal, sheet, w, length):
    error = refusal(sheet.add(**QUATERNION).set("qw", 4, str(w)))
    assert place(error) == ("the quaternion is not of unit length", 4, "qw, qx, qy, qz")
    assert error.found == length


@pytest.mark.parametrize("cell", ["2", "-2", "0.5", "1e-3"])
def test_a_direction_of_arrival_is_minus_one_zero_or_one(refusal, sheet, cell):
    error = refusal(sheet.add(**APPROACH).set("approach5", 3, cell))
    assert place(error) == ("not a direction of arrival", 3, "approach5")
    assert (error.expected, error.found) == ("-1, 0 or 1", cell)


def test_time_never_runs_backwards(refusal, sheet):
    error = refusal(sheet.add(t_s=[5, 7.5, 7.25]))
    assert place(error) == ("time runs backwards", 4, "t_s")
    assert "7.5 or later" in error.expected
    assert error.found == "7.25"


def test_a_pose_without_its_id_is_refused_and_not_put_into_one_group_with_its_like(refusal, sheet):
    error = refusal(sheet.add(pose_id=["a", "", " "]))
    assert place(error) == ("the name of a pose is missing", 3, "pose_id")


# Angles that are wrong


def data_at(q):
    return Measurements(q_rad=np.atleast_2d(q), p_ME=np.zeros((len(np.atleast_2d(q)), 3)))


def test_two_degrees_beyond_a_limit_are_tolerated_and_no_more(seven):
    check_joint_limits(data_at(seven.upper_rad + np.radians(1.99)), seven, "f")
    check_joint_limits(data_at(seven.lower_rad - np.radians(1.99)), seven, "f")
    q = np.zeros((3, 7))
    q[2, 3] = seven.upper_rad[3] + np.radians(2.01)
    with pytest.raises(InputError) as caught:
        check_joint_limits(data_at(q), seven, "poses.csv")
    error = caught.value
    assert place(error) == ("an angle lies far beyond the joint limits", 4, "q4 (joint4)")
    assert error.expected == "-2.2000 to 2.3000 rad"
    assert error.found == f"{q[2, 3]:.4f} rad"


def test_degrees_in_a_column_of_radians_are_recognised(refusal, sheet):
    for i, name in enumerate(JOINTS):
        sheet.columns[name] = [str(np.degrees(row[i])) for row in Q]
    error = refusal(sheet)
    assert error.problem == "an angle lies far beyond the joint limits"
    assert (error.line, error.column) == (2, "q2 (shoulder_lift_joint)")
    assert "were degrees written into a column of radians?" in error.found


def test_an_angle_that_would_be_too_large_in_degrees_too_gets_no_such_hint(refusal, sheet):
    for i, name in enumerate(JOINTS):
        sheet.columns[name] = [str(np.degrees(row[i])) for row in Q]
    error = refusal(sheet.set("q1_rad", 2, "500"))
    assert (error.line, error.column) == (2, "q1 (shoulder_pan_joint)")
    assert error.found == "500.0000 rad"


def test_a_single_angle_beyond_its_limits_is_a_slip_and_not_taken_for_degrees(refusal, sheet):
    error = refusal(sheet.set("q5_rad", 3, "15"))
    assert (error.line, error.column) == (3, "q5 (wrist_2_joint)")
    assert error.found == "15.0000 rad"


def test_a_joint_without_limits_may_be_anywhere(seven):
    free = replace(seven, lower_rad=np.full(7, -np.inf), upper_rad=np.full(7, np.inf))
    check_joint_limits(data_at(np.full(7, 1000.0)), free, "f")


def test_data_of_a_robot_with_another_number_of_joints_is_refused(ur5):
    with pytest.raises(InputError, match="the data has 7 joints"):
        check_joint_limits(data_at(np.zeros(7)), ur5, "poses.csv")


# The data set as a value


def small(**more):
    N = 12
    rng = np.random.default_rng(0)
    return Measurements(q_rad=rng.normal(size=(N, 6)), p_ME=rng.normal(size=(N, 3)), **more)


def test_data_made_in_memory_numbers_its_lines_as_a_file_would(ur5):
    assert small().line.tolist() == list(range(2, 14))


def test_the_hash_of_data_in_memory_tells_different_data_apart():
    data = small()
    assert data.sha256 == small().sha256
    assert Measurements(q_rad=data.q_rad, p_ME=data.p_ME + 1e-9).sha256 != data.sha256
    assert Measurements(q_rad=data.q_rad + 1e-9, p_ME=data.p_ME).sha256 != data.sha256


@pytest.mark.parametrize("rows", [np.array([4, 0, 7]), np.arange(12) % 3 == 0], ids=["indices", "mask"])
def test_a_subset_takes_its_rows_out_of_every_column_and_keeps_what_is_common(rows):
    rng = np.random.default_rng(1)
    per_pose = {
        "R_ME": Rotation.random(12, rng=rng).as_matrix(),
        "time_s": np.arange(12.0),
        "temperature_c": rng.normal(size=12),
        "payload_kg": rng.normal(size=12),
        "approach": rng.integers(-1, 2, (12, 6)),
        "pose_id": np.arange(12) // 2,
        "line": np.arange(12) * 2 + 3,
    }
    data = small(**per_pose, X_MB_nominal=np.diag([1.0, 2, 3, 1]), source="f.csv", sha256="ab")
    part = data.subset(rows)
    for name in ("q_rad", "p_ME", *per_pose):
        np.testing.assert_array_equal(getattr(part, name), getattr(data, name)[rows], err_msg=name)
    assert part.X_MB_nominal is data.X_MB_nominal
    assert (part.source, part.sha256) == ("f.csv", "ab")


def test_a_subset_of_columns_that_are_not_there_has_none_either():
    part = small().subset(np.array([1, 2]))
    assert part.R_ME is None
    assert part.pose_id is None


def test_folds_share_out_every_row_once_in_parts_of_nearly_equal_size():
    folds = small().folds(5)
    assert sorted(np.concatenate(folds)) == list(range(12))
    assert sorted(map(len, folds)) == [2, 2, 2, 3, 3]


def test_folds_are_the_same_for_the_same_seed_and_others_for_another():
    first, again, other = (np.concatenate(small().folds(3, seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_visits_of_one_pose_stay_in_one_fold():
    data = small(pose_id=np.array([10, 10, 10, 3, 3, 7, 7, 7, 7, 99, 5, 5]))
    folds = data.folds(3)
    assert sorted(np.concatenate(folds)) == list(range(12))
    for k, fold in enumerate(folds):
        for other in folds[k + 1 :]:
            assert not set(data.pose_id[fold]) & set(data.pose_id[other])


def test_a_position_that_no_tracker_reaches_is_refused(refusal, sheet):
    error = refusal(sheet.set("x_mm", 3, "1e300"))
    assert place(error) == ("no tracker measures so far", 3, "x_mm")
