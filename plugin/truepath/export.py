"""The calibrated kinematics for other tools: as a URDF, or set on a Drake plant's context.

Both carry the rigid part of the calibration, the axis deviations. In both, each joint frame moves to where
the axis really is, and the flange keeps its place on the last link at zero configuration, so that
``X_BF(q) = exp(xi_1' q_1) ... exp(xi_n' q_n) M`` as in ``poe``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truepath import lie, poe
from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.mounts import Mount, mounts_on_the_way
from truepath.same_robot import require_same_robot

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import FixedOffsetFrame, ModelInstanceIndex
    from pydrake.systems.framework import Context

    from truepath.arm import Arm

DRAKE_NAMESPACE = "http://drake.mit.edu"
WORLD = "world"


def joint_motions(model: CalibratedModel) -> Array:
    """``(n, 4, 4)`` by which each joint frame moves at zero configuration, as a motion in the base frame."""
    return poe.calibrated_axes(model.robot, model.p) @ lie.invert(model.robot.X_BA)


# --- a host's plant -------------------------------------------------------------------------------------


def set_calibrated_frames(
    model: CalibratedModel,
    plant: MultibodyPlant,
    context: Context,
    *,
    model_instance: ModelInstanceIndex | None = None,
    flange_frame: str | None = None,
) -> None:
    """Sets the calibrated frames on a host's plant context; nothing is rebuilt, other contexts stay nominal.

    Drake's own inverse kinematics, collision checks and planners then see the real robot, its rigid part.

    Args:
        model: calibration of an arm like the one in the plant.
        plant: finalized.
        context: of that plant; its frame parameters change, its state does not.
        model_instance, flange_frame: as for ``arm.locate_arm``.

    Raises:
        InputError: the arm in the plant is not the calibrated one, or a frame cannot be moved.
    """
    from truepath.arm import locate_arm
    from truepath.robot import describe_arm

    arm = locate_arm(plant, model_instance=model_instance, flange_frame=flange_frame)
    require_same_robot(model.robot, describe_arm(plant, arm), "the plant's arm is not the calibrated robot")
    if flange_mount(plant, arm) is None:
        raise InputError(
            f"the flange {arm.flange.name()!r} cannot be moved in a context",
            expected="a flange that hangs on the last link by a FixedOffsetFrame, as Drake's URDF parser makes for the "
            "origin of every joint",
            found="the frame of a body; give the flange a frame of its own",
        )
    move_arm_frames(model, plant, arm, context)


def move_arm_frames(
    model: CalibratedModel, plant: MultibodyPlant, arm: Arm, context: Context, *, X_BB: Array | None = None
) -> None:
    """The same for an arm that was found already and is the calibrated robot.

    A flange without a mount stays as drawn on the last link, whose axis is set.

    Args:
        X_BB: ``(4, 4)`` where the base stands, seen from where its body stands in the plant, which itself is not
            moved: the whole arm beyond it is. None: there.
    """
    from pydrake.math import RigidTransform

    from truepath.robot import zero_context

    X_BB = np.eye(4) if X_BB is None else X_BB
    zero = zero_context(plant, arm)
    X_WB = arm.base.CalcPoseInWorld(zero).GetAsMatrix4()
    # All of a link moves with its axis; in the link's own coordinates only the difference of two motions remains.
    motion_of_body, found = np.eye(4), []
    for frame, motion in zip(joint_frames(arm), X_BB @ joint_motions(model), strict=True):
        X_BBody = lie.invert(X_WB) @ frame.body().body_frame().CalcPoseInWorld(zero).GetAsMatrix4()
        X_BodyF = frame.CalcPoseInBodyFrame(zero).GetAsMatrix4()
        X_PF = frame.GetPoseInParentFrame(zero).GetAsMatrix4()
        X_BodyF_moved = lie.invert(motion_of_body @ X_BBody) @ motion @ X_BBody @ X_BodyF
        X_PF_moved = X_PF @ lie.invert(X_BodyF) @ X_BodyF_moved
        X_PF_moved[:3, :3] = lie.nearest_rotation(X_PF_moved[:3, :3])
        found.append((frame, RigidTransform(X_PF_moved)))
        motion_of_body = motion
    for frame, X_PF_new in found:
        for each in (zero, context):
            frame.SetPoseInParentFrame(each, X_PF_new)
    mount = flange_mount(plant, arm)
    if mount is not None:
        X_WF = arm.flange.CalcPoseInWorld(zero).GetAsMatrix4()
        mount.move(zero, X_WB @ X_BB @ model.robot.X_BF @ lie.invert(X_WF))
        mount.frame.SetPoseInParentFrame(context, mount.frame.GetPoseInParentFrame(zero))


def joint_frames(arm: Arm) -> list[FixedOffsetFrame]:
    """The n frames of the joints that a calibration moves.

    Raises:
        InputError: one of them cannot be moved in a context.
    """
    from pydrake.multibody.tree import FixedOffsetFrame

    for joint in arm.joints:
        if not isinstance(joint.frame_on_parent(), FixedOffsetFrame):
            raise InputError(
                f"joint {joint.name()!r} cannot be moved in a context",
                expected="a joint on a FixedOffsetFrame of the link before it, as Drake's URDF parser makes for the "
                "origin of every joint; plant.AddJoint(RevoluteJoint(name, that frame, ...)) takes one",
                found=f"one right on the frame of body {joint.frame_on_parent().name()!r}",
            )
    return [joint.frame_on_parent() for joint in arm.joints]


def flange_mount(plant: MultibodyPlant, arm: Arm) -> Mount | None:
    """By what the flange hangs on the axis of the last joint, if that can be moved."""
    from pydrake.multibody.tree import FixedOffsetFrame

    last = arm.joints[-1]
    mounts = mounts_on_the_way(plant, arm.flange, last.child_body())
    if not mounts and isinstance(last.frame_on_child(), FixedOffsetFrame):
        mounts = [Mount(last.frame_on_child(), last.child_body(), on_held=True)]
    return mounts[0] if mounts else None


# --- a URDF ---------------------------------------------------------------------------------------------


def write_calibrated_urdf(model: CalibratedModel, urdf: str | Path, output: str | Path) -> None:
    """Writes a URDF like the robot's own, with every joint origin where the calibration found it.

    Args:
        model: the calibration.
        urdf: the robot's nominal URDF.
        output: file to write.

    Raises:
        InputError: the URDF is not that of the calibrated robot.
    """
    import yourdfpy

    description = yourdfpy.URDF.load(str(urdf), build_scene_graph=False, load_meshes=False)
    # Drake's base of the arm is the link that is fixed to the link ``world``, if there is such a link.
    inboard = {joint.child: joint for joint in description.robot.joints if joint.parent != WORLD}
    joints = [_joint(description, name, urdf) for name in model.robot.joint_names]
    joints.append(_flange_joint(model, joints[-1].child, inboard, urdf))
    moved, motion_of_link = [], np.eye(4)
    for joint, motion in zip(joints, [*joint_motions(model), np.eye(4)], strict=True):
        X_BLink = _zero_pose(joint.parent, inboard)
        moved.append(lie.invert(motion_of_link @ X_BLink) @ motion @ X_BLink @ _origin(joint))
        motion_of_link = motion
    for joint, origin in zip(joints, moved, strict=True):
        joint.origin = origin
    write_atomically(output, _to_xml(description, urdf))


def _joint(description: Any, name: str, urdf: str | Path) -> Any:
    for joint in description.robot.joints:
        if joint.name == name:
            return joint
    raise InputError("the URDF is not that of the calibrated robot", file=urdf, expected=f"a joint {name!r}")


def _flange_joint(model: CalibratedModel, last_link: str, inboard: dict[str, Any], urdf: str | Path) -> Any:
    """The fixed joint behind the last link on the way to the flange, which is found by its zero pose."""
    for child, joint in inboard.items():
        if joint.type != "fixed" or np.abs(_zero_pose(child, inboard) - model.robot.X_BF).max() > 1e-9:
            continue
        while joint.parent != last_link and joint.parent in inboard:
            joint = inboard[joint.parent]
        if joint.parent == last_link:
            return joint
    raise InputError(
        "the URDF has no flange that a calibration can move",
        file=urdf,
        expected=f"a link fixed to {last_link!r} where the calibrated robot has its flange",
    )


def _zero_pose(link: str, inboard: dict[str, Any]) -> Array:
    """Pose ``(4, 4)`` of a link in the base link, all joints at zero."""
    X = np.eye(4)
    while link in inboard:
        X = _origin(inboard[link]) @ X
        link = inboard[link].parent
    return X


def _origin(joint: Any) -> Array:
    return np.eye(4) if joint.origin is None else np.asarray(joint.origin)


def _to_xml(description: Any, urdf: str | Path) -> bytes:
    """The text, with the acceleration limits that Drake knows and yourdfpy does not."""
    from lxml import etree

    written = description.write_xml().getroot()
    root = etree.Element(written.tag, attrib=written.attrib, nsmap={"drake": DRAKE_NAMESPACE})
    root.extend(list(written))
    attribute = f"{{{DRAKE_NAMESPACE}}}acceleration"
    original = etree.parse(str(urdf), etree.XMLParser(resolve_entities=False, no_network=True))
    for joint in original.getroot().iterfind("joint"):
        limit, target = joint.find("limit"), root.find(f"joint[@name='{joint.get('name')}']/limit")
        if limit is not None and target is not None and attribute in limit.attrib:
            target.set(attribute, limit.get(attribute))
    return etree.tostring(root, xml_declaration=True, encoding="utf-8", pretty_print=True)
