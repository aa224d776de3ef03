"""One arm in a host's plant: where its joints are among all positions, and the tool that it carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath.arm import Arm, inboard_joints, locate_arm
from truepath.errors import InputError
from truepath.lie import Array
from truepath.robot import NominalRobot, describe_arm, zero_context

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame, ModelInstanceIndex
    from pydrake.systems.framework import Context


@dataclass(frozen=True, eq=False)
class ArmInPlant:
    """An arm whose base stands still, in a plant that may hold anything else besides.

    Attributes:
        plant: the host's, finalized.
        arm: where it is in there.
        robot: the same as a nominal robot.
        positions, velocities: ``(n,)`` where its joints are among the plant's positions and velocities.
        tool: frame that moves rigidly with the flange; None: the flange itself.
        X_FT: ``(4, 4)`` nominal pose of that frame on the flange.
    """

    plant: MultibodyPlant
    arm: Arm
    robot: NominalRobot
    positions: Array
    velocities: Array
    tool: Frame | None
    X_FT: Array

    @classmethod
    def find(
        cls,
        plant: MultibodyPlant,
        model_instance: ModelInstanceIndex | str | None = None,
        tool_frame: Frame | str | None = None,
        base_frame: str | None = None,
        flange_frame: str | None = None,
    ) -> ArmInPlant:
        """Finds it; arguments as ``CalibrationPlugin`` has them.

        Raises:
            InputError: as ``arm.locate_arm``; a base that moves; a tool that is not fixed to the flange.
        """
        if not plant.is_finalized():
            raise InputError("the plant is not finalized", expected="call plant.Finalize() first")
        instance = _instance(plant, model_instance) if isinstance(model_instance, str) else model_instance
        arm = locate_arm(
            plant, model_instance=instance, base_frame=base_frame, flange_frame=flange_frame, carried=tool_frame
        )
        if not plant.IsAnchored(arm.base.body()):
            raise InputError(
                f"the base {arm.base.scoped_name().get_full()!r} of the arm moves",
                expected="a base that is welded to the world, directly or through other bodies",
            )
        tool = _tool(plant, arm, tool_frame)
        X_FT = np.eye(4) if tool is None else tool.CalcPose(zero_context(plant, arm), arm.flange).GetAsMatrix4()
        return cls(
            plant=plant,
            arm=arm,
            robot=describe_arm(plant, arm),
            positions=np.array([joint.position_start() for joint in arm.joints]),
            velocities=np.array([joint.velocity_start() for joint in arm.joints]),
            tool=tool,
            X_FT=X_FT,
        )

    def context_of_the_plant(self, context: Context) -> Context:
        """The plant's own context, out of that of any diagram around it; the plant's own as it is.

        Raises:
            InputError: a context of something else.
        """
        from pydrake.systems.framework import Context

        if not isinstance(context, Context):  # of None Drake would make an end of the whole process
            raise _foreign(type(context).__name__)
        try:
            self.plant.ValidateContext(context)
            return context
        except RuntimeError:
            pass
        try:
            own = self.plant.GetMyMutableContextFromRoot(context)
            self.plant.ValidateContext(own)  # a plant without a diagram takes any
            return own
        except RuntimeError as error:
            raise _foreign(str(error).splitlines()[0]) from None


def _foreign(found: str) -> InputError:
    return InputError(
        "this context does not belong to the plant",
        expected="the context of the plugin's plant, or of the diagram that holds it",
        found=found,
    )


def is_carried_by(plant: MultibodyPlant, frame: Frame, arm: Arm) -> bool:
    """Whether a frame moves rigidly with the flange."""
    from pydrake.multibody.tree import JointIndex

    inboard, last = inboard_joints(plant), int(arm.joints[-1].index())
    j = inboard.get(int(frame.body().index()))
    while j is not None and j != last and plant.get_joint(JointIndex(j)).type_name() == "weld":
        j = inboard.get(int(plant.get_joint(JointIndex(j)).parent_body().index()))
    return j == last


def _instance(plant: MultibodyPlant, name: str) -> ModelInstanceIndex:
    from pydrake.multibody.tree import ModelInstanceIndex

    if not plant.HasModelInstanceNamed(name):
        names = [plant.GetModelInstanceName(ModelInstanceIndex(i)) for i in range(plant.num_model_instances())]
        raise InputError(f"no model called {name!r} in the plant", expected="one of " + ", ".join(names))
    return plant.GetModelInstanceByName(name)


def _tool(plant: MultibodyPlant, arm: Arm, tool: Frame | str | None) -> Frame | None:
    from pydrake.multibody.tree import FrameIndex

    if tool is None:
        return None
    if not isinstance(tool, str):
        if not is_carried_by(plant, tool, arm):
            raise _not_a_tool(plant, arm, tool.name())
        return tool
    frames = [plant.get_frame(FrameIndex(index)) for index in range(plant.num_frames())]
    found = [frame for frame in frames if frame.name() == tool and is_carried_by(plant, frame, arm)]
    if len(found) != 1:
        raise _not_a_tool(plant, arm, tool, len(found))
    return found[0]


def _not_a_tool(plant: MultibodyPlant, arm: Arm, name: str, count: int = 0) -> InputError:
    from pydrake.multibody.tree import FrameIndex

    frames = [plant.get_frame(FrameIndex(index)) for index in range(plant.num_frames())]
    names = [frame.name() for frame in frames if frame.name() and is_carried_by(plant, frame, arm)]
    return InputError(
        f"there are {count} frames {name!r} on this flange" if count else f"no frame {name!r} is fixed to this flange",
        expected="a frame that moves rigidly with it: one of " + ", ".join(names),
    )
