"""What a host asks to be shown: by the rules of ``correct``, and as a context of its own has it."""

import numpy as np
import pytest
from foreign_host import CORNERS, arm_instance, path
from live_host import BELOW
from pydrake.math import RotationMatrix
from pydrake.trajectories import PiecewisePolynomial
from truepath.correct import CorrectionError
from truepath.errors import InputError
from truepath.plants import models_dir
from truepath.rewriting.options import RewriteOptions

WELD = models_dir() / "ur5" / "weld.script"
TRAJECTORY = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, len(CORNERS)), CORNERS.T, True)


@pytest.fixture
def plugin(host):
    yield host.plugin
    host.plugin.remove()


@pytest.mark.parametrize("program", [path(12), TRAJECTORY], ids=["joints", "trajectory"])
def test_the_largest_correction_is_that_of_correct(plugin, program):
    for show in (plugin.correct, plugin.preview, plugin.operate):
        with pytest.raises(CorrectionError, match=r"0\.1 mm"):
            show(program, max_correction_mm=0.1)
        show(program, max_correction_mm=9.0)


def test_the_tolerance_of_a_trajectory_decides_where_it_is_corrected(plugin):
    few, many = (len(plugin.preview(TRAJECTORY, tolerance_mm=mm).view.course.shown.waypoint) for mm in (0.5, 0.002))
    assert few < many
    assert many == len(plugin.correct(TRAJECTORY, tolerance_mm=0.002).time_s)


@pytest.mark.parametrize("stated", [{"max_correction_mm": 3.0}, {"tolerance_mm": 0.1}])
def test_of_a_file_they_are_among_the_options(plugin, stated):
    with pytest.raises(InputError, match="among its options") as caught:
        plugin.preview(WELD, **stated)
    assert caught.value.expected.startswith("RewriteOptions(")
    with pytest.raises(InputError, match="for a trajectory"):
        plugin.preview(path(3), tolerance_mm=0.1)


def test_what_the_arm_carries_is_drawn_as_the_context_has_it(plugin, host, browser):
    """A camera that pans on the upper arm: by 0.4 rad in the context, not at all by default."""
    pan = host.plant.GetJointByName("pan", arm_instance(host.plant, "right"))
    context = host.plant.CreateDefaultContext()
    pan.set_angle(context, 0.4)
    before = host.plant.GetPositions(context).tobytes()
    for stated, angle in ((context, 0.4), (None, 0.0)):
        plugin.preview(path(3), scene_graph=host.scene_graph, context=stated)
        for arm in ("arm_corrected", "arm_uncorrected"):
            upper, camera = (browser.pose(f"{BELOW}/{arm}/right/ur5/{name}") for name in ("upper_arm_link", "camera"))
            turned = (np.linalg.inv(upper) @ camera)[:3, :3]
            assert np.abs(turned - RotationMatrix.MakeZRotation(angle).matrix()).max() < 1e-12
    assert host.plant.GetPositions(context).tobytes() == before
    with pytest.raises(InputError, match="does not belong"):
        plugin.preview(path(3), context=3)


def test_a_context_that_was_applied_to_is_not_moved_twice(plugin, host, browser):
    applied = host.plant.CreateDefaultContext()
    plugin.apply(applied)
    plugin.preview(path(12), scene_graph=host.scene_graph)
    tool = browser.tool_of("arm_corrected")
    plugin.preview(path(12), scene_graph=host.scene_graph, context=applied)
    assert np.abs(browser.tool_of("arm_corrected") - tool).max() < 1e-12


def test_joints_that_are_given_as_a_correction_and_are_none_are_told(plugin):
    q = path(12)
    assert plugin.preview(q, plugin.correct(q).q_rad).warnings == ()
    far = q.copy()
    far[7, 0] += 0.05
    (warning,) = plugin.preview(q, far).warnings
    assert "move the flange by more than 5 mm at 1 of 12 waypoints, most at waypoint 8" in warning
    assert plugin.preview(q, far, max_correction_mm=100.0).warnings == ()


def test_joints_that_are_no_numbers_are_said_to_be_none(plugin):
    q = path(4)
    q[2, 1] = np.nan
    for show in (plugin.correct, plugin.preview):
        with pytest.raises(InputError, match="no numbers at waypoint 3"):
            show(q)


# What it gives back


def test_what_is_shown_is_described_in_a_line(plugin):
    text = repr(plugin.preview(path(12), waypoint=5))
    assert text.startswith("<PathsShown 12 waypoints, predicted mean error ")
    assert "< 0.001 mm corrected" in text
    assert len(text) < 200


def test_a_corrected_program_is_written_but_never_over_the_one_that_was_read(rigid, tmp_path):
    program = tmp_path / "weld.script"
    program.write_bytes(WELD.read_bytes())
    done = rigid.correct(program, options=RewriteOptions(cell="none"))
    assert len(repr(done)) < 200
    done.write(tmp_path / "corrected.script")
    assert (tmp_path / "corrected.script").read_bytes() == done.content != program.read_bytes()
    link = tmp_path / "link.script"
    link.symlink_to(program)
    for place in (program, link):
        with pytest.raises(InputError, match="the output is the input"):
            done.write(place)
    assert program.read_bytes() == WELD.read_bytes()
    with pytest.raises(InputError, match="cannot write here"):
        done.write(tmp_path / "nowhere" / "corrected.script")
