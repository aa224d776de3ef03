"""What is drawn into a host's Meshcat and how it is worked. Where the tools must be says Drake, on its own plant."""

from types import SimpleNamespace

import numpy as np
import pytest
import umsgpack
from foreign_host import X_GT, build_plant, calibrated, path
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from truepath.errors import InputError
from truepath.host.controls import COLOUR, MAGNIFY, NEXT, PATH, PLAY, PREVIOUS, SHOW
from truepath.host.on_screen import Pane
from truepath.host.placed_robot import PlacedRobot

GRIPPER = "right_tool/gripper"
NEAR_M = 1.5e-4  # the calibration is good to 0.05 mm; the drawing to a tenth of that


@pytest.fixture(scope="module")
def meshcat():
    """The host's, with something of its own in it."""
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    meshcat.SetTransform("/of_the_host", RigidTransform())
    meshcat.AddButton("of the host")
    return meshcat


@pytest.fixture(scope="module")
def host(meshcat, rigid_cell):
    """The host's plant with a scene graph, its context at some pose, and the plugin for its right arm."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    build_plant(plant)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyContextFromRoot(context)
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), np.linspace(-1, 1, plant.num_positions()))
    plugin = calibrated(plant, rigid_cell, meshcat=meshcat)
    return SimpleNamespace(plugin=plugin, scene_graph=scene_graph, plant=plant, diagram=diagram, root=context, own=own)


@pytest.fixture
def operate(host):
    """Function: shows a path and gives the controls."""

    def operate(program, **options):
        return host.plugin.operate(program, scene_graph=host.scene_graph, **options)

    return operate


class Browser:
    """What a browser would send, and what it was told."""

    def __init__(self, meshcat):
        self.meshcat = meshcat

    def click(self, label):
        self._send({"type": "button", "name": label})

    def drag(self, label, value):
        self._send({"type": "slider", "name": label, "value": value})

    def _send(self, message):
        self.meshcat._InjectWebsocketMessage(umsgpack.packb(message))

    def pose(self, where):
        """``(4, 4)`` of a node of the tree."""
        packed = umsgpack.unpackb(self.meshcat._GetPackedTransform(where))
        return np.array(packed["matrix"]).reshape(4, 4).T

    def property(self, where, name):
        return umsgpack.unpackb(self.meshcat._GetPackedProperty(where, name))["value"]

    def colours(self, where):
        """``(V, 3)`` colours at the vertices of an object."""
        packed = umsgpack.unpackb(self.meshcat._GetPackedObject(where))
        array = packed["object"]["geometries"][0]["data"]["attributes"]["color"]["array"]
        return np.frombuffer(array.data, np.float32).reshape(-1, 3)


@pytest.fixture
def browser(meshcat):
    return Browser(meshcat)


def tool_of(browser, arm):
    """``(3,)`` where the gripper of a drawn arm is."""
    return (browser.pose(f"/truepath/{arm}/{GRIPPER}") @ X_GT.GetAsMatrix4())[:3, 3]


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
            assert np.linalg.norm(tool_of(browser, arm) - meant - magnification * off) < magnification * NEAR_M
        assert np.linalg.norm(tool_of(browser, "arm_uncorrected") - meant) > magnification * 0.5e-3


def test_dragging_the_slider_moves_the_arms(operate, browser, drawn):
    q = path(12)
    controls = operate(q)
    controls.poll()
    before = tool_of(browser, "arm_corrected")
    assert np.linalg.norm(before - drawn.poses(q[0])[0, :3, 3]) < 5e-3
    browser.drag(PATH, 100.0)
    controls.poll()
    after = tool_of(browser, "arm_corrected")
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
    assert not any(meshcat.HasPath(f"/truepath/arm_corrected/{name}") for name in ("left::ur5", "left", "left_tool"))
    assert meshcat.HasPath("/truepath/arm_corrected/right/ur5/wrist_3_link")
    controls.remove()
    controls.view.remove()
    assert not meshcat.HasPath("/truepath")
    assert meshcat.HasPath("/of_the_host")
    assert meshcat.GetButtonNames() == ["of the host"]
    assert meshcat.GetSliderNames() == []


def test_without_shapes_there_are_lines_and_tool_points(host, browser, meshcat):
    controls = host.plugin.operate(path(12))
    browser.drag(PATH, 50.0)
    controls.poll()
    assert not meshcat.HasPath(f"/truepath/arm_corrected/{GRIPPER}")
    assert np.linalg.norm(browser.pose("/truepath/arm_corrected/tool_point")[:3, 3]) > 0.1


# Controls


@pytest.mark.parametrize(("label", "part"), list(SHOW.items()))
def test_each_part_can_be_hidden_and_shown(operate, browser, meshcat, label, part):
    controls = operate(path(12))
    assert meshcat.HasPath(f"/truepath/{part}")
    first = browser.property(f"/truepath/{part}", "visible")
    for expected in (not first, first):
        browser.click(label)
        controls.poll()
        assert browser.property(f"/truepath/{part}", "visible") is expected


def test_colour_by_error_gives_larger_errors_brighter_colours_and_back(operate, browser):
    controls = operate(path(12))
    course, line = controls.view.course, "/truepath/real/line"
    assert len(np.unique(browser.colours(line), axis=0)) == 1
    browser.click(COLOUR)
    controls.poll()
    colours = browser.colours(line).reshape(len(course.kept), -1, 3)[:, 0]  # the first of each ring
    brightness = colours @ [0.2126, 0.7152, 0.0722]
    order = np.argsort(course.real_mm[course.kept])
    assert (np.diff(brightness[order]) > -1e-3).all()
    assert np.ptp(brightness) > 0.02
    browser.click(COLOUR)
    controls.poll()
    assert len(np.unique(browser.colours(line), axis=0)) == 1


def test_magnification_moves_the_real_line_and_its_arm(operate, browser, drawn):
    q = path(12)
    controls = operate(q, magnification=10.0)
    meant = drawn.poses(q[0])[0, :3, 3]
    controls.poll()
    small = tool_of(browser, "arm_uncorrected") - meant
    browser.drag(MAGNIFY, 30.0)
    controls.poll()
    assert np.linalg.norm(tool_of(browser, "arm_uncorrected") - meant - 3 * small) < 2e-4
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
        assert np.linalg.norm(browser.pose("/truepath/warning")[:3, 3] - meant) < 1e-6
        assert np.linalg.norm(tool_of(browser, "arm_corrected") - meant) < 5e-3
        assert meshcat.GetSliderValue(PATH) == pytest.approx(100 * controls.view.place, abs=0.25)


def test_without_warnings_it_says_so(operate, browser, meshcat):
    said = []
    controls = operate(path(12), say=said.append)
    browser.click(NEXT)
    controls.poll()
    assert said == ["no warnings"]
    assert not meshcat.HasPath("/truepath/warning")


def test_a_second_program_takes_the_place_of_the_first(operate, browser, drawn):
    operate(path(12))
    q = path(12)[:3] + 0.1
    controls = operate(q)
    browser.drag(PATH, 100.0)
    controls.poll()
    assert np.linalg.norm(tool_of(browser, "arm_corrected") - drawn.poses(q[-1])[0, :3, 3]) < 5e-3


# Paths of all kinds


def test_a_single_waypoint_stands_still(operate, browser, drawn):
    controls = operate(path(12)[:1])
    browser.click(PLAY)
    browser.drag(PATH, 70.0)
    controls.poll()
    assert controls.view.course.duration_s == 0.0
    assert np.linalg.norm(tool_of(browser, "arm_corrected") - drawn.poses(path(12)[0])[0, :3, 3]) < 5e-3


def test_long_paths_are_thinned_out_and_stay_where_they_are(host, rigid):
    from truepath.host.course import Course, shown_path

    course = Course.of(PlacedRobot.of(rigid), shown_path(rigid, path(10_000)))
    assert len(course.meant) >= 10_000
    assert len(course.kept) <= 2_010
    within = np.arange(len(course.meant))
    for points in (course.meant, course.real, course.corrected):
        line = np.stack([np.interp(within, course.kept, axis) for axis in points[course.kept].T], axis=1)
        assert np.linalg.norm(line - points, axis=1).max() < 1e-4
    assert (np.diff(course.time_s) >= 0).all()
    assert course.real_mm[course.kept].max() == course.real_mm.max()


def test_moves_that_stay_as_they_are_are_among_the_warnings(rigid, tmp_path):
    from truepath.host.course import shown_path

    script = tmp_path / "p.script"
    first, last = (", ".join(f"{angle:.6f}" for angle in q) for q in path(12)[[0, -1]])
    script.write_text(f"def p():\n  movej([{first}])\n  movel(get_target_from_plc())\n  movej([{last}])\nend\n")
    (remark,) = shown_path(rigid, script).remarks
    assert remark.text.startswith("line 3 stays as it is: ")


# Text on the screen


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
    from truepath.host.controls import Controls

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


@pytest.mark.parametrize("magnification", [0.0, float("nan"), float("inf")])
def test_a_magnification_that_makes_no_sense_is_refused(operate, magnification):
    with pytest.raises(InputError, match="this scale"):
        operate(path(12), magnification=magnification)


def test_without_a_meshcat_there_is_nothing_to_operate(rigid):
    with pytest.raises(InputError, match="nothing to draw in"):
        rigid.operate(path(12))
