"""What is checked of a list of poses before any of it is driven."""

from __future__ import annotations

import numpy as np

from truepath.errors import InputError
from truepath.planning.pose_list import PoseList, robot_mark
from truepath.robot import NominalRobot


def require_of_robot(poses: PoseList, robot: NominalRobot, file: str) -> None:
    """Raises InputError if the list says that it was planned for a robot of another geometry."""
    mark = robot_mark(robot)
    if poses.robot and poses.robot.rpartition(":")[2] != mark.rpartition(":")[2]:
        problem = "the poses were planned for another robot"
        raise InputError(problem, file=file, line=2, column="robot", expected=mark, found=poses.robot)


def require_within_limits(poses: PoseList, robot: NominalRobot, file: str) -> None:
    """Raises InputError for the first commanded joint that is not finite or beyond the limits of the robot."""
    if poses.q_rad.shape[1] != robot.num_joints:
        found = f"{poses.q_rad.shape[1]} joints"
        raise InputError(
            "the poses are of another robot", file=file, expected=f"{robot.num_joints} joints", found=found
        )
    bad = ~((poses.q_rad >= robot.lower_rad) & (poses.q_rad <= robot.upper_rad))
    if bad.any():
        k, i = np.argwhere(bad)[0]
        lower, upper = np.degrees([robot.lower_rad[i], robot.upper_rad[i]])
        raise InputError(
            "a pose is beyond the joint limits",
            file=file,
            line=int(k) + 2,
            column=f"q{i + 1} ({robot.joint_names[i]})",
            expected=f"{lower:.2f} to {upper:.2f} deg",
            found=f"{np.degrees(poses.q_rad[k, i]):.2f} deg",
        )
