"""The plugin: the whole flow on a host's own plant."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from truepath.correct import MAX_CORRECTION_MM, Correction, correct
from truepath.errors import InputError
from truepath.host.arm_in_plant import ArmInPlant
from truepath.host.context_frames import AppliedFrames, ToolWay, apply_frames, reset_frames
from truepath.host.placed_robot import PlacedRobot
from truepath.host.showing import Showing
from truepath.lie import Array

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, SceneGraph
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame, ModelInstanceIndex
    from pydrake.systems.framework import Context
    from pydrake.trajectories import Trajectory

    from truepath.guards import Finding
    from truepath.rewriting.options import RewriteOptions
    from truepath.rewriting.rewrite import RewrittenProgram
    from truepath.rewriting.trajectory import CorrectedTrajectory


class CalibrationPlugin(Showing):
    """Calibrates one arm of a host's plant, and corrects what the host wants to send to it.

    Works on the host's own finalized plant: the base welded anywhere and in any direction, any tool, other robots and
    models beside it. Neither the plant nor any context of the host is changed, but by ``apply`` and ``reset``, and
    then only the context given. Joints are those of the arm from base to flange, wherever they are among the plant's.

    Args:
        plant: finalized.
        model_instance: which model is the arm, by index or name; found by itself if only one has revolute joints.
        tool_frame: a frame that moves rigidly with the flange, by name or itself: where the tool acts, and the probe
            sits unless stated otherwise. None: the flange itself, and a probe that sits anywhere on it.
        meshcat: the host's, for ``preview`` and ``operate``.
        base_frame, flange_frame: names, where they are not the root of the arm's model and a frame called flange,
            tool0, ee_link or tool_flange. Without such a frame the arm ends at the link that carries the tool frame.
        scene_graph: with which the plant is registered: ``correct`` then looks for collisions in the host's plant, and
            ``preview`` and ``operate`` show the shapes of the arm.
        robot_source: built-in name, URDF or directives that hold the arm, if it came from such a file: saved
            calibrations name it, so that commands which draw or export the arm need no ``--robot``.

    Raises:
        InputError: no arm or several, a base that moves, a tool that is not fixed to the flange, a gripper that cannot
            be told from the arm, a source without this arm.
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
        scene_graph: SceneGraph | None = None,
        robot_source: str | Path | None = None,
    ) -> None:
        super().__init__(ArmInPlant.find(plant, model_instance, tool_frame, base_frame, flange_frame), meshcat)
        self.scene_graph = scene_graph
        if robot_source is not None:
            self.name_source(robot_source)

    # --- correcting -------------------------------------------------------------------------------------

    @overload
    def correct(
        self,
        program: str | Path,
        *,
        options: RewriteOptions | None = None,
        context: Context | None = None,
        collisions: bool = True,
    ) -> RewrittenProgram: ...

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
        context: Context | None = None,
        collisions: bool = True,
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
            context: of a program or a trajectory: of the plant or of the diagram that holds it, for where everything
                but the arm stands; it is only read. None: as the plant has it by default.
            collisions: of a program or a trajectory: whether they are looked for, in the host's plant unless a cell is
                stated (``none``: nowhere). Where that cannot be, a warning says so. Joints alone are not looked at.
                What the correction brings about is refused; what the program does by itself is warned of.

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

            options, remarks = self._with_surroundings(how.pop("options", None), how)
            rewritten = rewrite_program(program, calibration, options, **how)
            return replace(rewritten, findings=(*rewritten.findings, *remarks))
        if _is_trajectory(program):
            from truepath.rewriting.options import RewriteOptions
            from truepath.rewriting.trajectory import correct_trajectory

            if program.rows() != self.robot.num_joints:
                raise InputError(
                    "the trajectory is not one of the arm's joints",
                    expected=f"{self.robot.num_joints} rows, in the order of plugin.arm",
                    found=str(program.rows()),
                )
            options, remarks = self._with_surroundings(RewriteOptions(cell=how.pop("cell", None)), how)
            corrected = correct_trajectory(
                program, calibration, cell=options.cell, surroundings=options.surroundings, **how
            )
            return replace(corrected, findings=(*corrected.findings, *remarks))
        q_rad = np.atleast_2d(np.asarray(program, float))
        if not np.isfinite(q_rad).all():
            row = int(np.argmin(np.isfinite(q_rad).all(axis=1)))
            raise InputError(f"the joints are no numbers at waypoint {row + 1}", found=str(q_rad[row]))
        return correct(calibration.model, q_rad, region=calibration.region.region(), **how)

    def _with_surroundings(
        self, options: RewriteOptions | None, how: dict[str, Any]
    ) -> tuple[RewriteOptions, list[Finding]]:
        """Options that look for collisions in the host's plant, if nowhere else is stated; and what is to be said."""
        from truepath.host.host_cell import HostCell, host_cell
        from truepath.rewriting.options import NOWHERE, RewriteOptions

        options = RewriteOptions() if options is None else options
        context, wanted = how.pop("context", None), how.pop("collisions", True)
        own = None if context is None else self.place.context_of_the_plant(context)
        if not wanted or options.cell == NOWHERE:
            return replace(options, cell=None, surroundings=None), []
        if options.cell is not None or options.surroundings is not None:
            return options, []
        calibration = self._in_use()
        found = host_cell(self.place, calibration.model, calibration.region.region(), self.scene_graph, own)
        if isinstance(found, HostCell):
            return replace(options, surroundings=found), []
        return options, [found]

    # --- the real robot in the host ---------------------------------------------------------------------

    def apply(self, context: Context, *, base: bool = True, tool: ToolWay = True) -> AppliedFrames:
        """Sets the calibrated frames on a context, so that Drake's own solvers see the real robot.

        Inverse kinematics, collision checks and planners that are given this context then work with the real
        geometry. Set are, counted from the plant's defaults: the frame of every joint; the frame by which the flange
        hangs on the last link; where the calibration knows them against the host's world and tool, also base and
        tool. Where it does not, or where that is not wanted, these stay as this context has them. Frames of other
        models stay as they are, and so do positions and velocities.

        A base whose weld has no frame of its own (``WeldFrames(world, base, X)``) cannot be moved; then the arm from
        its first joint on is put where it really is, and only the body of the base stays as drawn. To have that
        moved too, weld the base to ``plant.AddFrame(FixedOffsetFrame(name, world, X))``. Likewise for a tool: its mount
        has to be such a frame. If only the tool frame itself is one, it alone is moved, and the tool's shapes stay; if
        there is none, ``tool=False`` sets all the rest, and ``tool="with flange"`` moves flange and tool as one. A
        flange that is the last link itself stays as drawn on it; its axis and the tool are right all the same. What
        was moved is told.

        Effects that are no frame cannot be set: ``transmission_error``, ``joint_compliance``, ``backlash``,
        ``encoder_scale``, ``axis_wobble``, ``thermal_expansion``, ``warmup_drift`` and the networks change with the
        joints or with time. ``JointCorrection`` and ``CalibratedRobot`` carry them. ``frame_drift`` and ``tool_shift``
        are in base and tool, as they were last. ``measurement_scale`` and ``outlier`` are errors of the measurement
        and in neither.

        Args:
            context: of the plant, or of the diagram that holds it.
            base, tool: whether to set these; False leaves them as they are. For the tool also ``with flange``.

        Returns:
            What was set, and which effects of this calibration were left out.

        Raises:
            InputError: no calibration; a context of something else; a joint or a tool whose frame cannot be moved. The
                frames are then as they were.
        """
        self._in_use()
        own = self.place.context_of_the_plant(context)
        return apply_frames(PlacedRobot.of(self), own, base=base, tool=tool)

    def reset(self, context: Context) -> None:
        """Sets all frames that ``apply`` may have moved back to the plant's defaults, base and tool among them.

        Args:
            context: of the plant, or of the diagram that holds it.

        Raises:
            InputError: a context of something else.
        """
        reset_frames(self.place, self.place.context_of_the_plant(context))


def _is_trajectory(program: Any) -> bool:
    return not isinstance(program, (str, Path, np.ndarray)) and hasattr(program, "start_time")
