"""Correction of a path, against Drake's inverse kinematics for some of its waypoints: a part of benchmark.py.

    .venv/bin/python workflows/correction_benchmark.py [--waypoints 10000] [--sample 100] [--repeat 3]

Prints JSON.
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


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--waypoints", type=int, default=10_000)
    parser.add_argument("--sample", type=int, default=100, help="waypoints that Drake solves")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args(arguments)
    print(json.dumps(correct_ours(options.waypoints, options.sample, options.repeat)))
    return 0


def correct_ours(waypoints: int, sample: int, repeat: int) -> dict[str, Any]:
    """A welding path corrected by truepath and, in part, by Drake's inverse kinematics."""
    from truepath import lie, plants
    from truepath.calibrate import calibrate
    from truepath.correct import correct
    from truepath.model import nominal_flange_poses
    from truepath.programs.toolpath_csv import read_toolpath
    from truepath.virtual.real_robot import RealRobot
    from truepath.virtual.simulate import Campaign, free_poses, measure

    robot, real = plants.load_robot("ur5_cell"), RealRobot("ur5_cell", seed=0)
    model = calibrate(robot, measure(real, free_poses(real, 100, np.random.default_rng(0)), Campaign())).model
    q_path = read_toolpath(plants.models_dir() / "ur5" / "weld_path.csv", robot.num_joints).q_rad
    assert q_path is not None
    along = np.linspace(0, len(q_path) - 1, waypoints)
    q = np.stack([np.interp(along, np.arange(len(q_path)), column) for column in q_path.T], axis=1)
    seconds, corrected = [], correct(model, q)  # the first one is the warm-up
    for _ in range(repeat):
        start = time.perf_counter()
        corrected = correct(model, q)
        seconds.append(time.perf_counter() - start)
    goal = model.goal_flange_poses(nominal_flange_poses(robot, q))
    picked = np.unique(np.linspace(0, waypoints - 1, sample).astype(int))
    q_drake, ik_seconds, solved = _drake_ik(model, goal[picked], q[picked])

    def largest_error_um(q_rad: np.ndarray) -> float:
        return 1e6 * float(np.linalg.norm(lie.pose_error(goal[picked], model.flange_poses(q_rad))[:, 3:], axis=1).max())

    return {
        "waypoints": waypoints,
        "per_waypoint_us": 1e6 * statistics.median(seconds) / waypoints,
        "max_error_um": largest_error_um(corrected.q_rad[picked]),
        "ik_waypoints": len(picked),
        "ik_solved": solved,
        "ik_per_waypoint_us": 1e6 * statistics.median(ik_seconds),
        "ik_max_error_um": largest_error_um(q_drake),
    }


def _drake_ik(model: Any, X_BF: np.ndarray, q_start: np.ndarray) -> tuple[np.ndarray, list[float], int]:
    """Joints, seconds per waypoint and number of successes of Drake's InverseKinematics from the programmed joints.

    A pose is asked for as the places of three points of the flange: with an orientation constraint, SNOPT
    stops at 1.4 mrad and takes longer.
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
