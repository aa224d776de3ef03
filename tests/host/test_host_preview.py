"""The preview in a host's own Meshcat, still and with controls: all of it, in the place of what was there, and gone."""

import gc

import numpy as np
import pytest
from foreign_host import CORNERS, path, plugin_for
from live_host import BELOW, DRAWN, OWN_BUTTON, Browser, start_meshcat
from pydrake.trajectories import PiecewisePolynomial
from truepath.correct import CorrectionError
from truepath.errors import InputError
from truepath.host import CalibrationPlugin
from truepath.host.controls import COLOUR, PATH, PLAY, SHOW
from truepath.plants import models_dir
from truepath.rewriting.options import RewriteOptions

WELD = models_dir() / "ur5" / "weld.script"
BELOW_LEFT = "/truepath/left::ur5"
ARMS = ("arm_uncorrected", "arm_corrected")
NEAR_M = 1.5e-4
NO_FACTOR = [0.0, -1.0, float("nan"), float("inf"), 1e9, "big", None]


@pytest.fixture
def plugin(host):
    """For the right arm; what it shows goes afterwards."""
    yield host.plugin
    host.plugin.remove()


@pytest.fixture
def left(host, plugin):
    """For the left arm, in the same Meshcat; it is as far off as the right one."""
    other = CalibrationPlugin(host.plant, model_instance="left::ur5", tool_frame="tcp", meshcat=host.meshcat)
    other.use(plugin.calibration)
    yield other
    other.remove()


# What it shows


def test_it_shows_what_operate_shows_but_the_controls(plugin, host, browser):
    seen = []
    for show in (plugin.preview, plugin.operate):
        show(path(12), scene_graph=host.scene_graph)
        visible = {part: browser.property(f"{BELOW}/{part}", "visible") for part in SHOW.values()}
        assert [part for part, is_visible in visible.items() if not is_visible] == ["region"]
        seen.append([browser.colours(f"{BELOW}/{part}") for part in ("programmed", "real/line", "error_vectors")])
        assert host.meshcat.HasPath(f"{BELOW}/arm_corrected/right/ur5/wrist_3_link")
        assert len(host.meshcat.GetButtonNames()) == 1 + (4 + len(SHOW)) * (show == plugin.operate)
    for one, other in zip(*seen, strict=True):
        assert np.array_equal(one, other)


def test_its_arms_are_where_the_tool_is_off_most_or_at_the_waypoint_asked_for(plugin, host, browser, drawn, rigid_cell):
    q = path(12)
    off = np.linalg.norm((rigid_cell.poses(q) - drawn.poses(q))[:, :3, 3], axis=1)
    for asked, expected in ((None, int(np.argmax(off)) + 1), (1, 1), (12, 12)):
        shown = plugin.preview(q, scene_graph=host.scene_graph, waypoint=asked, magnification=1.0)
        assert shown.waypoint == expected
        joints = q[expected - 1]
        assert np.linalg.norm(browser.tool_of("arm_uncorrected") - rigid_cell.poses(joints)[0, :3, 3]) < NEAR_M
        assert np.linalg.norm(browser.tool_of("arm_corrected") - drawn.poses(joints)[0, :3, 3]) < NEAR_M


def test_what_it_gives_back_are_the_paths_as_drawn_and_errors_as_they_are(plugin, rigid_cell, drawn):
    q = path(30)
    shown = plugin.preview(q, magnification=1.0)
    assert np.abs(shown.programmed[[0, -1]] - drawn.poses(q[[0, -1]])[:, :3, 3]).max() < 1e-9
    assert np.abs(shown.real[[0, -1]] - rigid_cell.poses(q[[0, -1]])[:, :3, 3]).max() < 5e-5
    assert shown.corrected_mm.max < 1e-3 < 0.5 < shown.real_mm.mean
    larger = plugin.preview(q, magnification=20.0)
    assert np.allclose(larger.real - larger.programmed, 20 * (shown.real - shown.programmed), atol=1e-12)
    assert plugin.preview(q[:1]).programmed.shape == (1, 3)
    trajectory = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, len(CORNERS)), CORNERS.T, True)
    assert plugin.preview(trajectory).corrected_mm.max < 1e-3


