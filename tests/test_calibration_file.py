"""The calibration file: what is saved comes back to the last bit, and whatever else stands there is refused."""

import hashlib
import json
import os
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from truepath.calibration import load_calibration
from truepath.errors import InputError
from truepath.learn import learn
from truepath.measurements import Measurements
from truepath.plants import load_robot, models_dir
from truepath.poe import flange_poses, parameter_names


def learnt(robot, has_orientation):
    """A calibration of a robot that deviates, is soft and has uneven gears, from noisy poses with two gross errors."""
    rng = np.random.default_rng(11)
    q = rng.uniform(-2, 2, (75, robot.num_joints))
    phi = q + 3e-5 * robot.gravity_torque(q) + 5e-4 * np.cos(2 * q)
    X_MB, X_FE = np.eye(4), np.eye(4)
    X_MB[:3, :3], X_MB[:3, 3] = Rotation.from_rotvec([0.1, 2, -0.5]).as_matrix(), [2.0, -1.0, 0.3]
    X_FE[:3, :3], X_FE[:3, 3] = Rotation.from_rotvec([0.3, 0, 1]).as_matrix(), [0.05, -0.02, 0.1]
    X = X_MB @ flange_poses(robot, 1e-3 * rng.normal(size=4 * robot.num_joints + 12), phi) @ X_FE
    p_ME = X[:, :3, 3] + 2e-5 * rng.normal(size=(75, 3))
    p_ME[[7, 30]] += 0.2
    turn = Rotation.from_rotvec(1e-4 * rng.normal(size=(75, 3))).as_matrix()
    data = Measurements(q_rad=q, p_ME=p_ME, R_ME=turn @ X[:, :3, :3] if has_orientation else None)
    return learn(robot, data, effects=("transmission_error", "joint_compliance"), source="a test")[:2]


@pytest.fixture(scope="module")
def fit_and_calibration(ur5):
    calibration, fit = learnt(ur5, has_orientation=False)
    return fit, calibration


@pytest.fixture(scope="module")
def calibration(fit_and_calibration):
    return fit_and_calibration[1]


@pytest.fixture(scope="module")
def text(calibration):
    return calibration.to_json()


@pytest.fixture
def file(tmp_path):
    """Writes text, bytes or an object to a file and returns its path."""

    def file(content):
        path = tmp_path / "calibration.json"
        if isinstance(content, dict):
            content = json.dumps(content)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return file


@pytest.fixture
def refusal(file):
    def refusal(content, robot=None) -> InputError:
        path = file(content)
        with pytest.raises(InputError) as caught:
            load_calibration(path, robot)
        assert str(path) in str(caught.value)
        return caught.value

    return refusal


def signed(content: dict) -> dict:
    """The content with a checksum that fits, as somebody would write it who knows how."""
    content = {name: part for name, part in content.items() if name != "checksum"}
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return {**content, "checksum": hashlib.sha256(canonical.encode()).hexdigest()}


def changed(text, *path_and_value):
    """The content with one entry replaced, and signed again."""
    *path, last, value = path_and_value
    content = json.loads(text)
    part = content
    for key in path:
        part = part[key]
    part[last] = value
    return signed(content)


# Saved and loaded


def test_what_was_saved_is_loaded_and_saved_again_to_the_last_byte(calibration, tmp_path):
    path, again = tmp_path / "a.json", tmp_path / "b.json"
    calibration.save(path)
    loaded = load_calibration(path)
    loaded.save(again)
    assert loaded == calibration
    assert again.read_bytes() == path.read_bytes() == calibration.to_json().encode()


