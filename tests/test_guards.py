"""Findings, their short form, and what is held against a calibration."""

import json
from datetime import date

import numpy as np
import pytest
from report.by_hand import calibration_by_hand
from truepath.guards import Finding, calibration_findings, condense
from truepath.measurements import Measurements

TODAY = date(2026, 11, 22)


@pytest.fixture(scope="module")
def calibration(ur5):
    q = np.random.default_rng(0).normal(size=(20, 6))
    measured = Measurements(q_rad=q, p_ME=np.zeros((20, 3)), source="by hand")
    return calibration_by_hand(ur5, measured, np.eye(4), np.zeros(20, bool))


def made(calibration, created_utc):
    return calibration.model_copy(update={"created_utc": created_utc})


def test_a_finding_is_plain_json():
    finding = Finding("error", "joint-speed", 12, "too fast", np.float64(3.5), 3.14, "rad/s")
    assert json.loads(json.dumps(finding.to_json(), allow_nan=False)) == {
        "level": "error",
        "guard": "joint-speed",
        "line": 12,
        "message": "too fast",
        "value": 3.5,
        "limit": 3.14,
        "unit": "rad/s",
    }
    bare = Finding("warning", "clearance", None, "far", float("inf"), float("nan"))
    assert json.loads(json.dumps(bare.to_json(), allow_nan=False))["value"] is None


def test_many_findings_become_one_line_for_each_guard():
    findings = [
        Finding("warning", "clearance", 40, "9 mm", 9.0, 10.0, "mm"),
        Finding("warning", "clearance", 30, "2 mm", 2.0, 10.0, "mm"),
        Finding("error", "collision", 8, "1 mm deep", -1.0, 0.0, "mm"),
        Finding("error", "collision", 9, "4 mm deep", -4.0, 0.0, "mm"),
        Finding("error", "collision", 7, "3 mm deep", -3.0, 0.0, "mm"),
        Finding("warning", "collision", 5, "meant", -9.0, 0.0, "mm"),
        Finding("warning", "robot", None, "another robot"),
    ]
    assert condense(findings) == [
        "error: collision: 3 times, first in line 7, worst in line 9: 4 mm deep",
        "warning: clearance: 2 times, first in line 30, worst in line 30: 2 mm",
        "warning: collision in line 5: meant",
        "warning: robot: another robot",
    ]
    assert condense([]) == []


def test_the_worst_is_measured_against_its_own_limit():
    fast = Finding("error", "joint-speed", 1, "shoulder", 2.4, 2.0, "rad/s")
    faster = Finding("error", "joint-speed", 2, "wrist", 3.3, 3.0, "rad/s")
    assert condense([faster, fast])[0].endswith("worst in line 1: shoulder")


def test_findings_without_figures_or_lines_are_counted():
    both = [Finding("warning", "outside", None, "one"), Finding("warning", "outside", None, "two")]
    assert condense(both) == ["warning: outside: 2 times, worst: one"]


@pytest.mark.parametrize("name", [None, "ur5", "UR5", "UR-5", "Ur 5", "u_r5"])
def test_a_robot_by_its_name(calibration, name):
    fresh = made(calibration, "2026-11-01T00:00:00+00:00")
    assert calibration_findings(fresh, name, TODAY) == []


@pytest.mark.parametrize("name", ["ur5e", "ur10", "", "ur"])
def test_another_robot_is_an_error(calibration, name):
    (finding,) = calibration_findings(made(calibration, "2026-11-01T00:00:00+00:00"), name, TODAY)
    assert (finding.level, finding.guard, finding.line) == ("error", "robot", None)
    assert repr(name) in finding.message
    assert "'ur5'" in finding.message


@pytest.mark.parametrize(("called", "level"), [("right::ur5", None), ("left::ur10", "error"), ("welder", "warning")])
def test_in_a_host_a_robot_may_have_a_scope_or_any_name(calibration, called, level):
    dated = made(calibration, "2026-11-01T00:00:00+00:00")
    renamed = dated.model_copy(update={"robot": dated.robot.model_copy(update={"name": called})})
    found = calibration_findings(renamed, "UR5", TODAY)
    assert [finding.level for finding in found] == ([] if level is None else [level])


@pytest.mark.parametrize(
    ("created", "age"),
    [
        ("2025-11-22T08:15:00+00:00", None),  # 365 days
        ("2025-11-21T23:59:59+00:00", 366),
        ("2025-11-22T01:00:00+02:00", 366),  # in UTC that was the day before
        ("2025-11-21", 366),
        ("2026-11-22T23:00:00+00:00", None),
        ("2026-11-23T01:00:00+00:00", None),  # clocks
        ("2026-11-24T01:00:00+00:00", -2),
    ],
)
def test_the_age_of_a_calibration(calibration, created, age):
    findings = calibration_findings(made(calibration, created), None, TODAY)
    assert [finding.value for finding in findings] == ([] if age is None else [age])
    assert all((finding.level, finding.guard) == ("warning", "calibration-age") for finding in findings)


def test_the_age_that_is_allowed_is_the_callers(calibration):
    old = made(calibration, "2026-11-01T00:00:00+00:00")
    assert calibration_findings(old, None, TODAY, max_age_days=21) == []
    (finding,) = calibration_findings(old, None, TODAY, max_age_days=20)
    assert (finding.value, finding.limit, finding.unit) == (21, 20, "days")


@pytest.mark.parametrize("created", ["", "yesterday", "0001-01-01T00:00:00+05:00", "2026-13-01"])
def test_a_calibration_without_a_readable_date_is_told(calibration, created):
    (finding,) = calibration_findings(made(calibration, created), None, TODAY)
    assert finding.level == "warning"
    assert "does not say when it was made" in finding.message
