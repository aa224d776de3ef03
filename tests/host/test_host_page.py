"""The preview of a plugin as a page: the one of the command line, of the host's tool, where the host's arm is."""

import base64
import json
import re

import numpy as np
import pytest
import umsgpack
from command import run
from foreign_host import CORNERS, X_WM, path
from pydrake.trajectories import PiecewisePolynomial
from truepath.correct import CorrectionError
from truepath.errors import InputError
from truepath.host import CalibrationPlugin
from truepath.plants import models_dir
from truepath.rewriting.options import RewriteOptions


def data_of(page):
    """What the page shows, as its own script reads it."""
    text = page.read_text(encoding="utf-8")
    return json.loads(re.search(r'<script type="application/json" id="scene-data">(.*?)</script>', text)[1])


def points_of(view):
    return np.frombuffer(base64.b64decode(view["base64"]), "<f4").reshape(-1, 3)


def transforms_of(page):
    """``(4, 4)`` of each node of the scene, in the one above it, by the last of its names."""
    data, found = data_of(page), {}
    chunks = [base64.b64decode(chunk) for chunk in data["chunks"]]
    for parts in data["commands"]:
        command = umsgpack.unpackb(b"".join(chunks[k] for k in parts))
        if command["type"] == "set_transform":
            found[command["path"].split("/")[-1]] = np.reshape(command["matrix"], (4, 4)).T
    return found


def numbers_of(page):
    """The errors that the panel tells: today, and to be expected with the correction."""
    return re.findall(r'<td class="number">([^<]+)</td>', page.read_text(encoding="utf-8"))


def told_numbers(summary, calibration):
    """What should stand there: predictions for today; errors on poses kept away where the data reached."""
    today, held_out = summary.uncorrected_mm, calibration.heldout.calibrated.position_mm
    known = summary.outside_region < summary.waypoints
    expected = [f"{held_out.mean:.3f}", f"{held_out.max:.3f}"] if known else ["not known"] * 2
    return [f"{today.mean:.3f}", f"{today.max:.3f}", *expected]


def nearest_m(points, wanted):
    """``(N,)`` how far the nearest of the points is from each of those wanted ``(N, 3)``."""
    return np.linalg.norm(points[None] - wanted[:, None], axis=2).min(axis=1)


@pytest.fixture(scope="module")
def weld(tmp_path_factory):
    """The example, which no longer says that it is for an arm that is called UR5: this one has another name."""
    file = tmp_path_factory.mktemp("program") / "weld.script"
    file.write_text((models_dir() / "ur5" / "weld.script").read_text().replace("# Robot: UR5,", "# One robot,"))
    return file


@pytest.fixture(scope="module")
def by_plugin(rigid, weld, tmp_path_factory):
    page = tmp_path_factory.mktemp("page") / "plugin.html"
    return page, rigid.preview(weld, output=page, robot_source="ur5")


def test_the_page_of_a_program_is_that_of_the_command_line(by_plugin, rigid, weld, tmp_path, monkeypatch, capsys):
    """Same numbers, lines, statements and title; only of collisions one knows more than the other."""
    rigid.save(tmp_path / "robot.json")
    by_command = tmp_path / "command.html"
    preview = ("preview", weld, "--calibration", tmp_path / "robot.json", "--robot", "ur5", "-o", by_command)
    done = run(monkeypatch, capsys, *preview)
    assert done.code == 0, done.err
    page, summary = by_plugin
    assert numbers_of(page) == numbers_of(by_command)
    assert numbers_of(page) == told_numbers(summary, rigid.calibration)
    one, other = data_of(page), data_of(by_command)
    for part in ("lines", "labels", "waypoints", "frames", "views"):
        assert one[part] == other[part]
    assert summary.waypoints == len(one["labels"]) == 16  # targets, as correct and deploy count them
    assert f"mean {summary.uncorrected_mm.mean:.3f} mm, max {summary.uncorrected_mm.max:.3f} mm before" in done.out
    assert f"to be expected on the robot with the correction: {summary.expected.source}" in done.out
    assert "16 of 16 targets corrected" in done.out
    text = page.read_text(encoding="utf-8")
    assert "<title>weld.script</title>" in text
    assert "the tool that the program states" in text


