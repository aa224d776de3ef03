"""The report says where base and probe were found, and warns of a statement that can hardly be right."""

from dataclasses import replace

import made_up
import pytest
from reading import text_of, tree_of
from truepath.calibration_parts import Pose
from truepath.lie import make_pose
from truepath.report.page import render


@pytest.fixture(scope="module")
def small():
    """A diagnosis of few poses, so that little has to be drawn."""
    return made_up.too_few()


@pytest.fixture
def stated(small):
    """Function: that diagnosis, the probe having been stated at ``x`` mm and found at 0."""

    def make(x_mm):
        nominal = Pose.of(make_pose(translation=[1e-3 * x_mm, 0.0, 0.0]))
        tool = small.calibration.tool.model_copy(update={"nominal": nominal, "nominal_source": "given"})
        return replace(small, calibration=small.calibration.model_copy(update={"tool": tool}))

    return make


def test_places_stand_among_the_parameters(small):
    section = text_of(render(small), "parameters")
    x, y, z = (1e3 * value for value in small.calibration.base.estimated.translation_m)
    assert f"Base found at ({x:.2f}, {y:.2f}, {z:.2f}) mm" in section
    assert section.count("not stated.") == 2


@pytest.mark.parametrize(("x_mm", "is_warned_of"), [(0.5, False), (30.0, True)])
def test_a_probe_that_was_stated_far_off_is_warned_of(stated, x_mm, is_warned_of):
    page = render(stated(x_mm))
    assert f"Probe found at (0.00, 0.00, 0.00) mm on the flange, {x_mm:.2f} mm from where it was stated." in text_of(
        page, "parameters"
    )
    warnings = tree_of(page).xpath("//*[@id='parameters']//p[contains(@class, 'warning')]")
    assert len(warnings) == is_warned_of