def test_without_shapes_rods_stand_for_the_arm(plugin, host, browser, drawn):
    """From joint to joint: Drake knows where these are."""
    q = path(12)
    plugin.preview(q, waypoint=5, magnification=1.0)
    drawn.set(q[4])
    origins = [joint.frame_on_parent().CalcPoseInWorld(drawn.context).translation() for joint in drawn.joints]
    for name, middle in (("upper_arm", 0.5 * (origins[1] + origins[2])), ("forearm", 0.5 * (origins[2] + origins[3]))):
        for arm, near_m in (("arm_corrected", 1e-3), ("arm_uncorrected", 5e-3)):
            link = f"{BELOW}/{arm}/right/ur5/{name}_link"
            shapes = [shape for k in range(20) if host.meshcat.HasPath(shape := f"{link}/shape_{k}")]
            assert len(shapes) == 2  # a ball and a rod
            centre = (browser.pose(link) @ browser.pose(shapes[1]))[:3, 3]
            assert np.linalg.norm(centre - middle) < near_m


def test_options_of_a_program_are_heeded(plugin, rigid):
    with pytest.raises(CorrectionError, match=r"0\.1 mm"):
        plugin.preview(WELD, options=RewriteOptions(max_correction_mm=0.1))
    with pytest.raises(CorrectionError, match=r"0\.1 mm"):
        plugin.operate(WELD, options=RewriteOptions(max_correction_mm=0.1))
    with pytest.raises(InputError, match="for the file of a program"):
        plugin.preview(path(3), options=RewriteOptions())


# What makes no sense


@pytest.mark.parametrize("magnification", NO_FACTOR)
def test_a_magnification_that_makes_no_sense_is_refused_and_what_was_shown_stays(plugin, host, magnification):
    plugin.preview(path(3))
    for show in (plugin.preview, plugin.operate):
        with pytest.raises(InputError, match="this scale"):
            show(path(12), magnification=magnification)
    with pytest.raises(InputError, match="this scale"):
        plugin.preview(path(12), magnification=magnification, output="never.html", robot_source="ur5")
    assert host.meshcat.HasPath(f"{BELOW}/real")
    assert host.meshcat.GetButtonNames() == [OWN_BUTTON]


def test_errors_may_be_drawn_smaller_or_by_a_factor_that_suits_them(plugin, browser):
    controls = plugin.operate(path(12), magnification=0.5)
    controls.poll()
    assert controls.view.magnification == 0.5
    assert plugin.preview(path(12), magnification="auto").magnification in (10, 20, 50, 100, 200)


@pytest.mark.parametrize("waypoint", [0, 13, -1, 2.5, "a", True])
def test_a_waypoint_that_is_none_is_refused(plugin, waypoint):
    with pytest.raises(InputError, match="no such waypoint"):
        plugin.preview(path(12), waypoint=waypoint)


def test_without_a_meshcat_there_is_nothing_to_draw_in(rigid):
    for show in (rigid.preview, rigid.operate):
        with pytest.raises(InputError, match="nothing to draw in"):
            show(path(3))


# One after the other, and beside each other


def test_what_is_shown_next_takes_the_place_of_what_was_shown(plugin, host, browser, drawn):
    controls = plugin.operate(path(12), scene_graph=host.scene_graph)
    plugin.preview(path(3), scene_graph=host.scene_graph)
    assert host.meshcat.GetButtonNames() == [OWN_BUTTON]
    assert host.meshcat.GetSliderNames() == []
    before = browser.tool_of("arm_corrected")
    controls.poll()  # of a host that goes on in its loop
    controls.run()  # ends at once
    assert np.array_equal(browser.tool_of("arm_corrected"), before)
    again = plugin.operate(path(12), scene_graph=host.scene_graph)
    browser.drag(PATH, 100.0)
    again.poll()
    assert np.linalg.norm(browser.tool_of("arm_corrected") - drawn.poses(path(12)[-1])[0, :3, 3]) < 5e-3
    plugin.remove()
    assert not host.meshcat.HasPath("/truepath/right::ur5")
    assert not host.meshcat.HasPath("/Cameras/default/rotated/<object>/truepath_legend_0")
    assert host.meshcat.GetButtonNames() == [OWN_BUTTON]


