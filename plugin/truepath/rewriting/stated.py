"""Options of a correction as stated on a command line or in a manifest."""

from __future__ import annotations

import math
from typing import Literal

from truepath.calibration import Calibration
from truepath.errors import InputError
from truepath.plants import BUILT_IN, resolve
from truepath.rewriting.options import RewriteOptions

FORMS: dict[str, Literal["joints", "poses"]] = {"joints": "joints", "poses": "poses"}
NOWHERE = "none"


def stated_options(
    calibration: Calibration,
    express: str | None,
    controller_kinematics: str,
    path_tolerance_mm: float | None,
    max_correction_mm: float,
    cell: str | None,
    start_deg: str | None,
    tcp: str | None,
) -> RewriteOptions:
    """Options from words; for their meaning see ``RewriteOptions``.

    Args:
        cell: None for the cell that was calibrated, if it was one; ``none`` for nowhere.
        start_deg: six angles, with commas.
        tcp: x, y, z in mm and rotation vector in rad, with commas.

    Raises:
        InputError: a word that is none of those expected, numbers that are none.
    """
    if express is not None and express not in FORMS:
        raise InputError(f"unknown form {express!r}", expected="joints or poses")
    if path_tolerance_mm is not None and not path_tolerance_mm >= 0:
        raise InputError("the path tolerance is no length", expected="0 or more, in mm", found=str(path_tolerance_mm))
    if not max_correction_mm >= 0:
        raise InputError("the largest correction is no length", expected="0 mm or more", found=str(max_correction_mm))
    if cell not in (None, NOWHERE):
        resolve(cell, "cell")
    joints = len(calibration.robot.joint_names)
    start = None if start_deg is None else _numbers(start_deg, joints, "--start-deg", f"{joints} angles in degrees")
    tool = None if tcp is None else _numbers(tcp, 6, "--tcp", "x,y,z in mm, rx,ry,rz in rad")
    return RewriteOptions(
        express=None if express is None else FORMS[express],
        controller_kinematics=controller_kinematics,
        path_tolerance_mm=path_tolerance_mm,
        max_correction_mm=max_correction_mm,
        cell=_calibrated_cell(calibration) if cell is None else None if cell == NOWHERE else cell,
        start_rad=None if start is None else tuple(map(math.radians, start)),
        tool=None if tool is None else (*(1e-3 * each for each in tool[:3]), *tool[3:]),
    )


def _calibrated_cell(calibration: Calibration) -> str | None:
    source = calibration.robot.source
    is_cell = source.endswith("_cell") if source in BUILT_IN else source.endswith(".dmd.yaml")
    return source if is_cell else None


def _numbers(text: str, count: int, option: str, expected: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InputError(f"cannot read {option}", expected=expected, found=text)
    return numbers
