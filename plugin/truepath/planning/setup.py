"""From what is stated on the command line to the test that poses have to pass."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truepath import plants
from truepath.errors import InputError
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_model
from truepath.pipeline import stated_probe
from truepath.planning.feasible import Feasible
from truepath.planning.free_space import MARGIN_M, FreeSpace
from truepath.planning.sight import Sight
from truepath.robot import NominalRobot
from truepath.same_robot import require_same_robot

NOWHERE = "none"


def robot_in_cell(robot: str, cell: str | None) -> tuple[NominalRobot, str | Path | None]:
    """The robot as it stands in its cell, and the cell; None for ``none``.

    Args:
        robot: name or file of the robot.
        cell: name or file of the cell, ``none``, or None for the one that comes with the robot.

    Raises:
        InputError: no such model, or another robot stands in the cell.
    """
    wanted = plants.load_robot(robot)
    if cell == NOWHERE:
        return wanted, None
    spec = plants.cell_of(robot) if cell is None else cell
    file = plants.resolve(spec, "cell")
    found = plants.load_robot(spec)
    require_same_robot(wanted, found, "another robot stands in this cell", file)
    return found, spec


def feasible_poses(
    robot: NominalRobot,
    cell: str | Path | None,
    probe: str,
    sight: Sight | None,
    *,
    model: CalibratedModel | None = None,
    margin_m: float = MARGIN_M,
    seed: int = 0,
) -> Feasible:
    """The test of poses, for a robot that starts where its cell's model has it by default.

    Args:
        robot: as it stands in its cell.
        cell: its model; None: only joint limits and sight count.
        probe: place of the reflector on the flange: ``model``, or ``x,y,z`` in mm.
        sight: the tracker; None: it sees everything.
        model: the robot as calibrated; None: as drawn.
        margin_m: clearance to keep.
        seed: of the postures from which ways are looked for.

    Raises:
        InputError: the reflector's place is not known, nothing is free, or no such margin.
    """
    if not 0.0 <= margin_m < 1.0:
        raise InputError("no such clearance", expected="0 mm or more, less than 1 m", found=f"{1e3 * margin_m:g} mm")
    X_FE = model.X_FE if model is not None else stated_probe(robot, probe)
    if X_FE is None:
        raise InputError(
            "poses cannot be planned for a probe of unknown place", expected="--probe model, or x,y,z in mm"
        )
    space = None if cell is None else FreeSpace(cell, model or nominal_model(robot), margin_m)
    return Feasible.within_limits(robot, X_FE, space, sight).from_home(np.random.default_rng([seed, 1]))


def stated_noise(noise_mm: float, orientation_noise_mrad: float | None) -> Array:
    """``(m,)`` noise of a reading, m and rad.

    Raises:
        InputError: no noise at all: then one pose is as good as another.
    """
    for noise in (noise_mm, orientation_noise_mrad):
        if noise is not None and not (np.isfinite(noise) and noise > 0):
            raise InputError("this is no size of noise", expected="a finite number above 0", found=f"{noise:g}")
    turn = [] if orientation_noise_mrad is None else [1e-3 * orientation_noise_mrad] * 3
    return np.array([1e-3 * noise_mm] * 3 + turn)
