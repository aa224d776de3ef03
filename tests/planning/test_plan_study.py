"""The study of planned against random poses, small: fifty robots are for the workflow."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "workflows"))
import plan_study


@pytest.mark.slow
def test_planned_poses_leave_a_smaller_tool_error_than_random_ones_of_the_same_test(anywhere):
    result = plan_study.study(
        plan_study.SETTINGS[plan_study.NAMED], 3, candidates=200, fresh_poses=100, everywhere=anywhere
    )
    assert len(result.planned) == len(result.random) == 3
    assert result.lower_by > 0.15
    assert result.expected > 0.15


def test_the_share_is_that_of_the_means_and_its_interval_holds_it():
    result = plan_study.Result([1.0, 1.2, 0.8, 1.0], [2.0, 1.8, 2.2, 2.0], 0.4)
    assert result.lower_by == pytest.approx(0.5)
    low, high = result.interval()
    assert low < 0.5 < high
    assert "50.0%" in plan_study.table({"made up": result})