@pytest.mark.parametrize("arm", ["ur5 in 3D", "seven joints in 6D"])
def test_a_loaded_calibration_predicts_to_the_last_bit_what_the_fit_did(arm, fit_and_calibration, ur5, seven, tmp_path):
    robot = {"ur5 in 3D": ur5}.get(arm, seven)
    calibration, fit = learnt(seven, has_orientation=True) if robot is seven else fit_and_calibration[::-1]
    calibration.save(tmp_path / "c.json")
    model = load_calibration(tmp_path / "c.json", robot).model
    q = np.random.default_rng(1).uniform(-2, 2, (20, robot.num_joints))
    assert model.effects
    for method in ("predict", "predict_nominal", "flange_poses"):
        np.testing.assert_array_equal(getattr(model, method)(q), getattr(fit.model, method)(q), err_msg=method)
    np.testing.assert_array_equal(model.robot.gravity_torque(q), robot.gravity_torque(q))
    for attribute in ("lower_rad", "upper_rad", "velocity_rad_s", "acceleration_rad_s2", "X_WB", "X_BF", "X_BA"):
        np.testing.assert_array_equal(getattr(model.robot, attribute), getattr(robot, attribute), err_msg=attribute)
    assert (model.robot.name, model.robot.joint_names) == (robot.name, robot.joint_names)


def test_the_file_says_of_every_parameter_what_it_is_and_why_it_is_held(fit_and_calibration, text):
    fit, _ = fit_and_calibration
    content = json.loads(text)["parameters"][:36]
    assert [p["name"] for p in content] == [str(name) for name in parameter_names(6)]
    held = [i for i, p in enumerate(content) if p["status"] == "held"]
    assert held == sorted(fit.held)
    assert held
    for i, parameter in enumerate(content):
        assert (parameter["reason"] is not None) == (i in held)
        assert parameter["sigma"] == fit.sigma[i]
        if i in held:
            assert (parameter["value"], parameter["sigma"]) == (0, 0)


def test_the_file_says_where_it_comes_from(text):
    content = json.loads(text)
    assert content["schema"] == "truepath.calibration/1"
    assert {"python", "truepath", "drake", "numpy"} <= set(content["software"])
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", content["created_utc"])
    assert content["data"]["poses"] == 75
    assert content["data"]["outlier_lines"] == [9, 32]
    assert {effect["name"] for effect in content["effects"]} == {"transmission_error", "joint_compliance"}
    assert re.fullmatch("[0-9a-f]{64}", content["data"]["sha256"])


def test_the_file_is_plain_json_without_nan_and_ends_with_its_checksum(text):
    content = json.loads(text, parse_constant=pytest.fail)
    assert list(content)[-1] == "checksum"
    assert signed(content)["checksum"] == content["checksum"]
    assert text.endswith("}\n")


def test_a_file_that_was_only_formatted_anew_is_still_good(calibration, text, file):
    assert load_calibration(file(json.dumps(json.loads(text)))) == calibration
    assert load_calibration(file(json.dumps(json.loads(text), indent=4, sort_keys=True) + "\n\n")) == calibration


def test_limits_that_a_robot_does_not_have_come_back_as_infinite(text, file):
    content = changed(text, "robot", "upper_rad", [None] * 6)
    assert np.isposinf(load_calibration(file(content)).model.robot.upper_rad).all()


# The right robot


def test_the_robot_for_which_it_was_learnt_is_accepted_wherever_it_stands(text, file, ur5):
    load_calibration(file(text), ur5)
    load_calibration(file(text), load_robot(models_dir() / "ur5" / "cell.dmd.yaml"))


@pytest.mark.parametrize("other", ["ur10", "seven"])
def test_another_robot_is_refused_and_both_are_named(text, refusal, request, other):
    error = refusal(text, request.getfixturevalue(other))
    assert error.problem == "the calibration belongs to another robot"
    assert other in error.expected
    assert "ur5" in error.found


# Other files


@pytest.mark.parametrize("schema", ["truepath.calibration/2", "truepath.calibration/10"])
def test_a_newer_schema_is_refused_with_the_advice_to_update(text, refusal, schema):
    error = refusal(changed(text, "schema", schema))
    assert error.problem == "the calibration was written by another version of truepath"
    assert schema in error.found
    assert "update truepath" in error.found


@pytest.mark.parametrize("schema", ["truepath.diagnosis/1", "", None, 1, ["truepath.calibration/1"], {"a": 1}])
def test_json_of_another_kind_is_refused(text, refusal, schema):
    error = refusal(changed(text, "schema", schema))
    assert error.problem == "this is no calibration file"
    assert "truepath.calibration/1" in error.expected


