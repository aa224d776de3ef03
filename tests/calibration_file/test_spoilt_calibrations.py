"""A file that is no calibration, is cut off, damaged or changed by hand is refused."""

import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from signed_content import changed
from truepath.calibration import load_calibration
from truepath.errors import InputError

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
    refused = refusal(content)
    assert refused.problem == "the calibration is cut off or no JSON"
    assert "truepath calibrate" in refused.expected


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
