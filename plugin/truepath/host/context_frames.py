"""The real robot in a host's context: which frames of a plant are moved, where to, and back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath import lie
from truepath.arm import inboard_joints
from truepath.errors import InputError
from truepath.export import arm_frames, move_arm_frames
from truepath.lie import Array
from truepath.motions import BEFORE_THE_FLANGE, Moves

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import FixedOffsetFrame
    from pydrake.systems.framework import Context

    from truepath.host.arm_in_plant import ArmInPlant
    from truepath.host.placed_robot import PlacedRobot
    from truepath.model import CalibratedModel

NOTHING = 1e-12  # m and entries of a rotation: frames that differ by less are the same
TRIAL_M = 0.001


@dataclass(frozen=True)
class AppliedFrames:
    """What was set on a context.

    Attributes:
        frames: names of the frames that were moved.
        base: ``as drawn``: no calibration of it, or not wanted; ``frame``: the frame that the base is welded to was
            moved; ``joints``: that frame cannot be moved, so the arm from its first joint on was, and the body of
            the base stays as drawn.
        tool: ``as drawn`` on the flange, or ``frame``: the frame by which it is mounted was moved.
        left_out: what the calibration knows and no frame can carry; ``JointCorrection`` and ``CalibratedRobot`` do.
    """

    frames: tuple[str, ...]
    base: str
    tool: str
    left_out: tuple[str, ...]


def apply_frames(robot: PlacedRobot, context: Context, *, base: bool, tool: bool) -> AppliedFrames:
    """Sets the frames of a calibration on the plant's context; see ``CalibrationPlugin.apply``."""
    place, model = _place(robot), robot.model
    reset_frames(place, context)
    try:
        moved, base_how, tool_how = _set_frames(robot, place, context, base, tool)
    except InputError:
        reset_frames(place, context)  # nothing by halves
        raise
    names = tuple(frame.scoped_name().get_full() for frame in moved)
    return AppliedFrames(names, base_how, tool_how, left_out(model))


def _set_frames(
    robot: PlacedRobot, place: ArmInPlant, context: Context, base: bool, tool: bool
) -> tuple[list[FixedOffsetFrame], str, str]:
    plant, arm = place.plant, place.arm
    X_BB, base_how, tool_how = lie.invert(robot.X_WB) @ robot.X_WB_real, "as drawn", "as drawn"
    moved = list(arm_frames(plant, arm))
    if base and not _same(X_BB, np.eye(4)):
        mount, base_how = _base_mount(place), "joints"
        if mount is not None:
            base_how = "frame"
            X_WG = mount.CalcPoseInWorld(context).GetAsMatrix4()
            _set_in_world(mount, context, robot.X_WB_real @ lie.invert(robot.X_WB) @ X_WG)
            moved.append(mount)
    move_arm_frames(robot.model, plant, arm, context, X_BB=X_BB if base_how == "joints" else None)
    if tool and place.tool is not None:
        X_FT = place.tool.CalcPose(context, arm.flange).GetAsMatrix4()
        if not _same(X_FT, robot.X_FT_real):
            moved.append(_move_tool(robot, place, context))
            tool_how = "frame"
    return moved, base_how, tool_how


def reset_frames(place: ArmInPlant, context: Context) -> None:
    """Sets all frames that a calibration may have moved back to the plant's defaults."""
    mount = _base_mount(place)
    for frame in [*arm_frames(place.plant, place.arm), *_tool_mounts(place), *([] if mount is None else [mount])]:
        _set_default(place.plant, frame, context)


def left_out(model: CalibratedModel) -> tuple[str, ...]:
    """Names of what a calibration knows of the robot and no frame can carry."""
    kinds = (Moves.JOINT, *BEFORE_THE_FLANGE)
    names = dict.fromkeys(part.term.effect for part in model.effects if part.term.moves in kinds)
    return (*names, *(() if model.residual is None else ("network",)))


def _place(robot: PlacedRobot) -> ArmInPlant:
    if robot.place is None:
        raise InputError("there is no plant whose frames could be set", expected="a plugin on a host's plant")
    return robot.place


def _same(X: Array, Y: Array) -> bool:
    return bool(np.abs(X - Y).max() < NOTHING)


def _set_default(plant: MultibodyPlant, frame: FixedOffsetFrame, context: Context) -> None:
    frame.SetPoseInParentFrame(context, frame.GetPoseInParentFrame(plant.CreateDefaultContext()))


def _set_in_world(frame: FixedOffsetFrame, context: Context, X_WG: Array) -> None:
    """Moves a frame to a pose ``(4, 4)``, whatever frame it is counted from."""
    from pydrake.math import RigidTransform, RotationMatrix

    X_PG = frame.GetPoseInParentFrame(context).GetAsMatrix4()
    X_WP = frame.CalcPoseInWorld(context).GetAsMatrix4() @ lie.invert(X_PG)
    X = lie.invert(X_WP) @ X_WG
    R = RotationMatrix.ProjectToRotationMatrix(X[:3, :3])  # without the last rounding
    frame.SetPoseInParentFrame(context, RigidTransform(R, X[:3, 3]))


