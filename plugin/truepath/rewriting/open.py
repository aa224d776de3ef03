"""A program of any format that truepath reads, by the ending of its name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from truepath.controller import Controller
from truepath.errors import InputError
from truepath.inverse import joints_along_path
from truepath.lie import Array
from truepath.programs.program import Program
from truepath.programs.toolpath_csv import read_toolpath
from truepath.programs.toolpath_program import ToolpathProgram
from truepath.region import Region
from truepath.rewriting.note import refuse_if_noted
from truepath.robot import NominalRobot

SCRIPTS = (".script", ".urscript", ".urs")
TOOLPATH = ".csv"


def open_program(
    path: str | Path,
    robot: NominalRobot,
    prefer: Region,
    controller: Controller,
    tool: Sequence[float] | None = None,
    start_rad: Sequence[float] | None = None,
) -> Program:
    """Reads a program.

    Args:
        path: ``.script`` (``.urscript``, ``.urs``) or ``.csv``.
        robot: that it is for.
        prefer: where joints lie usually; tells in which posture a toolpath of poses starts.
        controller: of the robot.
        start_rad: joints near which a toolpath of poses starts.
        tool: for a script, see ``urscript.script.parse_script``.

    Raises:
        InputError: no such file, another kind of file, or a fault in it; with line and column. A toolpath that was
            corrected, by the note beside it.
        CorrectionError: a path of poses that the robot cannot follow.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending in SCRIPTS:
        from truepath.programs.urscript.script import parse_script, read_bytes

        if robot.num_joints != 6:
            raise InputError("URScript is for six joints", file=path, found=f"{robot.name} with {robot.num_joints}")
        return parse_script(read_bytes(path), str(path), tool)
    if ending != TOOLPATH:
        raise InputError(
            "unknown kind of program",
            file=path,
            expected=f"a name ending in {TOOLPATH} (a toolpath) or {', '.join(SCRIPTS)} (URScript)",
            found=ending or "no ending",
        )
    toolpath = read_toolpath(path, robot.num_joints)
    refuse_if_noted(path, toolpath.table.raw)
    q: Array
    if toolpath.q_rad is not None:
        q = toolpath.q_rad
    else:
        assert toolpath.X_BF is not None
        start = None if start_rad is None else np.array(start_rad)
        q = joints_along_path(robot, toolpath.X_BF, prefer, toolpath.table.lines, str(path), start)
    return ToolpathProgram(toolpath, q, controller.X_BC, controller.X_F0)


def require_same_format(program: str | Path, output: str | Path) -> None:
    """Refuses to write a program into a file whose name is that of another format.

    Raises:
        InputError: it is; names that belong to no format pass.
    """
    ending, wanted = (Path(each).suffix.lower() for each in (output, program))
    formats = next((each for each in (SCRIPTS, (TOOLPATH,)) if wanted in each), None)
    if formats is None or ending in formats or ending not in (*SCRIPTS, TOOLPATH):
        return
    raise InputError(
        "the output is named as a program of another format",
        file=output,
        expected=f"a name ending in {', '.join(formats)}, like {Path(program).name}",
        found=ending,
    )
