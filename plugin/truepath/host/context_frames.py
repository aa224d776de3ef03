"""The real robot in a host's context: which frames of a plant are moved, where to, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from truepath import lie
from truepath.arm import inboard_joints
from truepath.errors import InputError
from truepath.export import flange_mount, joint_frames, move_arm_frames
from truepath.lie import Array
from truepath.motions import BEFORE_THE_FLANGE, Moves
from truepath.mounts import Mount, mounts_on_the_way, welds_inboard

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import FixedOffsetFrame, Frame
    from pydrake.systems.framework import Context

    from truepath.host.arm_in_plant import ArmInPlant
    from truepath.host.placed_robot import PlacedRobot
    from truepath.model import CalibratedModel

NOTHING = 1e-12  # m and entries of a rotation: frames that differ by less are the same
TRIAL_M = 0.001
WITH_FLANGE: Literal["with flange"] = "with flange"
ToolWay = bool | Literal["with flange"]


@dataclass(frozen=True)
class AppliedFrames:
    """What was set on a context.

    Attributes:
        frames: names of the frames that were moved.
        base: ``as drawn``: no calibration of it, or not wanted, so that it stays as the context has it; ``frame``: the
            frame that the base is welded to was moved; ``joints``: that frame cannot be moved, so the arm from its
            first joint on was, and the body of the base stays as drawn.
        tool: ``as drawn`` on the flange, or as the context has it there; ``frame``: what holds the tool was moved, and
            all of the tool with it; ``frame alone``: the tool frame was moved, and the body that it is on, with its
            shapes, stays as drawn on the flange; ``with flange``: flange and tool were moved as one, so that the tool
            is right.
        left_out: what the calibration knows and no frame can carry; ``JointCorrection`` and ``CalibratedRobot`` do.
        flange: ``frame``: it is where the calibration has it; ``with tool``: it was moved as one with the tool;
            ``as drawn``: on the last link, whose axis is right, because nothing between them can be moved.
    """

    frames: tuple[str, ...]
    base: str
    tool: str
    left_out: tuple[str, ...]
    flange: str = "frame"


def apply_frames(robot: PlacedRobot, context: Context, *, base: bool, tool: ToolWay) -> AppliedFrames:
    """Sets the frames of a calibration on the plant's context; see ``CalibrationPlugin.apply``."""
    if tool not in (True, False, WITH_FLANGE):
        raise InputError("unknown way to set the tool", expected=f"True, False or {WITH_FLANGE!r}", found=repr(tool))
    place = _place(robot)
    frames = _movable(place, base=True, tool=True)
    before = [frame.GetPoseInParentFrame(context) for frame in frames]
    try:
        return _set_frames(robot, place, context, base, tool)
    except InputError:
        for frame, X_PF in zip(frames, before, strict=True):  # nothing by halves
            frame.SetPoseInParentFrame(context, X_PF)
        raise


def _set_frames(robot: PlacedRobot, place: ArmInPlant, context: Context, base: bool, tool: ToolWay) -> AppliedFrames:
    plant, arm, knows_tool = place.plant, place.arm, tool is not False and robot.knows_tool
    reset_frames(place, context, base=base and robot.knows_base, tool=knows_tool)
    X_FT = robot.X_FT_real
    if place.tool is not None and not knows_tool:
        X_FT = place.tool.CalcPose(context, arm.flange).GetAsMatrix4()
    X_BB, base_how = np.eye(4), "as drawn"
    moved = list(joint_frames(arm))
    if base and not _same(robot.X_WB, robot.X_WB_real):
        mount, base_how = _base_mount(place), "joints"
        if mount is not None:
            base_how = "frame"
            mount.move(context, robot.X_WB_real @ lie.invert(robot.X_WB))
            moved.append(mount.frame)
        else:
            X_BB = lie.invert(robot.X_WB) @ robot.X_WB_real
    move_arm_frames(robot.model, plant, arm, context, X_BB=X_BB)
    by_which = flange_mount(plant, arm)
    flange_how = "as drawn" if by_which is None else "frame"
    if by_which is not None:
        moved.append(by_which.frame)
    tool_how = "as drawn"
    if tool is not False and place.tool is not None:
        X_WT = _real_flange(robot, place, context, X_BB) @ X_FT
        off = X_WT @ lie.invert(place.tool.CalcPoseInWorld(context).GetAsMatrix4())
        if not _same(off, np.eye(4)):
            mount, tool_how = _tool_mount(place, tool, X_WT[:3, 3] - place.tool.CalcPoseInWorld(context).translation())
            mount.move(context, off)
            if tool_how == WITH_FLANGE:
                flange_how = "with tool"
            else:
                moved.append(mount.frame)
    names = tuple(frame.scoped_name().get_full() for frame in moved)
    return AppliedFrames(names, base_how, tool_how, left_out(robot.model), flange_how)


def reset_frames(place: ArmInPlant, context: Context, *, base: bool = True, tool: bool = True) -> None:
    """Sets all frames that a calibration may have moved back to the plant's defaults; those of base and tool if asked.

    All but these belong to the arm itself: its joints and its flange.
    """
    default = place.plant.CreateDefaultContext()
    for frame in _movable(place, base, tool):
        frame.SetPoseInParentFrame(context, frame.GetPoseInParentFrame(default))


