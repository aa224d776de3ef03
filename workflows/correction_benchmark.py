"""Correction of a path, against Drake's inverse kinematics for some of its waypoints: a part of benchmark.py.

    .venv/bin/python workflows/correction_benchmark.py [--waypoints 100000] [--sample 200] [--repeat 3]

The calibration carries kinematic deviations and every named effect: those of a joint on three of the six joints, and
where gravity pulls, as ``with_every_effect`` says. Prints JSON; exit code 1 if Drake takes less than a hundred times
as long for a waypoint.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

IK_TOLERANCE_M, FLANGE_POINTS = 1e-6, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


SPEEDUP_REQUIRED = 100.0
WAVES = 6  # of each joint that swings, in cycles per turn
JOINTS_THAT_SWING = (1, 2, 3)  # by transmission_error and axis_wobble, the effects with the most parameters


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--waypoints", type=int, default=100_000)
    parser.add_argument("--sample", type=int, default=200, help="waypoints that Drake solves")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args(arguments)
    result = correct_ours(options.waypoints, options.sample, options.repeat)
    print(json.dumps(result))
    return int(result["ik_per_waypoint_us"] < SPEEDUP_REQUIRED * result["per_waypoint_us"])


def correct_ours(waypoints: int, sample: int, repeat: int) -> dict[str, Any]:
    """A welding path corrected by truepath and, in part, by Drake's inverse kinematics, the two in turn."""
    from truepath import lie, plants, poe
    from truepath.calibrate import calibrate
    from truepath.context import Context
    from truepath.correct import correct
    from truepath.model import nominal_flange_poses
    from truepath.programs.toolpath_csv import read_toolpath
    from truepath.virtual.real_robot import RealRobot
    from truepath.virtual.simulate import Campaign, free_poses, measure

    robot, real = plants.load_robot("ur5_cell"), RealRobot("ur5_cell", seed=0)
    measured = measure(real, free_poses(real, 100, np.random.default_rng(0)), Campaign())
    model = with_every_effect(calibrate(robot, measured).model, Context.of(measured))
    q_path = read_toolpath(plants.models_dir() / "ur5" / "weld_path.csv", robot.num_joints).q_rad
    assert q_path is not None
    along = np.linspace(0, len(q_path) - 1, waypoints)
    q = np.stack([np.interp(along, np.arange(len(q_path)), column) for column in q_path.T], axis=1)
    goal = model.goal_flange_poses(nominal_flange_poses(robot, q))
    picked = np.unique(np.linspace(0, waypoints - 1, sample).astype(int))
    ours: list[float] = []
    drakes: list[float] = []
    found: list[np.ndarray] = []
    solved = 0
    corrected = correct(model, q)  # the first one is the warm-up
    for part in np.array_split(picked, repeat):
        start = time.perf_counter()
        corrected = correct(model, q)
        ours.append(time.perf_counter() - start)
        q_drake, seconds, successes = _drake_ik(model, goal[part], q[part])
        drakes, solved, found = [*drakes, *seconds], solved + successes, [*found, *q_drake]

    def largest_error_um(X_BF: np.ndarray) -> float:
        return 1e6 * float(np.linalg.norm(lie.pose_error(goal[picked], X_BF)[:, 3:], axis=1).max())

    return {
        "waypoints": waypoints,
        "effects": sorted({part.term.effect for part in model.effects}),
        "per_waypoint_us": 1e6 * statistics.mean(ours) / waypoints,
        "max_error_um": largest_error_um(model.flange_poses(corrected.q_rad[picked])),
        "ik_waypoints": len(picked),
        "ik_solved": solved,
        "ik_per_waypoint_us": 1e6 * statistics.mean(drakes),
        # Drake's arm is rigid: its joints are those that the real ones must take.
        "ik_max_error_um": largest_error_um(poe.flange_poses(robot, model.p, np.array(found))),
    }


def with_every_effect(model: Any, campaign: Any) -> Any:
    """The calibration as if all effects that there are had been found too, each of a size that is plausible."""
    from dataclasses import replace

    from truepath.effects import EFFECTS
    from truepath.effects.base import FittedTerm

    rng = np.random.default_rng(0)
    count = len(campaign)
    seen = replace(campaign, time_s=np.arange(count, dtype=float), temperature_c=20.0 + rng.random(count))
    fitted = []
    for name in sorted(EFFECTS):
        # Waves of whole cycles per turn are the second form of a transmission error.
        forms = EFFECTS[name].alternatives(model.robot, seen)
        for term in forms[1] if name == "transmission_error" else forms[0]:
            if name in ("transmission_error", "axis_wobble") and term.joint not in JOINTS_THAT_SWING:
                continue
            if name == "transmission_error":
                term = term.with_parameters(term.parameters[: 2 * WAVES])
            scale = np.array([parameter.prior_scale for parameter in term.parameters])
            size = rng.normal(size=len(scale))
            fitted.append(
                FittedTerm(term, scale * (np.abs(size) if name in ("joint_compliance", "backlash") else size))
            )
    return replace(model, effects=tuple(fitted))


def _drake_ik(model: Any, X_BF: np.ndarray, q_start: np.ndarray) -> tuple[np.ndarray, list[float], int]:
    """Joints, seconds per waypoint and number of successes of Drake's InverseKinematics from the programmed joints.

    Drake's plant is rigid: it solves for the calibrated frames and is spared the effects. A pose is asked for as the
    places of three points of the flange: with an orientation constraint, SNOPT stops at 1.4 mrad and takes longer.
    """
    from pydrake.multibody.inverse_kinematics import InverseKinematics
    from pydrake.solvers import Solve
    from truepath import plants
    from truepath.export import set_calibrated_frames

    plant = plants.load_plant("ur5_cell")
    context = plant.CreateDefaultContext()
    set_calibrated_frames(model, plant, context)
    base, flange = plant.GetFrameByName("base_link"), plant.GetFrameByName("flange")
    joints, seconds, solved = np.empty_like(q_start), [], 0
    for k, (X, q) in enumerate(zip(X_BF, q_start, strict=True)):
        start = time.perf_counter()
        ik = InverseKinematics(plant, context)
        for point in FLANGE_POINTS:
            goal = X[:3, :3] @ point + X[:3, 3]
            ik.AddPositionConstraint(flange, point, base, goal - IK_TOLERANCE_M, goal + IK_TOLERANCE_M)
        ik.prog().SetInitialGuess(ik.q(), q)
        result = Solve(ik.prog())
        joints[k] = result.GetSolution(ik.q())
        seconds.append(time.perf_counter() - start)
        solved += int(result.is_success())
    return joints, seconds, solved


if __name__ == "__main__":
    sys.exit(main())
