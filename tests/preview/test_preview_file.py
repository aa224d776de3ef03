"""What the preview page promises without a browser: it names no address, stays small, and says what is so."""

import re
import subprocess
import sys

import numpy as np
import pytest
from truepath.errors import InputError
from truepath.model import nominal_flange_poses
from truepath.preview import write_preview


class TestTheFile:
    def test_names_no_address(self, page_file):
        """Save the names of XML name spaces and, within the licences, the homes of those who wrote them."""
        text = re.sub(r"<template>.*?</template>", "", page_file.read_text(encoding="utf-8"), flags=re.DOTALL)
        addresses = set(re.findall(r"https?://[\w./-]+", text))
        assert addresses <= {"http://www.w3.org/1999/xhtml", "http://www.w3.org/2000/svg"}

    def test_is_the_same_for_the_same_input(self, tmp_path, calibration, q_programmed, q_corrected):
        for name in ("a.html", "b.html"):
            write_preview(tmp_path / name, calibration, q_programmed, q_corrected, robot_source="ur5")
        assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()

    def test_stays_small_for_long_paths(self, tmp_path, calibration, q_programmed, q_corrected):
        at, known = np.linspace(0, len(q_programmed) - 1, 20_000), np.arange(len(q_programmed))
        long = [np.stack([np.interp(at, known, joint) for joint in q.T], axis=1) for q in (q_programmed, q_corrected)]
        summary = write_preview(tmp_path / "long.html", calibration, *long, robot_source="ur5")
        assert summary.waypoints == 20_000
        assert summary.key_frames <= 2_003
        assert summary.output.stat().st_size < 4e6

    def test_needs_neither_drake_nor_torch(self):
        program = "import sys, truepath.preview; print(sorted({'pydrake', 'torch'} & set(sys.modules)))"
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"


class TestTheSummary:
    def test_agrees_with_the_calibration(self, tmp_path, calibration, q_programmed, q_corrected):
        summary = write_preview(tmp_path / "p.html", calibration, q_programmed, q_corrected, robot_source="ur5")
        model = calibration.model
        goal = model.goal_flange_poses(nominal_flange_poses(model.robot, q_programmed)) @ model.X_FE
        error = (model.flange_poses(q_programmed) @ model.X_FE - goal)[:, :3, 3]
        assert summary.uncorrected_mm.max == pytest.approx(1e3 * np.linalg.norm(error, axis=1).max())
        assert summary.corrected_mm.max < 1e-3
        assert summary.missing_meshes == ()

    def test_counts_waypoints_outside_the_calibrated_region(self, tmp_path, calibration, q_programmed):
        far = q_programmed.copy()
        far[:7, 0] += 2.5
        summary = write_preview(tmp_path / "p.html", calibration, far, far, robot_source="ur5")
        assert summary.outside_region == 7
        assert "7 of 132" in summary.output.read_text(encoding="utf-8")

    def test_chooses_a_round_magnification(self, tmp_path, calibration, q_programmed, q_corrected):
        paths = (q_programmed, q_corrected)
        summary = write_preview(tmp_path / "p.html", calibration, *paths, robot_source="ur5", magnification="auto")
        drawn_m = summary.magnification * summary.uncorrected_mm.p95 / 1e3
        assert summary.magnification in (10, 20, 50, 100, 200)
        assert 0.02 < drawn_m < 0.12

    def test_a_single_waypoint_stands_still(self, tmp_path, calibration, q_programmed, q_corrected):
        one = (q_programmed[:1], q_corrected[:1])
        assert write_preview(tmp_path / "p.html", calibration, *one, robot_source="ur5").key_frames == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(q_corrected=np.zeros((3, 6))), "differ in length"),
        (dict(q_programmed=np.zeros((0, 6)), q_corrected=np.zeros((0, 6))), "one waypoint or more"),
        (dict(q_programmed=np.full((132, 6), np.nan)), "waypoint 1"),
        (dict(q_programmed=np.zeros((132, 7))), "6 joints each"),
        (dict(magnification=0.0), "this scale"),
        (dict(magnification=float("nan")), "this scale"),
        (dict(labels=["one"]), "labels and waypoints"),
        (dict(robot_source="no_such_robot"), "no robot"),
    ],
)
def test_refuses_what_makes_no_sense(tmp_path, calibration, q_programmed, q_corrected, change, message):
    given = dict(q_programmed=q_programmed, q_corrected=q_corrected, robot_source="ur5") | change
    with pytest.raises(InputError, match=message):
        write_preview(tmp_path / "p.html", calibration, **given)
    assert list(tmp_path.iterdir()) == []
