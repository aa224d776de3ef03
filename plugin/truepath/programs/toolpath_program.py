"""A toolpath CSV as a program: waypoints one after the other, none of which is hard to resolve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truepath import lie
from truepath.lie import Array
from truepath.programs.motions import Motions, joint_path
from truepath.programs.program import NewTargets, Unresolved, Via
from truepath.programs.toolpath_csv import Toolpath


@dataclass(frozen=True, eq=False)
class ToolpathProgram:
    """A toolpath; see ``programs.program.Program``.

    Attributes:
        toolpath: as read.
        q_rad: ``(N, n)`` its joints; for a path of poses those that the nominal robot takes.
        X_BC, X_F0: ``(4, 4)`` the controller's base and tool flange in the robot's.
    """

    toolpath: Toolpath
    q_rad: Array
    X_BC: Array
    X_F0: Array
    comment: str | None = None
    states_tool: bool = False
    unresolved: tuple[Unresolved, ...] = ()
    unreached: tuple[int, ...] = ()

    @property
    def file(self) -> str:
        return str(self.toolpath.table.file)

    @property
    def raw(self) -> bytes:
        return self.toolpath.table.raw

    @property
    def text(self) -> str:
        return self.raw.decode("utf-8", "replace")

    @cached_property
    def motions(self) -> Motions:
        """Waypoints in joints, one from the other; the tool is the flange, of which a toolpath speaks."""
        return joint_path(self.q_rad, lie.invert(self.X_F0)[None], np.asarray(self.toolpath.table.lines))

    def statement(self, at: int) -> str:
        """The row of a waypoint."""
        return ",".join(self.toolpath.table.rows[at])

    def can_be_added_before(self, at: int) -> bool:
        """Rows are not added: columns that truepath does not know would have no values."""
        return False

    def rewritten(self, new: NewTargets, vias: Sequence[Via], header: str) -> bytes:
        """The file with new joints, or with new poses where these are asked for and the file has poses."""
        changed = np.zeros(len(self.q_rad), bool)
        changed[new.index] = True
        if self.toolpath.X_BF is not None and new.is_pose.any():
            X_CT = lie.make_pose(lie.from_rotation_vector(new.values[:, 3:]), new.values[:, :3])
            X_BF = self.toolpath.X_BF.copy()
            X_BF[new.index] = self.X_BC @ X_CT
            return self.toolpath.with_poses(X_BF, changed).encode()
        q = self.q_rad.copy()
        q[new.index] = new.q_near_rad
        return self.toolpath.with_joints(q, changed).encode()