@pytest.mark.parametrize("content", ["{}", "[]", "1", "null", '"truepath.calibration/1"'])
def test_json_without_a_schema_is_refused(refusal, content):
    assert refusal(content).problem == "this is no calibration file"


def test_no_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read") as caught:
        load_calibration(tmp_path / "nowhere.json")
    assert "No such file" in caught.value.found


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read") as caught:
        load_calibration(tmp_path)
    assert "directory" in caught.value.found


def test_a_name_longer_than_the_system_allows_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_calibration(tmp_path / ("x" * 5000))


def test_a_file_that_is_far_too_large_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "huge.json"
    with path.open("wb") as file:
        file.truncate((256 << 20) + 1)  # sparse: takes no room
    with pytest.raises(InputError, match="too large"):
        load_calibration(path)


@pytest.mark.parametrize("content", [b"\xff\xfe{", b'{"schema": "\xe9"}'])
def test_a_file_that_is_not_utf8_is_refused(refusal, content):
    assert "not UTF-8" in refusal(content).found


@pytest.mark.parametrize("content", [b"", b"\n", b"\xef\xbb\xbf{}", b"{", b"{'schema': 1}", b"\x00" * 50])
def test_what_is_no_json_is_refused(refusal, content):
    assert refusal(content).problem == "the calibration is cut off or no JSON"


@pytest.mark.parametrize("opening", ["[", '{"schema":'])
def test_huge_nesting_is_refused(refusal, opening):
    assert refusal(opening * 200_000).problem == "the calibration is cut off or no JSON"


@pytest.mark.parametrize("depth", [50, 300, 600, 900, 950, 990, 5000])
@pytest.mark.parametrize("where", ["schema", "robot", "checksum", "unheard_of"])
def test_nesting_of_any_depth_in_any_place_is_refused(text, refusal, depth, where):
    content = json.loads(text)
    content[where] = "@"
    refusal(json.dumps(content).replace('"@"', "[" * depth + "]" * depth))


def test_a_number_of_thousands_of_digits_is_refused(text, refusal):
    refusal(text.replace('"poses": 75', '"poses": ' + "6" * 5000))


# Spoilt files


def test_a_file_cut_off_anywhere_is_refused(text, file):
    whole = text.encode()
    cuts = [*range(0, len(whole) - 100, 13), *range(len(whole) - 100, len(whole) - 1)]  # the last byte is a newline
    for cut in cuts:
        with pytest.raises(InputError, match="cut off or no JSON"):
            load_calibration(file(whole[:cut]))


def test_without_its_last_line_break_the_file_is_whole(calibration, text, file):
    assert load_calibration(file(text[:-1])) == calibration


def test_any_single_changed_digit_is_refused_unless_the_number_stays_the_same(calibration, text, file):
    digits = [match.start() for match in re.finditer(r"\d", text)]
    rng = np.random.default_rng(0)
    tried, harmless = rng.permutation(digits)[:600], 0
    for at in tried:
        other = rng.choice([d for d in "0123456789" if d != text[at]])
        path = file(text[:at] + other + text[at + 1 :])
        try:
            loaded = load_calibration(path)
        except InputError:
            continue
        # The 17th digit of a number may be another and the number the same to the last bit.
        assert loaded == calibration
        harmless += 1
    assert harmless < 0.05 * len(tried)


@pytest.mark.parametrize(
    "path",
    [("parameters", 5, "value"), ("robot", "axes", 2, "translation_m", 0), ("base", "estimated", "translation_m", 1)],
    ids=str,
)
def test_a_changed_value_is_told_as_tampering(text, refusal, path):
    content = json.loads(text)
    part = content
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] += 1e-9
    error = refusal(content)
    assert error.problem == "the calibration was changed after truepath wrote it"
    assert error.found == "another one"


def test_a_file_without_its_checksum_is_refused(text, refusal):
    content = json.loads(text)
    del content["checksum"]
    error = refusal(content)
    assert (error.problem, error.found) == ("the calibration was changed after truepath wrote it", "no checksum")


@pytest.mark.parametrize("checksum", ["", "0" * 64, None, 5, [], {}])
def test_a_file_with_a_wrong_checksum_is_refused(text, refusal, checksum):
    assert "changed after" in refusal({**json.loads(text), "checksum": checksum}).problem


