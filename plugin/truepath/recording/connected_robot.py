"""Whether the robot behind the address is built as the one that the poses were looked at for."""

from __future__ import annotations

from truepath.controller import controller_of
from truepath.deploying.checks import another_robot_obstacles, model_told
from truepath.robot import NominalRobot
from truepath.robot_link import RobotFault, RobotLink
from truepath.robot_link.tool import tcp_on_controller


def require_same_robot(link: RobotLink, robot: NominalRobot) -> str:
    """Compares where a robot, which must be free, has its tool with where the drawn robot would have it.

    Returns:
        Why they cannot be compared; empty if they were, and are the same.

    Raises:
        RobotFault: another robot stands there, or it does not answer.
    """
    controller = controller_of(robot)
    if controller.kinematics is robot:  # where its controller has base and flange nobody knows
        told = model_told(link)
        return f"nobody can tell whether this is a {robot.name}, which is not as any Universal Robot is published" + (
            f": it says that it is a {told}" if told else ""
        )
    tcp = tcp_on_controller(link)
    obstacles = another_robot_obstacles(controller, robot.name, link.state(), tcp, model_told(link))
    if obstacles:
        raise RobotFault(obstacles[0])
    return ""
