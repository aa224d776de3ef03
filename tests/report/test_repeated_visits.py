"""Where poses were visited again, the report and the JSON count poses, and judge each at its barycentre."""

from dataclasses import replace

import made_up
import numpy as np
import pytest
from reading import text_of
from truepath.report.drawn import Drawn
from truepath.report.page import render

POSE = np.arange(120) // 3 * 10  # 40 poses, three times each
UNSEEN = np.isin(POSE, (0, 50, 390))
LEFT_OUT = np.isin(np.arange(120), (4, 15))  # one visit of a pose that was seen, one of a pose that was not


@pytest.fixture(scope="module")
def repeated():
    single = made_up.rich(120)
    measurements = replace(single.measurements, pose_id=POSE)
    return replace(single, measurements=measurements, unseen=UNSEEN, outlier=LEFT_OUT)


def test_the_json_counts_poses_and_rows(repeated):
    data = repeated.to_dict()["data"]
    assert (data["rows"], data["poses"], data["unseen_poses"]) == (120, 40, 3)
    assert data["outliers"] == [5, 16]


def test_the_page_counts_poses_and_says_how_many_readings_there_are(repeated):
    page = render(repeated)
    assert "3 of 40 poses took part neither in the fit" in text_of(page, "accuracy")
    assert "40 poses in 120 readings, position (3D)" in text_of(page, "data")
    assert "37 poses to fit and choose, 3 kept away to check, 2 rows left out" in text_of(page, "data")
    assert "half of the unseen readings within" in text_of(page, "residuals")
    assert "118 readings" in text_of(page, "residuals")


def test_without_repeats_it_speaks_of_poses_only(rich_page):
    assert "200 poses, position (3D)" in text_of(rich_page, "data")
    assert "reading" not in text_of(rich_page, "residuals").replace("first reading", "")


def test_the_distribution_is_that_of_the_poses(repeated):
    drawn = Drawn.of(repeated)
    miss = repeated.residuals["final"]
    visits = (miss[0:3], miss[[16, 17]], miss[117:120])  # of the three unseen poses, without what was left out
    by_hand = [1e3 * np.sqrt(sum(np.mean(part[:, k]) ** 2 for k in range(3))) for part in visits]
    np.testing.assert_allclose(drawn.error_length("final"), by_hand)
