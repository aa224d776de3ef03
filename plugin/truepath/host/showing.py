"""The part of the plugin that shows: a program in the host's Meshcat, still or with controls, or on a page."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, cast, overload

from truepath.errors import InputError
from truepath.host.arm_in_plant import ArmInPlant
from truepath.host.asked import Asked
from truepath.host.calibrating import Calibrating
from truepath.host.placed_robot import PlacedRobot
from truepath.lie import Array
from truepath.plants import HOSTS_PLANT

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, SceneGraph
    from pydrake.systems.framework import Context
    from pydrake.trajectories import Trajectory

    from truepath.host.controls import Controls
    from truepath.host.live import PathsShown
    from truepath.host.live_view import LiveView
    from truepath.host.plugin import CalibrationPlugin
    from truepath.preview import HostTool, Magnification, PreviewSummary
    from truepath.preview.shown import ShownPath
    from truepath.rewriting.options import RewriteOptions

MAGNIFICATION = 50.0


class Showing(Calibrating):
    """Shows one program at a time: the next takes its place. Plugins of one Meshcat do not disturb each other.

    Args:
        place: the arm.
        meshcat: the host's; None: there are only pages.
        scene_graph: with which the plant is registered; None: shapes of the arm are not known.
    """

    def __init__(self, place: ArmInPlant, meshcat: Meshcat | None, scene_graph: SceneGraph | None = None) -> None:
        super().__init__(place)
        self.meshcat, self.scene_graph = meshcat, scene_graph
        self._view: LiveView | None = None

    @overload
    def preview(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        options: RewriteOptions | None = None,
        context: Context | None = None,
        collisions: bool = True,
        max_correction_mm: float | None = None,
        tolerance_mm: float | None = None,
        magnification: Magnification = MAGNIFICATION,
        waypoint: int | None = None,
        scene_graph: SceneGraph | None = None,
        drawn_below: str | None = None,
        look: bool = True,
        output: None = None,
    ) -> PathsShown: ...

    @overload
    def preview(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        options: RewriteOptions | None = None,
        context: Context | None = None,
        collisions: bool = True,
        max_correction_mm: float | None = None,
        tolerance_mm: float | None = None,
        magnification: Magnification = MAGNIFICATION,
        output: str | Path,
        robot_source: str | Path | None = None,
    ) -> PreviewSummary: ...

    def preview(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        options: RewriteOptions | None = None,
        context: Context | None = None,
        collisions: bool = True,
        max_correction_mm: float | None = None,
        tolerance_mm: float | None = None,
        magnification: Magnification = MAGNIFICATION,
        waypoint: int | None = None,
        scene_graph: SceneGraph | None = None,
        drawn_below: str | None = None,
        look: bool = True,
        output: str | Path | None = None,
        robot_source: str | Path | None = None,
    ) -> PathsShown | PreviewSummary:
        """Shows what the program means, where the real tool would go, and where it will go corrected.

        In the host's Meshcat, below ``/truepath/`` and the name of the arm's model: the three paths with a legend and a
        colour bar, the arm today as a ghost and the corrected one, arrows of the errors with their magnification,
        and frames of the tool; the region that was measured is there, but hidden. What this plugin showed before goes.
        Or as a page, like the one that ``truepath preview`` writes. The tool is that of the program; if it states none,
        of the plugin. What ``correct`` refuses or warns of, this does too, told the same.

        Args:
            program: as ``correct`` takes it.
            corrected: ``(N, n)`` corrected joints, if the program is joints; None: they are worked out. A warning says
                where they are further from the program than a correction may be.
            options: if the program is a file; its largest correction and tolerance are among them.
            context, collisions, max_correction_mm, tolerance_mm: as ``correct`` has them; None: its defaults. All but
                the joints of the arm is drawn as the context has it: the fingers of a gripper, and base and tool where
                the calibration does not know them. It is only read.
            magnification: factor by which errors are drawn, or "auto" for a round one that makes them visible.
            waypoint: at which the arms are, counted from 1; None: where the tool is off most today.
            scene_graph: with which the plant is registered, for the shapes of the arm; None: that of the plugin; if it
                has none, there are rods from joint to joint.
            drawn_below: prefix of the host's ``MeshcatVisualizer``, if it is none of Drake's own: the host's drawing of
                this arm is hidden, lest it is seen three times, until ``remove``.
            look: whether to turn the camera to where path and arm are seen well. A Meshcat does not tell where it was,
                so ``remove`` cannot turn it back.
            output: HTML page to write; None draws in the host's Meshcat.
            robot_source: for the page: built-in name, URDF or directives with the shapes of the arm. None: the source
                of the calibration, if that is a file or a built-in name.

        Raises:
            InputError: neither a Meshcat nor a page; a page without the shapes; a magnification or a waypoint that
                makes no sense; as ``correct`` and ``write_preview``. What was shown before then stays.
            CorrectionError: a guard forbids the correction.
        """
        asked = Asked(program, corrected, options, context, collisions, max_correction_mm, tolerance_mm)
        if output is not None:
            return self._write_page(asked, magnification, Path(output), robot_source)
        self._in_use()
        self._host_meshcat()
        from truepath.host.live import PathsShown

        shown = asked.shown(cast("CalibrationPlugin", self))
        count = len(shown.waypoint)
        is_one = isinstance(waypoint, Integral) and not isinstance(waypoint, bool) and 1 <= waypoint <= count
        if waypoint is not None and not is_one:
            raise InputError(
                "there is no such waypoint", expected=f"a whole number from 1 to {count}", found=repr(waypoint)
            )
        view = self._draw(asked, shown, scene_graph, drawn_below, magnification, controls=False)
        at = view.course.worst if waypoint is None else int(waypoint) - 1
        view.go_to(view.course.share_of(at))
        view.write_place()
        if look:
            view.look()
        return PathsShown.of(view, at + 1)

    def operate(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        options: RewriteOptions | None = None,
        context: Context | None = None,
        collisions: bool = True,
        max_correction_mm: float | None = None,
        tolerance_mm: float | None = None,
        magnification: Magnification = MAGNIFICATION,
        scene_graph: SceneGraph | None = None,
        drawn_below: str | None = None,
        look: bool = True,
        say: Callable[[str], None] = lambda _: None,
    ) -> Controls:
        """Draws what ``preview`` draws, and adds controls for it.

        In the host's Meshcat an operator then scrubs along the path, plays it, changes the magnification, shows and
        hides, colours by error and steps through warnings. Nothing happens by itself: the host calls ``poll`` of what
        is returned in a loop of its own, or ``run``. Of several plugins the first has the keys of the keyboard; the
        controls of the others have the name of their arm.

        Args:
            program, corrected, options, context, collisions, max_correction_mm, tolerance_mm: as ``preview``.
            magnification, scene_graph, drawn_below, look: as ``preview``.
            say: is told each warning that the operator steps to.

        Raises:
            InputError, CorrectionError: as ``preview``.
        """
        self._in_use()
        self._host_meshcat()
        from truepath.host.controls import Controls

        asked = Asked(program, corrected, options, context, collisions, max_correction_mm, tolerance_mm)
        shown = asked.shown(cast("CalibrationPlugin", self))
        view = self._draw(asked, shown, scene_graph, drawn_below, magnification, controls=True)
        if look:
            view.look()
        return Controls(view, say)

    def remove(self) -> None:
        """Takes away from the Meshcat what this plugin shows there; what it hid of the host is seen again."""
        if self._view is not None:
            self._view.remove()
            self._view = None

    # --- how ------------------------------------------------------------------------------------------------

    def _draw(
        self,
        asked: Asked,
        shown: ShownPath,
        scene_graph: SceneGraph | None,
        drawn_below: str | None,
        magnification: Magnification,
        controls: bool,
    ) -> LiveView:
        from truepath.host.context_frames import context_as_drawn
        from truepath.host.course import Course
        from truepath.host.live_view import LiveView
        from truepath.preview.toolpaths import magnification_of

        robot = self._placed(asked)
        course = Course.of(robot, shown)
        factor = magnification_of(course.fine.paths.at(course.fine.waypoint), magnification)
        self.remove()  # not before it is sure that there is something to take its place
        self._view = LiveView(
            self._host_meshcat(),
            robot,
            course,
            scene_graph=self.scene_graph if scene_graph is None else scene_graph,
            drawn_below=drawn_below,
            magnification=factor,
            title=f"{asked.title} on {self.robot.name}",
            controls=controls,
            context=None
            if asked.context is None
            else context_as_drawn(robot, self.place.context_of_the_plant(asked.context)),
            model_error=None if (heldout := self._in_use().heldout) is None else heldout.calibrated.position_mm,
        )
        return self._view

    def _write_page(
        self, asked: Asked, magnification: Magnification, output: Path, robot_source: str | Path | None
    ) -> PreviewSummary:
        from truepath.preview import write_shown

        calibration = self._in_use()
        if robot_source is None and calibration.robot.source == HOSTS_PLANT:
            raise InputError("a page needs the shapes of the arm", expected="robot_source: a built-in name or a URDF")
        return write_shown(
            output,
            calibration,
            asked.shown(cast("CalibrationPlugin", self)),
            robot_source or calibration.robot.source,
            magnification,
            asked.title,
            self._tool(asked),
        )

    def _tool(self, asked: Asked) -> HostTool:
        from truepath.preview import HostTool

        frame = self.place.tool
        name = "the flange" if frame is None else f"the tool frame {frame.name()!r}"
        return HostTool(self._placed(asked).X_FT, name)

    def _placed(self, asked: Asked) -> PlacedRobot:
        """The robot, standing where the context that was stated has it."""
        return PlacedRobot.of(self, None if asked.context is None else self.place.context_of_the_plant(asked.context))

    def _host_meshcat(self) -> Meshcat:
        if self.meshcat is None:
            raise InputError("there is nothing to draw in", expected="a meshcat given to the plugin, or an output")
        return self.meshcat
