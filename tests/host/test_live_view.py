"""What is drawn into a host's Meshcat. Where the tools must be says Drake, on its own plant."""

import numpy as np
import pytest
from foreign_host import path
from live_host import BELOW, GRIPPER
from truepath.host.asked import Asked
from truepath.host.controls import COLOUR, MAGNIFY, NEXT, PATH, PLAY, SHOW
from truepath.host.placed_robot import PlacedRobot

NEAR_M = 1.5e-4  # the calibration is good to 0.05 mm; the drawing to a tenth of that


# Where the arms are


@pytest.mark.parametrize("magnification", [1.0, 20.0])
def test_both_arms_have_their_tools_where_the_real_robot_has_them(
    operate, browser, rigid_cell, drawn, host, magnification
):
    q = path(12)
    controls = operate(q, magnification=magnification)
    q_corrected = host.plugin.correct(q).q_rad
    for waypoint in (0, 5, 11):
        browser.drag(PATH, round(400 * controls.view.course.share_of(waypoint)) / 4)
        controls.poll()
        controls.view.go_to(controls.view.course.share_of(waypoint))  # the slider has steps
        meant = drawn.poses(q[waypoint])[0, :3, 3]
        for arm, sent in (("arm_uncorrected", q[waypoint]), ("arm_corrected", q_corrected[waypoint])):
            off = rigid_cell.poses(sent)[0, :3, 3] - meant
            assert np.linalg.norm(browser.tool_of(arm) - meant - magnification * off) < magnification * NEAR_M
        assert np.linalg.norm(browser.tool_of("arm_uncorrected") - meant) > magnification * 0.5e-3


def test_dragging_the_slider_moves_the_arms(operate, browser, drawn):
    q = path(12)
    controls = operate(q)
    controls.poll()
    before = browser.tool_of("arm_corrected")
    assert np.linalg.norm(before - drawn.poses(q[0])[0, :3, 3]) < 5e-3
    browser.drag(PATH, 100.0)
    controls.poll()
    after = browser.tool_of("arm_corrected")
    assert np.linalg.norm(after - drawn.poses(q[-1])[0, :3, 3]) < 5e-3
    assert np.linalg.norm(after - before) > 0.1


def test_nothing_of_the_host_changes(operate, browser, host, meshcat):
    positions = host.plant.GetPositions(host.own)
    controls = operate(path(12))
    for label in (PLAY, NEXT, COLOUR, *SHOW):
        browser.click(label)
    browser.drag(MAGNIFY, 120.0)
    controls.poll()
    assert np.array_equal(host.plant.GetPositions(host.own), positions)
    assert not any(meshcat.HasPath(f"{BELOW}/arm_corrected/{name}") for name in ("left::ur5", "left", "left_tool"))
    assert meshcat.HasPath(f"{BELOW}/arm_corrected/right/ur5/wrist_3_link")
    controls.remove()
    controls.view.remove()
    assert not meshcat.HasPath(BELOW)
    assert meshcat.HasPath("/of_the_host")
    assert meshcat.GetButtonNames() == ["of the host"]
    assert meshcat.GetSliderNames() == []


def test_without_shapes_there_are_lines_and_tool_points(host, browser, meshcat):
    controls = host.plugin.operate(path(12))
    browser.drag(PATH, 50.0)
    controls.poll()
    assert not meshcat.HasPath(f"{BELOW}/arm_corrected/{GRIPPER}")
    assert np.linalg.norm(browser.pose(f"{BELOW}/arm_corrected/tool_point")[:3, 3]) > 0.1


# Paths of all kinds


def test_a_single_waypoint_stands_still(operate, browser, drawn):
    controls = operate(path(12)[:1])
    browser.click(PLAY)
    browser.drag(PATH, 70.0)
    controls.poll()
    assert controls.view.course.duration_s == 0.0
    assert np.linalg.norm(browser.tool_of("arm_corrected") - drawn.poses(path(12)[0])[0, :3, 3]) < 5e-3


def test_long_paths_are_thinned_out_and_stay_where_they_are(host, rigid):
    from truepath.host.course import Course

    course = Course.of(PlacedRobot.of(rigid), Asked(path(10_000)).shown(rigid))
    assert len(course.meant) >= 10_000
    assert len(course.kept) <= 2_010
    within = np.arange(len(course.meant))
    for points in (course.meant, course.real, course.corrected):
        line = np.stack([np.interp(within, course.kept, axis) for axis in points[course.kept].T], axis=1)
        assert np.linalg.norm(line - points, axis=1).max() < 1e-4
    assert (np.diff(course.time_s) >= 0).all()
    assert course.real_mm[course.kept].max() == course.real_mm.max()


def test_moves_that_stay_as_they_are_are_among_the_warnings(rigid, tmp_path):
    script = tmp_path / "p.script"
    first, last = (", ".join(f"{angle:.6f}" for angle in q) for q in path(12)[[0, -1]])
    script.write_text(f"def p():\n  movej([{first}])\n  movel(get_target_from_plc())\n  movej([{last}])\nend\n")
    texts = [remark.text for remark in Asked(script).shown(rigid).remarks]
    assert sum(text.startswith("line 3 stays as it is: ") for text in texts) == 1
