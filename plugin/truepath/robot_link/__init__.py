"""A Universal Robot over ``ur_rtde``, in child processes that can be killed.

What is named here is imported when it is asked for: the children are parts of this package and start without it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from truepath.robot_link.fault import ControlLost, RobotFault
    from truepath.robot_link.link import RobotLink
    from truepath.robot_link.state import RobotState

__all__ = ["ControlLost", "RobotFault", "RobotLink", "RobotState"]
PLACES = {"ControlLost": "fault", "RobotFault": "fault", "RobotLink": "link", "RobotState": "state"}


def __getattr__(name: str) -> Any:
    if name not in PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{PLACES[name]}"), name)