def test_a_name_that_appears_twice_in_one_object_is_refused(text, refusal):
    """Readers differ in which of the two they take, and the checksum would see but one."""
    error = refusal(text.replace('"value":', '"value": 0.25, "value":', 1))
    assert "appears twice" in error.found


@settings(max_examples=150)
@given(data=st.data())
def test_a_spoilt_file_is_refused_or_says_the_same(tmp_path_factory, calibration, text, spoilt, data):
    path = tmp_path_factory.getbasetemp() / "spoilt.json"
    path.write_bytes(data.draw(spoilt(text.encode())))
    try:
        loaded = load_calibration(path)
    except InputError:
        return
    assert loaded == calibration


# Files that carry the right checksum and are wrong all the same

NOT_A_ROTATION = {
    "scaled": [[1.001, 0, 0], [0, 1.001, 0], [0, 0, 1.001]],
    "sheared": [[1, 1e-6, 0], [0, 1, 0], [0, 0, 1]],
    "mirrored": [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
    "zero": [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
    "huge": [[1e200, 1e200, 0], [-1e200, 1e200, 0], [0, 0, 1]],
}


@pytest.mark.parametrize("matrix", NOT_A_ROTATION)
@pytest.mark.parametrize("frame", [("base", "estimated"), ("tool", "nominal"), ("robot", "zero_pose")], ids=str)
def test_a_matrix_that_is_no_rotation_is_refused(text, refusal, frame, matrix):
    error = refusal(changed(text, *frame, "rotation", NOT_A_ROTATION[matrix]))
    assert "the matrix is no rotation" in error.problem
    assert ".".join(frame) in error.problem


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")], ids=str)
@pytest.mark.parametrize(
    "path",
    [
        ("parameters", 0, "value"),
        ("parameters", 0, "sigma"),
        ("robot", "lower_rad", 2),
        ("robot", "axes", 1, "rotation", 0, 0),
        ("tool", "estimated", "translation_m", 2),
        ("region", "whitening", 3, 3),
        ("region", "radius"),
        ("effects", 0, "parameters", 0, "value"),
        ("effects", 0, "constants", "lower_rad"),
        ("data", "payload_kg"),
        ("noise", "position_mm"),
        ("heldout", "calibrated", "position_mm", "mean"),
    ],
    ids=str,
)
def test_a_number_that_is_not_finite_is_refused_and_its_place_told(text, refusal, path, value):
    error = refusal(changed(text, *path, value))
    assert error.problem.startswith("the calibration is not valid at " + ".".join(map(str, path)) + ":")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("parameters", 3, "value"), "0.001"),
        (("parameters", 3, "value"), None),
        (("parameters", 3, "value"), True),
        (("parameters", 3, "sigma"), -1e-9),
        (("parameters", 3, "status"), "guessed"),
        (("parameters", 3, "unit"), "mm"),
        (("parameters", 3, "joint"), 2),
        (("parameters", 3, "name"), "axis1.rot_z"),
        (("region", "radius"), 0),
        (("data", "poses"), 0),
        (("data", "poses"), 75.5),
        (("data", "outlier_lines"), [1.5]),
        (("base", "nominal_source"), "somewhere"),
        (("robot", "joint_names"), ["a", "b"]),
        (("robot", "joint_names", 0), "another"),
        (("robot", "model_sha256"), "0" * 64),
        (("robot", "axes", 3, "translation_m", 0), 0.5),
        (("robot", "zero_pose", "translation_m", 0), 0.5),
        (("software",), ["python"]),
        (("effects", 0, "name"), "witchcraft"),
        (("effects", 0, "joint"), 0),
        (("effects", 0, "joint"), 7),
        (("effects", 0, "moves"), "the earth"),
        (("effects", 0, "inputs"), ["mood"]),
        (("effects", 0, "constants", "lower_rad"), 9),
        (("effects", 0, "parameters"), []),
        (("effects", 0, "parameters", 0, "name"), "square-wave 3"),
        (("effects", 0, "parameters", 0, "sigma"), -1),
    ],
    ids=str,
)
def test_a_value_that_does_not_belong_there_is_refused(text, refusal, path, value):
    assert refusal(changed(text, *path, value)).problem.startswith("the calibration is not valid at ")


