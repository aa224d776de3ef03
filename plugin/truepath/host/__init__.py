"""The face towards a Drake host: the plugin, the systems, and the real robot in the host's own context.

A host finds the plugin by its entry point, group ``drake_olp.plugins``, name ``truepath``. pydrake is imported when
something of it is used, not before.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from truepath.host.calibrated_robot import CalibratedRobot, CalibratedRobot_
    from truepath.host.joint_correction import JointCorrection, JointCorrection_
    from truepath.host.plugin import CalibrationPlugin

__all__ = ["CalibratedRobot", "CalibratedRobot_", "CalibrationPlugin", "JointCorrection", "JointCorrection_"]

_MODULES = {
    "CalibrationPlugin": "plugin",
    "JointCorrection": "joint_correction",
    "JointCorrection_": "joint_correction",
    "CalibratedRobot": "calibrated_robot",
    "CalibratedRobot_": "calibrated_robot",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
