"""A calibration file that carries the right checksum and is wrong all the same is refused with the place."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from signed_content import changed, signed
from truepath.calibration import load_calibration
from truepath.errors import InputError

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