def context_as_drawn(robot: PlacedRobot, context: Context | None) -> Context:
    """A context of its own: all as in another one (None: the plant's defaults), the arm as if nothing were calibrated.

    Base and tool are as drawn where the calibration knows them; where it does not, as the other context has them.
    """
    place = _place(robot)
    own = place.plant.CreateDefaultContext()
    if context is not None:
        own.SetTimeStateAndParametersFrom(context)
        reset_frames(place, own, base=robot.knows_base, tool=robot.knows_tool)
    return own


def _movable(place: ArmInPlant, base: bool, tool: bool) -> list[FixedOffsetFrame]:
    from pydrake.multibody.tree import FixedOffsetFrame

    mounts = [flange_mount(place.plant, place.arm)]
    mounts += _tool_mounts(place) if tool else []
    mounts += [_base_mount(place)] if base else []
    frames = [joint.frame_on_parent() for joint in place.arm.joints]
    frames += [mount.frame for mount in mounts if mount is not None]
    return [frame for frame in frames if isinstance(frame, FixedOffsetFrame)]


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


def _real_flange(robot: PlacedRobot, place: ArmInPlant, context: Context, X_BB: Array) -> Array:
    """``(4, 4)`` X_WF of the rigid part of the calibration, fixed to the last link, at the context's joints.

    Args:
        X_BB: ``(4, 4)`` where the base stands, seen from where its body stands in the context.
    """
    zero = place.plant.CreateDefaultContext()
    zero.SetTimeStateAndParametersFrom(context)
    for joint in place.arm.joints:
        joint.set_angle(zero, 0.0)
    link = place.arm.joints[-1].child_body().body_frame()
    X_WF_zero = place.arm.base.CalcPoseInWorld(zero).GetAsMatrix4() @ X_BB @ robot.model.robot.X_BF
    X_LF = lie.invert(link.CalcPoseInWorld(zero).GetAsMatrix4()) @ X_WF_zero
    return link.CalcPoseInWorld(context).GetAsMatrix4() @ X_LF


# --- the base -------------------------------------------------------------------------------------------


def _base_mount(place: ArmInPlant) -> Mount | None:
    """The frame by which the base is welded to what it stands on, if it can be moved and nothing else hangs on it."""
    from pydrake.multibody.tree import FixedOffsetFrame

    for joint in welds_inboard(place.plant, place.arm.base.body()):
        frame = joint.frame_on_parent()
        if isinstance(frame, FixedOffsetFrame):
            mount = Mount(frame, joint.child_body())
            if _carries_only(place, mount):
                return mount
    return None


def _carries_only(place: ArmInPlant, mount: Mount) -> bool:
    """Whether nothing moves with a frame but the arm, and what the arm carries: it is tried."""
    from pydrake.multibody.tree import FrameIndex

    plant = place.plant
    context = plant.CreateDefaultContext()
    frames = [plant.get_frame(FrameIndex(index)) for index in range(plant.num_frames())]
    others = [frame for frame in frames if frame.index() != mount.frame.index() and not _belongs(place, frame.body())]
    before = [frame.CalcPoseInWorld(context).GetAsMatrix4() for frame in others]
    mount.move(context, lie.make_pose(translation=np.full(3, TRIAL_M)))
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


def _tool_mount(place: ArmInPlant, how: ToolWay, off_m: Array) -> tuple[Mount, str]:
    """By what the tool is moved, and how that is told."""
    assert place.tool is not None
    if how == WITH_FLANGE:
        mount = flange_mount(place.plant, place.arm)
        if mount is not None and _holds(place.plant, mount, place.tool):
            return mount, WITH_FLANGE
    elif mounts := _tool_mounts(place):
        on_the_flange = place.tool.body().index() == place.arm.flange.body().index()
        return mounts[0], "frame" if mounts[0].held is not None or on_the_flange else "frame alone"
    raise InputError(
        f"the tool frame {place.tool.name()!r} cannot be set to where it is on the real flange, "
        f"{1e3 * np.linalg.norm(off_m):.3f} mm away",
        expected="a tool that hangs on the flange by a FixedOffsetFrame, as plant.AddFrame(FixedOffsetFrame(name, "
        "flange, X_FG)) and plant.WeldFrames(that frame, tool) make one; or tool=False, which sets all the rest and "
        f"leaves the tool as drawn; or tool={WITH_FLANGE!r}, which moves flange and tool as one where the flange hangs "
        "on the last link by such a frame",
        found="a weld without a frame of its own, whose pose is no parameter of a context",
    )


def _tool_mounts(place: ArmInPlant) -> list[Mount]:
    """What can be moved between flange and tool frame, from the flange outwards."""
    if place.tool is None:
        return []
    plant, arm = place.plant, place.arm
    last_link, own = arm.joints[-1].child_body(), flange_mount(plant, arm)
    to_the_flange = {int(mount.frame.index()) for mount in mounts_on_the_way(plant, arm.flange, last_link)}
    taken = {*to_the_flange, int(arm.flange.index()), *([] if own is None else [int(own.frame.index())])}
    mounts = mounts_on_the_way(plant, place.tool, last_link)
    return [mount for mount in mounts if int(mount.frame.index()) not in taken]


def _holds(plant: MultibodyPlant, mount: Mount, frame: Frame) -> bool:
    """Whether a frame moves with a mount: it is tried."""
    context = plant.CreateDefaultContext()
    before = frame.CalcPoseInWorld(context).GetAsMatrix4()
    mount.move(context, lie.make_pose(translation=np.full(3, TRIAL_M)))
    return not _same(frame.CalcPoseInWorld(context).GetAsMatrix4(), before)
