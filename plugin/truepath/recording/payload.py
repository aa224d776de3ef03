"""What is written down as payload: the mass on the flange beyond what the robot's model carries."""

from __future__ import annotations

from truepath.deploying.load import MASS_TOLERANCE_KG, bare_arm
from truepath.robot import NominalRobot
from truepath.robot_link import RobotFault, RobotState


def extra_payload_kg(state: RobotState, robot: NominalRobot) -> float:
    """What the controller is set to, less the tool of the model.

    Raises:
        RobotFault: the controller does not tell, or is set to less than the model carries.
    """
    if state.payload_kg is None:
        raise RobotFault("the controller does not tell its payload: give --payload-kg")
    bare = bare_arm(robot)
    tool_kg = 0.0 if bare is None else float(robot.link_mass_kg[-1] - bare.link_mass_kg[-1])
    if state.payload_kg < tool_kg - MASS_TOLERANCE_KG:
        raise RobotFault(
            f"the controller is set to a payload of {state.payload_kg:.2f} kg, but the model {robot.name} carries a "
            f"tool of {tool_kg:.2f} kg: set the payload, or give --payload-kg"
        )
    return max(state.payload_kg - tool_kg, 0.0)