def test_live_and_on_the_page_the_errors_are_the_same(by_plugin, weld, host):
    _, summary = by_plugin
    shown = host.plugin.preview(weld)
    host.plugin.remove()
    for live, written in ((shown.real_mm, summary.uncorrected_mm), (shown.corrected_mm, summary.corrected_mm)):
        assert live.mean == pytest.approx(written.mean, abs=1e-9)
        assert live.max == pytest.approx(written.max, abs=1e-9)
    assert shown.magnification == summary.magnification
    assert len(shown.view.course.shown.waypoint) == summary.waypoints


def test_the_tool_is_the_hosts_and_stands_in_the_hosts_world(rigid, drawn, tmp_path):
    q, page = path(3), tmp_path / "tool.html"
    rigid.preview(q, output=page, robot_source="ur5")
    points = points_of(data_of(page)["views"]["path"])
    assert nearest_m(points, drawn.poses(q)[:, :3, 3]).max() < 1e-5
    transforms = transforms_of(page)
    assert np.linalg.norm(transforms["truepath"][:3, 3] - X_WM.translation()) < 5e-3  # the real base is a little off
    grid = transforms["truepath"] @ transforms["floor"]
    assert np.abs(grid[:3, :3] - np.eye(3)).max() < 1e-6  # level, though the base is askew
    assert grid[2, 3] < drawn.poses(q)[:, 2, 3].min() + 1e-6  # this arm hangs
    assert "the tool frame &#39;tcp&#39;" in page.read_text(encoding="utf-8")
    assert "at (900, -600, 1400) mm in the world" in page.read_text(encoding="utf-8")


def test_without_a_tool_frame_it_is_the_flange(rigid, plant, drawn, tmp_path):
    plain, q, page = CalibrationPlugin(plant, model_instance="right::ur5"), path(3), tmp_path / "flange.html"
    plain.use(rigid.calibration)
    plain.preview(q, output=page, robot_source="ur5")
    points = points_of(data_of(page)["views"]["path"])
    assert nearest_m(points, drawn.poses(q, drawn.flange)[:, :3, 3]).max() < 1e-5
    assert nearest_m(points, drawn.poses(q)[:, :3, 3]).min() > 0.01


def test_joints_and_trajectories_have_pages_too(rigid, tmp_path):
    joints = rigid.preview(path(10), output=tmp_path / "path.html", robot_source="ur5", magnification="auto")
    assert joints.waypoints == 10
    assert joints.magnification in (10, 20, 50, 100, 200)
    trajectory = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, len(CORNERS)), CORNERS.T, True)
    rigid.preview(trajectory, output=tmp_path / "trajectory.html", robot_source="ur5")
    labels = data_of(tmp_path / "trajectory.html")["labels"]
    assert labels[0] == "0.00 s"
    assert labels[-1] == "4.00 s"


def test_options_are_heeded(rigid, weld, tmp_path):
    with pytest.raises(CorrectionError, match=r"0\.1 mm"):
        rigid.preview(
            weld, options=RewriteOptions(max_correction_mm=0.1), output=tmp_path / "p.html", robot_source="ur5"
        )
    assert list(tmp_path.iterdir()) == []


def test_what_stays_as_it_is_is_among_the_warnings(rigid, tmp_path):
    script = tmp_path / "p.script"
    first, last = (", ".join(f"{angle:.6f}" for angle in q) for q in path(12)[[0, -1]])
    script.write_text(f"def p():\n  movej([{first}])\n  movel(get_target_from_plc())\n  movej([{last}])\nend\n")
    rigid.preview(script, output=tmp_path / "p.html", robot_source="ur5")
    assert "line 3 stays as it is: " in (tmp_path / "p.html").read_text(encoding="utf-8")


def test_a_page_needs_shapes_from_somewhere(rigid, plant, tmp_path):
    with pytest.raises(InputError, match="shapes"):
        rigid.preview(path(3), output=tmp_path / "none.html")
    assert not (tmp_path / "none.html").exists()
    calibration = rigid.calibration
    named = CalibrationPlugin(plant, model_instance="right::ur5", tool_frame="tcp")
    robot = calibration.robot.model_copy(update={"source": "ur5"})
    named.use(calibration.model_copy(update={"robot": robot}))
    assert named.preview(path(3), output=tmp_path / "named.html").waypoints == 3