# --- the base -------------------------------------------------------------------------------------------


def _base_mount(place: ArmInPlant) -> FixedOffsetFrame | None:
    """The frame by which the base is welded to what it stands on, if it can be moved and nothing else hangs on it."""
    from pydrake.multibody.tree import FixedOffsetFrame

    plant, arm = place.plant, place.arm
    for joint in _welds_inboard(plant, arm.base.body()):
        frame = joint.frame_on_parent()
        if isinstance(frame, FixedOffsetFrame) and _carries_only(place, frame):
            return frame
    return None


def _carries_only(place: ArmInPlant, mount: FixedOffsetFrame) -> bool:
    """Whether nothing moves with a frame but the arm, and what the arm carries: it is tried."""
    from pydrake.multibody.tree import FrameIndex

    plant = place.plant
    context = plant.CreateDefaultContext()
    frames = [plant.get_frame(FrameIndex(index)) for index in range(plant.num_frames())]
    others = [frame for frame in frames if frame.index() != mount.index() and not _belongs(place, frame.body())]
    before = [frame.CalcPoseInWorld(context).GetAsMatrix4() for frame in others]
    X_WG = mount.CalcPoseInWorld(context).GetAsMatrix4()
    X_WG[:3, 3] += TRIAL_M
    _set_in_world(mount, context, X_WG)
    return all(_same(frame.CalcPoseInWorld(context).GetAsMatrix4(), X) for frame, X in zip(others, before, strict=True))


def _belongs(place: ArmInPlant, body: Any) -> bool:
    """Whether a body is of the arm's own model, or carried by the arm."""
    from pydrake.multibody.tree import JointIndex

    plant, base = place.plant, place.arm.base.body()
    inboard = inboard_joints(plant)
    while body.index() != base.index():
        if body.model_instance() == place.arm.instance:
            return True
        j = inboard.get(int(body.index()))
        if j is None:
            return False
        body = plant.get_joint(JointIndex(j)).parent_body()
    return True


# --- the tool -------------------------------------------------------------------------------------------


def _move_tool(robot: PlacedRobot, place: ArmInPlant, context: Context) -> FixedOffsetFrame:
    assert place.tool is not None
    mounts = _tool_mounts(place)
    if not mounts:
        raise InputError(
            f"the tool frame {place.tool.name()!r} cannot be set to where it is on the real flange",
            expected="a tool that hangs on the flange by a FixedOffsetFrame, as plant.AddFrame(FixedOffsetFrame(name, "
            "flange, X_FG)) and plant.WeldFrames(that frame, tool) make one; or tool=False to leave it as drawn",
            found="a weld without a frame of its own, whose pose is no parameter of a context",
        )
    mount, arm = mounts[0], place.arm
    X_GT = place.tool.CalcPose(context, mount).GetAsMatrix4()
    X_WF = arm.flange.CalcPoseInWorld(context).GetAsMatrix4()
    _set_in_world(mount, context, X_WF @ robot.X_FT_real @ lie.invert(X_GT))
    return mount


def _tool_mounts(place: ArmInPlant) -> list[FixedOffsetFrame]:
    """Frames between flange and tool frame that can be moved, from the flange outwards."""
    from pydrake.multibody.tree import FixedOffsetFrame

    if place.tool is None:
        return []
    plant, arm = place.plant, place.arm
    last_link = arm.joints[-1].child_body()
    to_the_flange = {int(joint.index()) for joint in _welds_inboard(plant, arm.flange.body(), last_link)}
    welds = [
        joint
        for joint in _welds_inboard(plant, place.tool.body(), last_link)
        if int(joint.index()) not in to_the_flange
    ]
    taken = {int(frame.index()) for frame in (*arm_frames(plant, arm), arm.flange)}
    frames = [*(joint.frame_on_parent() for joint in reversed(welds)), place.tool]
    return [frame for frame in frames if isinstance(frame, FixedOffsetFrame) and int(frame.index()) not in taken]


def _welds_inboard(plant: MultibodyPlant, body: Any, until: Any = None) -> Iterator[Any]:
    """Welds from a body towards the world, up to another body."""
    from pydrake.multibody.tree import JointIndex

    inboard = inboard_joints(plant)
    while (until is None or body.index() != until.index()) and (j := inboard.get(int(body.index()))) is not None:
        joint = plant.get_joint(JointIndex(j))
        if joint.type_name() != "weld":
            return
        yield joint
        body = joint.parent_body()
