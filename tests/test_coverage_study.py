"""The study of many robots: 95 % intervals hold the truth as often as they say, and its table says so."""

import pytest
from coverage_workflow import study


def test_the_95_percent_intervals_hold_the_truth_of_a_few_robots():
    result = study.run_study(6)
    assert result.complaints() == []
    assert 0.90 <= result.coverage <= 0.99


@pytest.mark.slow
@pytest.mark.parametrize("orientation_noise_mrad", [None, 0.05])
def test_the_95_percent_intervals_hold_the_truth_of_fifty_robots(orientation_noise_mrad):
    result = study.run_study(50, orientation_noise_mrad=orientation_noise_mrad)
    assert result.complaints() == []
    assert 0.90 <= result.coverage <= 0.99


def test_the_study_prints_a_table_and_exits_with_its_verdict(capsys, monkeypatch):
    assert study.main(["--seeds", "2", "--poses", "60"]) in (0, 1)
    assert "coverage" in capsys.readouterr().out
    monkeypatch.setattr(study, "COVERAGE", (0.999, 1.0))
    assert study.main(["--seeds", "2", "--poses", "60"]) == 1
    assert "not as it should be: 95 % intervals hold the truth in" in capsys.readouterr().out