def test_two_plugins_of_one_meshcat_leave_each_other_alone(plugin, left, host, browser):
    right_controls = plugin.operate(path(12), scene_graph=host.scene_graph)
    left_controls = left.operate(path(12), scene_graph=host.scene_graph)
    at_rest = browser.pose(f"{BELOW}/arm_corrected/right/ur5/forearm_link")
    browser.drag(f"{PATH} · left::ur5", 60.0)
    browser.click("Colour by error · left::ur5")
    for _ in range(3):
        right_controls.poll()
        left_controls.poll()
    assert left_controls.view.place == pytest.approx(0.6)
    assert right_controls.view.place == 0.0
    assert right_controls.view.by_error
    assert not left_controls.view.by_error
    assert np.array_equal(browser.pose(f"{BELOW}/arm_corrected/right/ur5/forearm_link"), at_rest)
    plugin.remove()
    left_controls.poll()
    assert not host.meshcat.HasPath(BELOW)
    assert host.meshcat.HasPath(f"{BELOW_LEFT}/arm_corrected")
    assert set(host.meshcat.GetSliderNames()) == {f"{PATH} · left::ur5", "Error, times · left::ur5"}


def test_arms_of_the_same_name_have_names_of_their_own(plugin, host):
    """Of two plants, or of one arm with two calibrations."""
    other = plugin_for(host.plant, meshcat=host.meshcat)
    other.use(plugin.calibration)
    plugin.preview(path(3))
    other.preview(path(3))
    assert host.meshcat.HasPath(BELOW)
    assert host.meshcat.HasPath(f"{BELOW} 2")
    other.remove()
    assert host.meshcat.HasPath(BELOW)
    assert not host.meshcat.HasPath(f"{BELOW} 2")


def test_what_a_plugin_left_that_is_no_more_is_cleared_away(rigid, plant):
    meshcat = start_meshcat()
    for _ in range(2):
        plugin = plugin_for(plant, meshcat=meshcat)
        plugin.use(rigid.calibration)
        plugin.operate(path(3)).poll()
        assert meshcat.HasPath(BELOW)
        assert PLAY in meshcat.GetButtonNames()
        assert COLOUR in meshcat.GetButtonNames()
        del plugin
        gc.collect()
    assert not meshcat.HasPath(f"{BELOW} 2")


# What belongs to the host


def test_grid_axes_and_background_are_as_the_host_has_them(plugin, host, browser):
    for part in ("/Grid", "/Axes", "/Background"):
        host.meshcat.SetProperty(part, "visible", part != "/Grid")
    host.meshcat.SetProperty("/Background/<object>", "top_color", [0.1, 0.2, 0.3])
    plugin.operate(path(12), scene_graph=host.scene_graph)
    for _ in ("while it is shown", "and after"):
        assert [browser.property(part, "visible") for part in ("/Grid", "/Axes", "/Background")] == [False, True, True]
        assert browser.property("/Background/<object>", "top_color") == [0.1, 0.2, 0.3]
        plugin.remove()


def test_the_camera_stays_where_it_is_if_told_so(rigid, plant):
    meshcat = start_meshcat()
    plugin = plugin_for(plant, meshcat=meshcat)
    plugin.use(rigid.calibration)
    for look, asked in ((False, False), (True, True)):
        plugin.preview(path(3), look=look)
        assert (meshcat._GetPackedProperty("/Cameras/default/rotated/<object>", "position") != b"") == asked


def test_the_hosts_own_drawing_of_the_arm_is_hidden_and_seen_again(plugin, host, browser):
    own = {side: f"/drake/{DRAWN.format(side=side)}" for side in ("left", "right")}
    assert all(map(host.meshcat.HasPath, own.values()))
    host.meshcat.SetProperty(own["left"], "visible", True)
    for show in (plugin.preview, plugin.operate):
        show(path(3), scene_graph=host.scene_graph)
        assert browser.property(own["right"], "visible") is False
        assert browser.property(own["left"], "visible") is True
        plugin.remove()
        assert browser.property(own["right"], "visible") is True
    plugin.preview(path(3), scene_graph=host.scene_graph, drawn_below="somewhere_else")
    assert browser.property(own["right"], "visible") is True


def test_a_plugin_that_knows_the_scene_graph_needs_not_be_told(rigid, host):
    meshcat = start_meshcat()
    plugin = plugin_for(host.plant, meshcat=meshcat, scene_graph=host.scene_graph)
    plugin.use(rigid.calibration)
    plugin.preview(path(3))
    assert Browser(meshcat).tool_of("arm_corrected").shape == (3,)
    for arm in ARMS:
        assert meshcat.HasPath(f"{BELOW}/{arm}/right/ur5/base_link") is False
        assert meshcat.HasPath(f"{BELOW}/{arm}/right/ur5/upper_arm_link")
