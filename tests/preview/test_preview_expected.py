"""What the page promises of the real robot: errors of poses that the fit had not seen, never those of the solver."""

import re

import pytest
from truepath.calibration import Calibration
from truepath.errors import InputError
from truepath.preview import write_preview
from truepath.preview.toolpaths import stated_magnification

HERE = [0.0, -1.6, 1.7, -1.65, -1.55, 0.1]
FAR = [2.9, -1.6, 1.7, -1.65, -1.55, 0.1]  # joint 1 was measured up to 1.5 rad


def told(page):
    """Numbers of the table: mean and max without correction, then with it."""
    return re.findall(r'<td class="number">([^<]+)</td>', page.read_text(encoding="utf-8"))


@pytest.fixture
def write(tmp_path, calibration):
    """Function: the page and its summary of joints that are sent as they are programmed."""

    def write(*joints, made_by=calibration):
        q = [[*each] for each in joints]
        return write_preview(tmp_path / "p.html", made_by, q, q, robot_source="ur5")

    return write


def held_out(calibration):
    return calibration.model_dump(by_alias=True)["heldout"]["calibrated"]["position_mm"]


def test_within_the_region_it_is_what_was_measured_on_unseen_poses(write, calibration):
    summary, errors = write(HERE, HERE), held_out(calibration)
    assert told(summary.output)[2:] == [f"{errors['mean']:.3f}", f"{errors['max']:.3f}"]
    assert errors["mean"] > 0.01  # the reflector was measured to 0.03 mm per axis
    text = summary.output.read_text(encoding="utf-8")
    assert f"95 % within {errors['p95']:.3f} mm" in text
    assert f"as on {calibration.heldout.poses} measured poses that the fit had not seen." in text


def test_outside_of_it_nobody_knows(write):
    summary = write(FAR, FAR)
    assert told(summary.output)[2:] == ["not known", "not known"]
    assert "no waypoint lies within the calibrated region" in summary.output.read_text(encoding="utf-8")


def test_where_it_holds_for_a_part_only_that_is_said_beside_the_number(write, calibration):
    summary = write(HERE, FAR, FAR)
    assert told(summary.output)[2] == f"{held_out(calibration)['mean']:.3f}"
    assert "<small>expected, not known at 2 of 3</small>" in summary.output.read_text(encoding="utf-8")


def test_a_calibration_that_held_nothing_back_promises_nothing(write, calibration):
    without = Calibration.model_validate(calibration.model_dump(by_alias=True) | {"heldout": None})
    summary = write(HERE, made_by=without)
    assert told(summary.output)[2:] == ["not known", "not known"]
    assert "too few poses to hold any back" in summary.output.read_text(encoding="utf-8")


def test_a_magnification_is_a_number_or_auto():
    assert stated_magnification("auto") == "auto"
    assert stated_magnification("12.5") == 12.5
    with pytest.raises(InputError, match="or auto") as caught:
        stated_magnification("large")
    assert caught.value.found == "large"
