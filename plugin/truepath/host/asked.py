"""What a host asks to be shown: anything that can be corrected, judged as ``correct`` judges it."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath.correct import MAX_CORRECTION_MM
from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import nominal_flange_poses
from truepath.preview.shown import Remark, ShownPath, require_joints

if TYPE_CHECKING:
    from pydrake.systems.framework import Context

    from truepath.host.plugin import CalibrationPlugin
    from truepath.rewriting.options import RewriteOptions
    from truepath.rewriting.trajectory import CorrectedTrajectory
    from truepath.robot import NominalRobot

AT_TIME = re.compile(r"at (\d+\.\d+) s")


@dataclass(frozen=True)
class Asked:
    """A program to be shown, and how it is corrected; see ``Showing.preview``."""

    program: Any
    corrected: Array | None = None
    options: RewriteOptions | None = None
    context: Context | None = None
    collisions: bool = True
    max_correction_mm: float | None = None
    tolerance_mm: float | None = None

    @property
    def is_file(self) -> bool:
        return isinstance(self.program, (str, Path))

    @property
    def is_trajectory(self) -> bool:
        return not self.is_file and hasattr(self.program, "start_time")

    @property
    def title(self) -> str:
        """What it is called."""
        if self.is_file:
            return Path(self.program).name
        return "Trajectory" if self.is_trajectory else "Path of joints"

    def shown(self, plugin: CalibrationPlugin) -> ShownPath:
        """Programmed and corrected joints, and all that is to be said of them.

        Raises:
            InputError, CorrectionError: as ``correct``; a program without a target, paths that differ, joints that are
                no numbers, corrected joints or options for another kind of program.
        """
        self._require_what_fits()
        if self.is_file:
            return self._of_a_file(plugin)
        if self.is_trajectory:
            return self._of_a_trajectory(plugin)
        return self._of_joints(plugin)

    def _require_what_fits(self) -> None:
        if self.corrected is not None and (self.is_file or self.is_trajectory):
            raise InputError("only joints come with joints that correct them", expected="corrected=None")
        if self.options is not None and not self.is_file:
            raise InputError("these options are for the file of a program", expected="options=None")
        for name in ("max_correction_mm", "tolerance_mm"):
            if self.is_file and getattr(self, name) is not None:
                own = "max_correction_mm" if name == "max_correction_mm" else "path_tolerance_mm"
                raise InputError(
                    f"of the file of a program {name} is among its options", expected=f"RewriteOptions({own}=...)"
                )
        if self.tolerance_mm is not None and not self.is_trajectory:
            raise InputError("tolerance_mm is for a trajectory", expected="tolerance_mm=None")

    def _stated(self, *names: str) -> dict[str, Any]:
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    def _of_a_file(self, plugin: CalibrationPlugin) -> ShownPath:
        from truepath.controller import controller_of
        from truepath.rewriting.open import SCRIPTS
        from truepath.rewriting.options import RewriteOptions

        options, file = self.options or RewriteOptions(), Path(self.program)
        done = plugin.correct(file, options=options, context=self.context, collisions=self.collisions)
        if not len(done.plan):
            raise InputError("there is nothing to show", file=file, expected="targets that can be resolved")
        text = file.read_bytes().decode("utf-8", "replace") if file.suffix.lower() in SCRIPTS else None
        return ShownPath.of_program(done, controller_of(plugin.robot, options.controller_kinematics), text)

    def _of_a_trajectory(self, plugin: CalibrationPlugin) -> ShownPath:
        stated = self._stated("max_correction_mm", "tolerance_mm")
        moved = plugin.correct(self.program, context=self.context, collisions=self.collisions, **stated)
        meant, sent = (each.vector_values(moved.time_s).T for each in (self.program, moved.trajectory))
        shown = ShownPath.of_joints(meant, sent, [f"{time:.2f} s" for time in moved.time_s])
        return replace(shown, remarks=_remarks(moved), looked_in=moved.rewritten.cell)

    def _of_joints(self, plugin: CalibrationPlugin) -> ShownPath:
        q, stated = np.atleast_2d(np.asarray(self.program, float)), self._stated("max_correction_mm")
        if self.corrected is None:
            return ShownPath.of_joints(q, plugin.correct(q, **stated).q_rad)
        q_corrected = np.atleast_2d(np.asarray(self.corrected, float))
        require_joints(q, q_corrected, plugin.robot.num_joints)
        far = _too_far(plugin.robot, q, q_corrected, stated.get("max_correction_mm", MAX_CORRECTION_MM))
        return replace(ShownPath.of_joints(q, q_corrected), remarks=far)


def _remarks(moved: CorrectedTrajectory) -> tuple[Remark, ...]:
    """All that the guards say of a trajectory, with the sample that is nearest to the time that they name."""
    said = [f"{each.guard}: {each.message}" for each in moved.findings] + moved.correction_warnings
    found = []
    for text in said:
        time = AT_TIME.search(text)
        sample = None if time is None else int(np.argmin(np.abs(moved.time_s - float(time[1]))))
        found.append(Remark(text, sample))
    return tuple(found)


def _too_far(robot: NominalRobot, q_rad: Array, q_corrected_rad: Array, most_mm: float) -> tuple[Remark, ...]:
    """A remark where joints that somebody gives as a correction move the flange further than a correction may."""
    meant, sent = (nominal_flange_poses(robot, q)[:, :3, 3] for q in (q_rad, q_corrected_rad))
    moved_mm = 1e3 * np.linalg.norm(sent - meant, axis=1)
    beyond = moved_mm > most_mm
    if not beyond.any():
        return ()
    worst = int(np.argmax(moved_mm))
    where = f"{int(beyond.sum())} of {len(beyond)} waypoints, most at waypoint {worst + 1}"
    text = (
        f"the corrected joints that were given move the flange by more than {most_mm:g} mm at {where}: "
        f"{moved_mm[worst]:.1f} mm"
    )
    return (Remark(text, worst),)
