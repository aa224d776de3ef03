"""The calibrated robot where it stands in the host's world."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from truepath import lie
from truepath.calibration import Calibration
from truepath.errors import InputError
from truepath.host.calibrating import Calibrating
from truepath.lie import Array
from truepath.model import CalibratedModel, nominal_flange_poses
from truepath.region import Region

if TYPE_CHECKING:
    from pydrake.systems.framework import Context

    from truepath.host.arm_in_plant import ArmInPlant


@dataclass(frozen=True, eq=False)
class PlacedRobot:
    """Frames: W world, B base, F flange, T tool.

    Where the calibration knows a base that was stated, the real base stands off from it by what was measured; a base
    that was only fitted (measured from a tracker that stood anywhere) says nothing of the world and stays as drawn.
    Likewise for a stated probe: by what it is off on the flange, the tool is.

    Attributes:
        model: the calibrated robot.
        region: of joints that were measured.
        X_WB, X_FT: ``(4, 4)`` base and tool as the host has them.
        place: the arm in the host's plant; None: there is no plant.
        X_WB_real, X_FT_real: ``(4, 4)`` the same as they are.
        knows_base, knows_tool: whether the calibration tells these two apart from where the host has them.
    """

    model: CalibratedModel
    region: Region
    X_WB: Array
    X_FT: Array
    place: ArmInPlant | None = None
    X_WB_real: Array = field(init=False)
    X_FT_real: Array = field(init=False)

    def __post_init__(self) -> None:
        X_BB, X_FF = self.model.goal_frames()  # both from the real frame to the nominal one
        object.__setattr__(self, "X_WB_real", self.X_WB @ lie.invert(X_BB))
        object.__setattr__(self, "X_FT_real", lie.invert(X_FF) @ self.X_FT)

    @property
    def knows_base(self) -> bool:
        return self.model.base_is_given

    @property
    def knows_tool(self) -> bool:
        return self.model.tool_is_given

    @classmethod
    def of(cls, source: Calibrating | Calibration, context: Context | None = None) -> PlacedRobot:
        """Out of a plugin, or of a calibration alone: then with the base where its model's world has it, and no tool.

        Args:
            context: of the plugin's plant: for where base and tool are, if the calibration does not know them. None:
                as the plant has them by default.

        Raises:
            InputError: a plugin without a calibration, or something else.
        """
        if isinstance(source, Calibration):
            model, region = source.model, source.region.region()
            return cls(model, region, model.robot.X_WB, np.eye(4))
        if not isinstance(source, Calibrating):
            raise InputError("this knows no calibration", expected="a plugin or a calibration", found=repr(source)[:80])
        calibration, place = source.calibration, source.place
        if calibration is None:
            raise InputError("the plugin has no calibration", expected="calibrate, load or use one first")
        robot = cls(calibration.model, calibration.region.region(), place.robot.X_WB, place.X_FT, place)
        return robot if context is None else robot._standing_in(context)

    def _standing_in(self, context: Context) -> PlacedRobot:
        """The same with base and tool where a context of the plant has them, as far as nothing else is known."""
        from truepath.host.context_frames import context_as_drawn

        place = self.place
        assert place is not None, "a robot in a host's plant"
        own, X_FT = context_as_drawn(self, context), self.X_FT
        if place.tool is not None:
            X_FT = place.tool.CalcPose(own, place.arm.flange).GetAsMatrix4()
        return replace(self, X_WB=place.arm.base.CalcPoseInWorld(own).GetAsMatrix4(), X_FT=X_FT)

    def flange_poses(self, q_rad: Array) -> Array:
        """``(N, 4, 4)`` real poses X_WF for commanded joints ``(N, n)``."""
        return self.X_WB_real @ self.model.flange_poses(q_rad)

    def tool_poses(self, q_rad: Array) -> Array:
        """``(N, 4, 4)`` real poses X_WT for commanded joints ``(N, n)``."""
        return self.flange_poses(q_rad) @ self.X_FT_real

    def programmed_tool_poses(self, q_rad: Array) -> Array:
        """``(N, 4, 4)`` poses X_WT that a program with joints ``(N, n)`` means."""
        return self.X_WB @ nominal_flange_poses(self.model.robot, q_rad) @ self.X_FT
