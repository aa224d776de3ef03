"""How an operator works what is shown: sliders, buttons, keys, warnings."""

import numpy as np
import pytest
from foreign_host import path, plugin_for
from live_host import BELOW, start_meshcat
from truepath.host.controls import COLOUR, MAGNIFY, NEXT, PATH, PLAY, PREVIOUS, SHOW


@pytest.mark.parametrize(("label", "part"), list(SHOW.items()))
def test_each_part_can_be_hidden_and_shown(operate, browser, meshcat, label, part):
    controls = operate(path(12))
    assert meshcat.HasPath(f"{BELOW}/{part}")
    first = browser.property(f"{BELOW}/{part}", "visible")
    for expected in (not first, first):
        browser.click(label)
        controls.poll()
        assert browser.property(f"{BELOW}/{part}", "visible") is expected


def test_colour_by_error_gives_larger_errors_brighter_colours_and_back(operate, browser):
    controls = operate(path(12))
    course, line, corrected = controls.view.course, f"{BELOW}/real/line", f"{BELOW}/corrected/line"
    colours = browser.colours(line).reshape(len(course.kept), -1, 3)[:, 0]  # the first of each ring
    brightness = colours @ [0.2126, 0.7152, 0.0722]
    order = np.argsort(course.real_mm[course.kept])
    assert (np.diff(brightness[order]) > -1e-3).all()
    assert np.ptp(brightness) > 0.02
    assert len(np.unique(browser.colours(f"{BELOW}/error_vectors"), axis=0)) > 10
    assert len(np.unique(browser.colours(corrected), axis=0)) == 1
    for count in (1, len(np.unique(colours, axis=0))):
        browser.click(COLOUR)
        controls.poll()
        assert len(np.unique(browser.colours(line), axis=0)) == count
        assert (len(np.unique(browser.colours(f"{BELOW}/error_vectors"), axis=0)) == 1) == (count == 1)


def test_magnification_moves_the_real_line_and_its_arm(operate, browser, drawn):
    q = path(12)
    controls = operate(q, magnification=10.0)
    meant = drawn.poses(q[0])[0, :3, 3]
    controls.poll()
    small = browser.tool_of("arm_uncorrected") - meant
    browser.drag(MAGNIFY, 30.0)
    controls.poll()
    assert np.linalg.norm(browser.tool_of("arm_uncorrected") - meant - 3 * small) < 2e-4
    assert controls.view.magnification == 30.0


def test_playing_goes_on_with_time_and_begins_again(operate, browser, meshcat):
    from truepath.host.controls import Controls

    now = [100.0]
    view = operate(path(12)).view
    controls = Controls(view, clock=lambda: now[0])
    duration = view.course.duration_s
    assert 6.0 <= duration <= 60.0
    browser.click(PLAY)
    controls.poll()
    now[0] += 0.25 * duration
    controls.poll()
    assert view.place == pytest.approx(0.25)
    assert meshcat.GetSliderValue(PATH) == pytest.approx(25.0, abs=0.25)
    browser.drag(PATH, 90.0)  # the operator's hand goes first
    now[0] += 0.01 * duration
    controls.poll()
    assert view.place == pytest.approx(0.9)
    now[0] += 0.2 * duration
    controls.poll()
    assert view.place == 0.0
    browser.click(PLAY)
    controls.poll()
    stopped = view.place
    now[0] += 0.3 * duration
    controls.poll()
    assert view.place == stopped


def test_warnings_are_stepped_through(operate, browser, meshcat, drawn):
    q = np.concatenate([path(12), path(12)[::-1]])
    q[8:12, 5] += 3.0
    q[18:20, 5] += 3.0
    said = []
    controls = operate(q, say=said.append)
    texts = [each.text for each in controls.view.course.remarks]
    assert texts == [
        "outside the calibrated region: waypoints 9 to 12",
        "outside the calibrated region: waypoints 19 to 20",
    ]
    for label, expected, waypoint in ((NEXT, 0, 8), (NEXT, 1, 18), (NEXT, 0, 8), (PREVIOUS, 1, 18)):
        browser.click(label)
        controls.poll()
        assert said[-1] == texts[expected]
        meant = drawn.poses(q[waypoint])[0, :3, 3]
        assert np.linalg.norm(browser.pose(f"{BELOW}/warning")[:3, 3] - meant) < 1e-6
        assert np.linalg.norm(browser.tool_of("arm_corrected") - meant) < 5e-3
        assert meshcat.GetSliderValue(PATH) == pytest.approx(100 * controls.view.place, abs=0.25)


def test_without_warnings_it_says_so(operate, browser, meshcat):
    said = []
    controls = operate(path(12), say=said.append)
    browser.click(NEXT)
    controls.poll()
    assert said == ["no warnings"]
    assert not meshcat.HasPath(f"{BELOW}/warning")


def test_a_second_program_takes_the_place_of_the_first(operate, browser, drawn):
    operate(path(12))
    q = path(12)[:3] + 0.1
    controls = operate(q)
    browser.drag(PATH, 100.0)
    controls.poll()
    assert np.linalg.norm(browser.tool_of("arm_corrected") - drawn.poses(q[-1])[0, :3, 3]) < 5e-3


# Beside the host's own controls


@pytest.fixture
def of_the_host(meshcat):
    """A slider and a button of the host that have the names of ours."""
    meshcat.AddSlider(PATH, 0.0, 100.0, 1.0, 42.0)
    meshcat.AddButton(PLAY)
    yield
    meshcat.DeleteSlider(PATH, strict=False)
    meshcat.DeleteButton(PLAY, strict=False)


def test_controls_of_the_host_with_the_same_names_stay_its_own(of_the_host, operate, browser, host, meshcat):
    controls = operate(path(12))
    browser.drag(PATH, 77.0)
    browser.click(PLAY)
    controls.poll()
    assert controls.view.place == 0.0
    assert not controls.playing
    browser.drag(f"{PATH} · right::ur5", 60.0)
    controls.poll()
    assert controls.view.place == pytest.approx(0.6)
    host.plugin.remove()
    assert meshcat.GetSliderNames() == [PATH]
    assert meshcat.GetSliderValue(PATH) == 77.0
    assert meshcat.GetButtonClicks(PLAY) == 1


def test_when_the_host_deletes_all_controls_they_end_quietly(rigid, plant):
    own = start_meshcat()
    plugin = plugin_for(plant, meshcat=own)
    plugin.use(rigid.calibration)
    controls = plugin.operate(path(3))
    own.DeleteAddedControls()
    assert controls.is_removed
    controls.poll()
    controls.run()
    own.AddButton(PLAY)  # the host's now
    plugin.remove()
    assert own.GetButtonNames() == [PLAY]