LISTS = [
    ("parameters",),
    ("robot", "axes"),
    ("robot", "lower_rad"),
    ("robot", "upper_rad"),
    ("robot", "velocity_rad_s"),
    ("robot", "acceleration_rad_s2"),
    ("robot", "link_mass_kg"),
    ("robot", "link_centre_m"),
    ("robot", "link_centre_m", 0),
    ("robot", "gravity_m_s2"),
    ("base", "estimated", "translation_m"),
    ("base", "estimated", "rotation"),
    ("base", "estimated", "rotation", 1),
    ("region", "lower_rad"),
    ("region", "upper_rad"),
    ("region", "mean_rad"),
    ("region", "whitening"),
    ("region", "whitening", 2),
]


@pytest.mark.parametrize("change", ["shorter", "longer", "empty"])
@pytest.mark.parametrize("path", LISTS, ids=str)
def test_a_list_of_the_wrong_length_is_refused(text, refusal, path, change):
    part = json.loads(text)
    for key in path:
        part = part[key]
    value = {"shorter": part[:-1], "longer": [*part, part[-1]], "empty": []}[change]
    assert refusal(changed(text, *path, value)).problem.startswith("the calibration is not valid at ")


OBJECTS = [
    (),
    ("robot",),
    ("base",),
    ("base", "nominal"),
    ("parameters", 0),
    ("region",),
    ("noise",),
    ("data",),
    ("effects", 0),
]


@pytest.mark.parametrize("where", OBJECTS, ids=str)
def test_an_extra_field_is_refused_by_name(text, refusal, where):
    assert "surprise" in refusal(changed(text, *where, "surprise", 1)).problem


def test_each_missing_part_is_refused_by_name(text, refusal):
    parts = [name for name in json.loads(text) if name not in ("schema", "checksum", "residual")]
    assert len(parts) >= 9
    for name in parts:
        content = json.loads(text)
        del content[name]
        assert refusal(signed(content)).problem.startswith(f"the calibration is not valid at {name}:")


def places(part, path=()):
    """Every place in a JSON document."""
    yield path
    entries = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    for key, value in entries:
        yield from places(value, (*path, key))


ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.sampled_from([0, -1, 10**400, 1e308, -1e308, 5e-324, "", "nan", "\ud800", "axis1.pos_x"])
    | st.floats()
    | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=7) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # huge numbers overflow on the way to being refused
@settings(max_examples=150)
@given(data=st.data())
def test_whatever_is_put_in_any_place_of_a_signed_file_it_is_loaded_or_refused(tmp_path_factory, text, data):
    content = json.loads(text)
    where = data.draw(st.sampled_from([place for place in places(content) if place]))
    part = content
    for key in where[:-1]:
        part = part[key]
    if data.draw(st.booleans()):
        part[where[-1]] = data.draw(ANYTHING)
    else:
        del part[where[-1]]
    path = tmp_path_factory.getbasetemp() / "signed.json"
    path.write_text(json.dumps(signed(content)))
    try:
        loaded = load_calibration(path)
    except InputError:
        return
    assert loaded.model.predict(np.zeros((1, 6))).shape == (1, 4, 4)


# Saving


def test_saving_replaces_an_old_file_and_leaves_nothing_beside_it(calibration, text, file):
    path = file("old")
    calibration.save(path)
    assert path.read_text() == text
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_saving_that_fails_leaves_the_old_calibration_in_force(calibration, text, file, monkeypatch):
    path = file(text)
    other = calibration.model_copy(update={"created_utc": "2000-01-01T00:00:00+00:00"})

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left"):
        other.save(path)
    assert load_calibration(path) == calibration
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_a_calibration_with_a_number_that_is_not_finite_cannot_be_saved(calibration, text, file):
    path = file(text)
    noise = calibration.noise.model_copy(update={"position_mm": float("nan")})
    with pytest.raises(ValueError, match="JSON compliant"):
        calibration.model_copy(update={"noise": noise}).save(path)
    assert load_calibration(path) == calibration
