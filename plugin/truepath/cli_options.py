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


def robot_named(spec: str) -> NominalRobot:
    """The nominal robot behind a name or a file."""
    from truepath.plants import load_robot

    return load_robot(spec)
