"""Where the neural residual of a calibration is faded, the page shows it; without one it says nothing of it."""

import re

import numpy as np
import pytest
from hand_made_networks import residual_about
from opened_page import OpenPage
from truepath.calibration import Calibration
from truepath.calibration_residual import ResidualPart
from truepath.preview import write_preview
from truepath.residual.proof import Proof


def reddish_purple(picture: np.ndarray) -> int:
    """Pixels in which the colour of faded networks shows through: more red and blue than green."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red - green > 30) & (blue - green > 10)).sum())


@pytest.fixture(scope="module")
def with_networks(calibration, q_programmed):
    """The same calibration with networks that know poses about the first third of the path."""
    residual = residual_about(q_programmed[:44].mean(axis=0), half_width_rad=0.2)
    part = ResidualPart.of(residual, Proof(1e-9, 0.05, 0.04))
    return Calibration.model_validate(calibration.model_dump(by_alias=True) | {"residual": part.model_dump()})


@pytest.fixture(scope="module")
def partly(tmp_path_factory, with_networks, q_programmed, q_corrected):
    file = tmp_path_factory.mktemp("networks") / "p.html"
    return write_preview(file, with_networks, q_programmed, q_corrected, robot_source="ur5")


class TestNetworks:
    """Where the neural residual of a calibration is faded, the page shows it; without one it says nothing of it."""

    def test_faded_waypoints_are_counted(self, partly, with_networks, q_corrected):
        weight = with_networks.model.residual.weight(q_corrected)
        faded, silent = int((weight < 1 - 1e-6).sum()), int((weight < 1e-6).sum())
        assert 0 < silent < faded < 132
        text = partly.output.read_text(encoding="utf-8")
        assert f"networks are faded: {faded} of 132, to nothing at {silent}." in text
        assert partly.networks.faded.sum() == faded

    def test_the_spread_is_told(self, partly):
        spread = partly.networks.spoken_mm
        told = f"Spread of the networks: {spread.mean():.3f} mm (mean), {spread.max():.3f} mm (max)"
        assert told in partly.output.read_text(encoding="utf-8")

    def test_they_are_drawn_in_a_colour_of_their_own_that_can_be_hidden(self, browser, partly):
        page = OpenPage(browser, partly.output)
        page.tab.uncheck("#by-error")  # whose scale passes through purple too
        drawn = reddish_purple(page.scene())
        page.tab.locator("input[data-nodes='path_faded']").uncheck()
        page.wait_for_picture()
        assert drawn > 300
        assert reddish_purple(page.scene()) < 0.1 * drawn
        assert page.complaints == []
        page.tab.close()

    def test_where_they_are_nowhere_faded_nothing_is_drawn(self, tmp_path, with_networks, q_programmed):
        known = np.tile(q_programmed[:44].mean(axis=0), (3, 1))
        summary = write_preview(tmp_path / "p.html", with_networks, known, known, robot_source="ur5")
        text = summary.output.read_text(encoding="utf-8")
        assert "networks are faded: none of 3" in text
        assert "path_faded" not in text

    def test_where_they_are_silent_no_spread_is_told(self, tmp_path, with_networks, q_programmed):
        far = q_programmed + np.array([2.0, 0, 0, 0, 0, 0])
        text = write_preview(tmp_path / "p.html", with_networks, far, far, robot_source="ur5").output.read_text()
        assert "networks are faded: 132 of 132, to nothing at 132" in text
        assert "Spread of" not in text

    def test_without_networks_the_page_says_nothing_of_them(self, page_file):
        text = re.sub(r"<script>.*?</script>|<template>.*?</template>", "", page_file.read_text(), flags=re.DOTALL)
        assert "etworks" not in text
