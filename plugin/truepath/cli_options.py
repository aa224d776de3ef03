"""Options that several commands of ``truepath`` share, and the reading of a robot by its name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from truepath.robot import NominalRobot

DataFile = Annotated[Path, typer.Argument(help="measured poses", show_default=False)]
Format = Annotated[str, typer.Option("--format", help="csv, or a published set: jacobi2025, landgraf2021")]
RobotSpec = Annotated[str, typer.Option("--robot", help="ur5, ur10, ur5_cell, ur10_cell, a .urdf or a .dmd.yaml")]
CalibrationFile = Annotated[Path, typer.Option("--calibration", "-c", help="calibration.json", show_default=False)]
RobotCheck = Annotated[str | None, typer.Option("--robot", help="refuse a calibration of any other robot")]
Json = Annotated[bool, typer.Option("--json", help="print JSON for machines instead of text")]
Output = Annotated[Path, typer.Option("--output", "-o", help="file to write", show_default=False)]
MaxCorrection = Annotated[float, typer.Option("--max-correction-mm", help="refuse to move any target further")]
ProgramFile = Annotated[
    Path,
    typer.Argument(help="URScript program (.script), or toolpath (.csv: joints, or flange poses)", show_default=False),
]
Express = Annotated[
    str | None,
    typer.Option("--as", help="write corrected targets as joints or as poses; default: as the line held them"),
]
ControllerKinematics = Annotated[
    str,
    typer.Option(help="by which the controller turns poses into joints: nominal, a calibration.conf, or its .yaml"),
]
PathTolerance = Annotated[
    float | None, typer.Option(help="add targets on lines and arcs where the tool would leave them further")
]
CellSpec = Annotated[
    str | None,
    typer.Option(help="look for collisions in this cell (ur5_cell, a .dmd.yaml); none: nowhere; default: the one that "
                 "was calibrated, if it was a cell"),
]  # fmt: skip
StartDeg = Annotated[
    str | None, typer.Option(help="joints from which the program starts, with commas; for programs of poses only")
]
Tcp = Annotated[
    str | None, typer.Option(help="tool before the program sets one: x,y,z in mm, rx,ry,rz rotation vector in rad")
]
PayloadKg = Annotated[
    float | None,
    typer.Option("--payload-kg", min=0, help="on the flange, beyond the model's; default: as in the measurements"),
]
MeasuredIn = Annotated[
    str, typer.Option(help="tracker: nobody knows where the robot stands; world: the frame of the robot's model")
]
Probe = Annotated[
    str, typer.Option(help="place of the probe on the flange: unknown, model (frame 'reflector'), or x,y,z in mm")
]
Residual = Annotated[
    str, typer.Option(help="network: learn what no cause explains by neural networks, if that is proved to help; none")
]
Device = Annotated[str, typer.Option(help="where networks learn: cpu or cuda", rich_help_panel="Networks")]
Seed = Annotated[
    int | None, typer.Option(min=0, help="of the networks' chance [default: 0]", rich_help_panel="Networks")
]
Resume = Annotated[
    Path | None,
    typer.Option(
        "--checkpoint",
        help="keep in this file what the networks have learnt; after an interruption the same command goes on from it",
        rich_help_panel="Networks",
    ),
]


def robot_named(spec: str) -> NominalRobot:
    """The nominal robot behind a name or a file."""
    from truepath.plants import load_robot

    return load_robot(spec)
