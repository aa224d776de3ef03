"""The plugin: the whole flow on a host's own plant."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from truepath.correct import MAX_CORRECTION_MM, Correction, correct
from truepath.errors import InputError
from truepath.host.arm_in_plant import ArmInPlant
from truepath.host.calibrating import Calibrating
from truepath.host.context_frames import AppliedFrames, apply_frames, reset_frames
from truepath.host.placed_robot import PlacedRobot
from truepath.lie import Array

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, SceneGraph
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame, ModelInstanceIndex
    from pydrake.systems.framework import Context
    from pydrake.trajectories import Trajectory

    from truepath.host.controls import Controls
    from truepath.host.live import PathsShown
    from truepath.preview import PreviewSummary
    from truepath.rewriting.options import RewriteOptions
    from truepath.rewriting.rewrite import RewrittenProgram
    from truepath.rewriting.trajectory import CorrectedTrajectory


class CalibrationPlugin(Calibrating):
    """Calibrates one arm of a host's plant, and corrects what the host wants to send to it.

    Works on the host's own finalized plant: the base welded anywhere and in any direction, any tool, other robots and
    models beside it. Neither the plant nor any context of the host is changed, but by ``apply`` and ``reset``, and
    then only the context given. Joints are those of the arm from base to flange, wherever they are among the plant's.

    Args:
        plant: finalized.
        model_instance: which model is the arm, by index or name; found by itself if only one has revolute joints.
        tool_frame: a frame that moves rigidly with the flange, by name or itself: where the tool acts, and the probe
            sits unless stated otherwise. None: the flange itself, and a probe that sits anywhere on it.
        meshcat: the host's, for ``preview``.
        base_frame, flange_frame: names, where they are not the root of the arm's model and a frame called flange,
            tool0, ee_link or tool_flange.

    Raises:
        InputError: no arm or several, a base that moves, a tool that is not fixed to the flange.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        *,
        model_instance: ModelInstanceIndex | str | None = None,
        tool_frame: Frame | str | None = None,
        meshcat: Meshcat | None = None,
        base_frame: str | None = None,
        flange_frame: str | None = None,
    ) -> None:
        super().__init__(ArmInPlant.find(plant, model_instance, tool_frame, base_frame, flange_frame))
        self.meshcat = meshcat

    # --- correcting -------------------------------------------------------------------------------------

    @overload
    def correct(self, program: str | Path, *, options: RewriteOptions | None = None) -> RewrittenProgram: ...

    @overload
    def correct(self, program: Array, *, max_correction_mm: float = MAX_CORRECTION_MM) -> Correction: ...

    @overload
    def correct(
        self,
        program: Trajectory,
        *,
        tolerance_mm: float = ...,
        max_correction_mm: float = MAX_CORRECTION_MM,
        cell: str | None = None,
        name: str = "trajectory",
    ) -> CorrectedTrajectory: ...

    def correct(self, program: Any, **how: Any) -> Any:
        """Corrects joints, a program or a trajectory, so that the real tool goes where it was meant to go.

        Args:
            program: ``(N, n)`` joints of the arm, a path of waypoints; or the file of a program; or a Drake
                ``Trajectory`` of the arm's joints.
            options: of a program: see ``RewriteOptions``.
            max_correction_mm: of joints: no commanded position may move further.
            tolerance_mm, max_correction_mm, cell, name: of a trajectory: see
                ``rewriting.trajectory.correct_trajectory``.

        Returns:
            For joints a ``Correction``; for a file a ``RewrittenProgram``, of which nothing is written yet; for a
            trajectory a ``CorrectedTrajectory``.

        Raises:
            CorrectionError: a guard forbids it.
            InputError: no calibration; joints, a file or options that make no sense.
        """
        calibration = self._in_use()
        if isinstance(program, (str, Path)):
            from truepath.rewriting.rewrite import rewrite_program

            return rewrite_program(program, calibration, **how)
        if _is_trajectory(program):
            from truepath.rewriting.trajectory import correct_trajectory

            if program.rows() != self.robot.num_joints:
                raise InputError(
                    "the trajectory is not one of the arm's joints",
                    expected=f"{self.robot.num_joints} rows, in the order of plugin.arm",
                    found=str(program.rows()),
                )
            return correct_trajectory(program, calibration, **how)
        return correct(calibration.model, program, region=calibration.region.region(), **how)

    # --- the real robot in the host ---------------------------------------------------------------------

    def apply(self, context: Context, *, base: bool = True, tool: bool = True) -> AppliedFrames:
        """Sets the calibrated frames on a context, so that Drake's own solvers see the real robot.

        Inverse kinematics, collision checks and planners that are given this context then work with the real
        geometry. Set are, counted from the plant's defaults: the frame of every joint; the frame by which the flange
        hangs on the last link; where the calibration knows them against the host's world and tool, also base and
        tool. Frames of other models stay as they are, and so do positions and velocities.

        A base whose weld has no frame of its own (``WeldFrames(world, base, X)``) cannot be moved; then the arm from
        its first joint on is put where it really is, and only the body of the base stays as drawn. To have that
        moved too, weld the base to ``plant.AddFrame(FixedOffsetFrame(name, world, X))``. Likewise for a tool: its mount
        has to be such a frame, or the tool frame itself one.

        Effects that are no frame cannot be set: ``transmission_error``, ``joint_compliance``, ``backlash``,
        ``encoder_scale``, ``axis_wobble``, ``thermal_expansion``, ``warmup_drift`` and the networks change with the
        joints or with time. ``JointCorrection`` and ``CalibratedRobot`` carry them. ``frame_drift`` and ``tool_shift``
        are in base and tool, as they were last. ``measurement_scale`` and ``outlier`` are errors of the measurement
        and in neither.

        Args:
            context: of the plant, or of the diagram that holds it.
            base, tool: whether to set these; False leaves them as drawn.

        Returns:
            What was set, and which effects of this calibration were left out.

        Raises:
            InputError: no calibration; a context of something else; a joint, a flange or a tool whose frame cannot be
                moved. The frames are then those of the plant's defaults.
        """
        self._in_use()
        own = self.place.context_of_the_plant(context)
        return apply_frames(PlacedRobot.of(self), own, base=base, tool=tool)

    def reset(self, context: Context) -> None:
        """Sets all frames that ``apply`` may have moved back to the plant's defaults.

        Args:
            context: of the plant, or of the diagram that holds it.
        """
        reset_frames(self.place, self.place.context_of_the_plant(context))

    @overload
    def preview(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        magnification: float = 50.0,
        output: None = None,
    ) -> PathsShown: ...

    @overload
    def preview(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        magnification: float = 50.0,
        output: str | Path,
        robot_source: str | Path,
    ) -> PreviewSummary: ...

    def preview(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        magnification: float = 50.0,
        output: str | Path | None = None,
        robot_source: str | Path | None = None,
    ) -> PathsShown | PreviewSummary:
        """Shows what the program means, where the real tool would go, and where it will go corrected.

        Args:
            program: as ``correct`` takes it.
            corrected: ``(N, n)`` corrected joints, if the program is joints; None: they are worked out.
            magnification: factor by which errors are drawn.
            output: HTML page to write; None draws in the host's Meshcat, below ``/truepath``.
            robot_source: for the page: built-in name, URDF or directives with the shapes of the arm.

        Raises:
            InputError: neither a Meshcat nor a page; a page without the shapes; as ``correct`` and ``write_preview``.
        """
        calibration = self._in_use()
        from truepath.host.course import shown_path

        shown = shown_path(self, program, corrected)
        if output is None:
            from truepath.host.live import show_paths

            return show_paths(self._meshcat(), PlacedRobot.of(self), shown, magnification)
        if robot_source is None:
            raise InputError("a page needs the shapes of the arm", expected="robot_source: a built-in name or a URDF")
        from truepath.preview import write_preview

        return write_preview(
            output,
            calibration,
            shown.q_meant,
            shown.q_corrected,
            robot_source=robot_source,
            magnification=magnification,
        )

    def operate(
        self,
        program: str | Path | Array | Trajectory,
        corrected: Array | None = None,
        *,
        scene_graph: SceneGraph | None = None,
        magnification: float = 50.0,
        options: RewriteOptions | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> Controls:
        """Draws what ``preview`` draws and the arm twice, today as a ghost and corrected, and adds controls for it.

        In the host's Meshcat an operator then scrubs along the path, plays it, changes the magnification, shows and
        hides, colours by error and steps through warnings. Nothing happens by itself: the host calls ``poll`` of what
        is returned in a loop of its own, or ``run``.

        Args:
            program, corrected: as ``preview``.
            scene_graph: with which the plant is registered, for the shapes of the arm; None: lines and text only.
            magnification: factor by which errors are drawn, at the start.
            options: if the program is a file: see ``RewriteOptions``.
            say: is told each warning that the operator steps to.

        Raises:
            InputError: no Meshcat, no calibration, a program that cannot be shown, a magnification below 1.
            CorrectionError: a guard forbids the correction.
        """
        meshcat = self._meshcat()
        if not 1.0 <= magnification < np.inf:
            raise InputError("errors cannot be drawn at this scale", expected="1 or more", found=str(magnification))
        from truepath.host.controls import Controls
        from truepath.host.course import Course, shown_path
        from truepath.host.live_view import LiveView

        robot = PlacedRobot.of(self)
        course = Course.of(robot, shown_path(self, program, corrected, options))
        name = Path(program).name if isinstance(program, (str, Path)) else "path"
        title = f"{name} on {self.robot.name}"
        view = LiveView(meshcat, robot, course, scene_graph=scene_graph, magnification=magnification, title=title)
        view.look()
        return Controls(view, say)

    def _meshcat(self) -> Meshcat:
        if self.meshcat is None:
            raise InputError("there is nothing to draw in", expected="a meshcat given to the plugin, or an output")
        return self.meshcat


def _is_trajectory(program: Any) -> bool:
    return not isinstance(program, (str, Path, np.ndarray)) and hasattr(program, "start_time")
