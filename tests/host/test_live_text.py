"""Text on the screen: what the panes say, and that all of it is seen also where the screen is narrow."""

from dataclasses import replace

import numpy as np
import pytest
from foreign_host import path
from live_host import BELOW
from truepath.calibration_parts import StatisticsPart
from truepath.host.asked import Asked
from truepath.host.captions import LEGEND_PX, PLACE_PX, STILL_PX, draw_legend, draw_place
from truepath.host.controls import PATH, Controls
from truepath.host.course import Course
from truepath.host.live_view import PARTS
from truepath.host.on_screen import SCREEN_PX, Pane
from truepath.host.placed_robot import PlacedRobot
from truepath.preview.colours import BAND_OPACITY, PROGRAMMED, on_white
from truepath.preview.shown import Remark

CONTROLS_PX = 245  # of Meshcat, once they are opened, at the right
LEAST_PT = 9.0  # of 1/72 inch at 100 pixels an inch: 12.5 pixels, where the screen is 768 high


@pytest.fixture(scope="module")
def course(rigid):
    """One with everything that can be said: joints that were not measured, statements and remarks that are long."""
    q = path(12)
    q[8:, 5] += 3.0
    shown = replace(
        Asked(q).shown(rigid),
        line=np.arange(12) + 12345,
        labels=("movel(pose_trans(p[0.1, 0.2, 0.3, 0, 0, 0], offset), a=1.2, v=0.25)",) * 12,
        remarks=(Remark("joint-speed, line 12345: " + "the wrist would have to turn faster than it can " * 4, 3),),
    )
    return Course.of(PlacedRobot.of(rigid), shown)


def figures(course):
    """The panes in all their forms."""
    drawn = []
    for size, draw in (
        (
            LEGEND_PX,
            lambda f: draw_legend(
                f,
                course,
                "a_rather_long_name_of_a_program.script on right::ur5",
                1234.5,
                25.0,
                dict.fromkeys(PARTS, True),
                StatisticsPart(mean=0.1234, rms=0.2, p95=0.3, max=0.4567),
            ),
        ),
        (LEGEND_PX, lambda f: draw_legend(f, course, "p on ur5", 1.0, None, dict.fromkeys(PARTS, False))),
        (PLACE_PX, lambda f: draw_place(f, course, 0.9, None, True)),
        (PLACE_PX, lambda f: draw_place(f, course, 0.9, 0, False)),
        (STILL_PX, lambda f: draw_place(f, course, 0.0, None, None)),
    ):
        figure = Pane(None, "pane", *size, "top").figure()
        draw(figure)
        drawn.append(figure)
    return drawn


def test_nothing_is_cut_and_nothing_lies_over_another(course):
    for figure in figures(course):
        assert figure.texts
        renderer = figure.canvas.get_renderer()
        boxes = [text.get_window_extent(renderer) for text in figure.texts if text.get_text()]
        for k, box in enumerate(boxes):
            assert box.x0 >= 0
            assert box.x1 <= figure.bbox.width
            assert box.y0 >= 0
            assert box.y1 <= figure.bbox.height
            assert not any(box.overlaps(other) for other in boxes[k + 1 :]), figure.texts[k].get_text()


def test_letters_are_large_enough(course):
    assert min(text.get_fontsize() for figure in figures(course) for text in figure.texts) >= LEAST_PT


@pytest.mark.parametrize(("width", "height", "controls"), [(1366, 768, True), (1280, 800, True), (960, 960, False)])
def test_panes_are_within_the_window_and_clear_of_open_controls(width, height, controls):
    half = 0.5 * max(LEGEND_PX[0], PLACE_PX[0], STILL_PX[0]) * height / SCREEN_PX
    assert half < 0.5 * width - (CONTROLS_PX if controls else 0)


def test_the_legend_states_magnification_errors_and_the_end_of_the_colour_bar(course):
    said = " ".join(text.get_text() for text in figures(course)[0].texts)
    real, corrected = course.at_waypoints()
    for part in ("errors drawn 1234 times as long", "25 mm", "programmed", "joints not measured", "orange ghost"):
        assert part in said
    assert f"real tool today: predicted mean {real.mean:.3f}, max {real.max:.3f} mm" in said
    assert 0 < corrected.max < 0.0005
    assert "corrected: predicted mean < 0.001, max < 0.001 mm" in said
    assert "was off by 0.123 mm (mean), 0.457 mm (max) on measured poses that it had not seen" in said


def test_the_place_never_promises_nothing_at_all(course):
    said = " ".join(text.get_text() for text in figures(course)[4].texts)  # at the first waypoint
    assert "< 0.001 mm corrected (predicted)" in said


def test_the_programmed_path_has_the_colour_that_the_legend_and_the_page_give_it(operate, browser):
    operate(path(3))
    assert browser.property(f"{BELOW}/programmed", "opacity") == BAND_OPACITY
    assert on_white("#000000", 0.5) == "#808080"
    assert on_white("#ff0000", 0.25) == "#ffbfbf"
    figure = Pane(None, "pane", *LEGEND_PX, "top").figure()
    course = operate(path(3)).view.course
    draw_legend(figure, course, "p", 1.0, 1.0, dict.fromkeys(PARTS, True))
    swatch = figure.axes[0].images[0]
    shade = swatch.cmap(0.5)[:3]
    assert "#" + "".join(f"{round(255 * channel):02x}" for channel in shade) == on_white(PROGRAMMED, BAND_OPACITY)


def test_keys_are_told_to_whom_has_them(course):
    with_keys, without_keys, still = (" ".join(t.get_text() for t in f.texts) for f in figures(course)[2:])
    assert "Keys: space" in with_keys
    assert "Keys" not in without_keys + still
    assert "Open Controls" in without_keys
    assert "Open Controls" not in still


def test_of_the_pictures_of_a_pane_the_last_two_are_seen(meshcat, browser):
    pane = Pane(meshcat, "some_pane", 200, 40, "top")
    for _ in range(20):  # more than are kept
        pane.put(pane.figure())
    seen = [k for k in range(16) if browser.property(f"{pane.path}/{k}", "visible")]
    assert seen == [2, 3]
    depth = [-browser.pose(f"{pane.path}/{k}")[2, 3] for k in seen]
    assert depth[1] < depth[0]  # the last one is nearer
    pane.remove()
    assert not meshcat.HasPath(pane.path)


def test_the_place_is_written_when_the_arms_rest(operate, browser, monkeypatch):
    now = [0.0]
    view = operate(path(12)).view
    written = []
    monkeypatch.setattr(view, "write_place", lambda: written.append(view.place))
    controls = Controls(view, clock=lambda: now[0])
    for k in range(60):  # two seconds of motion
        browser.drag(PATH, 1.0 + k)
        now[0] += 1 / 30
        controls.poll()
    assert 1 <= len(written) <= 2
    now[0] += 0.3
    controls.poll()
    assert written[-1] == pytest.approx(0.6)
    count = len(written)
    controls.poll()
    assert len(written) == count
