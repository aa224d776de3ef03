"""Finding a serial arm of revolute joints in a Drake plant that may hold anything else besides."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from truepath.errors import InputError

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame, ModelInstanceIndex, RevoluteJoint, RigidBody

FLANGE_NAMES = ("flange", "tool0", "ee_link", "tool_flange")
OF_A_GRIPPER = re.compile("finger|gripper|knuckle|jaw|claw|thumb", re.IGNORECASE)
LEAST_RANGE_RAD = 1.6  # the last joint of an arm turns further


@dataclass(frozen=True)
class Arm:
    """Where the arm is in its plant: model instance, base and flange frame, revolute joints from base to flange."""

    instance: ModelInstanceIndex
    base: Frame
    flange: Frame
    joints: list[RevoluteJoint]


def locate_arm(
    plant: MultibodyPlant,
    *,
    model_instance: ModelInstanceIndex | None = None,
    base_frame: str | None = None,
    flange_frame: str | None = None,
    carried: str | Frame | None = None,
) -> Arm:
    """Finds the arm. A gripper in the same model is no part of it: its joints lie beyond the flange.

    Args:
        plant: finalized.
        model_instance: where the arm is; found by itself when exactly one instance has revolute joints.
        base_frame, flange_frame: names; by default the root of the arm's model, and the end of the chain
            (a frame called flange, tool0, ee_link or tool_flange, else the last link before ``carried``, else the
            last body).
        carried: a frame, or its name, that moves rigidly with the flange.

    Raises:
        InputError: plant not finalized, no arm or several, a joint of another type in the chain, or one at its end
            that looks like a gripper's.
    """
    if not plant.is_finalized():
        raise InputError("the plant is not finalized", expected="call plant.Finalize() first")
    instance = _find_instance(plant) if model_instance is None else model_instance
    flange = _named_frame(plant, flange_frame, instance) or _called_flange(plant, instance)
    is_clear = flange is not None
    if flange is None:
        link, end = _last_link_before(plant, carried, instance), _single_end(plant, instance)
        is_clear = link is not None
        same = link is not None and end is not None and _last_link(plant, end) == _last_link(plant, link)
        flange = end if end is not None and (link is None or same) else link
    if flange is None:
        raise _no_single_end(plant, instance)
    base = _named_frame(plant, base_frame, instance) or _root_frame(plant, flange, instance)
    joints = _chain(plant, base, flange)
    if not is_clear:
        _refuse_a_gripper(joints)
    return Arm(instance, base, flange, joints)


def _find_instance(plant: MultibodyPlant) -> ModelInstanceIndex:
    counts: dict[int, int] = {}
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.type_name() == "revolute":
            instance = int(joint.model_instance())
            counts[instance] = counts.get(instance, 0) + 1
    from pydrake.multibody.tree import ModelInstanceIndex

    names = [plant.GetModelInstanceName(ModelInstanceIndex(i)) for i in counts]
    if len(counts) != 1:
        raise InputError(
            "cannot tell which model in the plant is the arm",
            expected="exactly one model instance with revolute joints, or model_instance given",
            found=", ".join(names) or "no revolute joint",
        )
    return ModelInstanceIndex(next(iter(counts)))


def _named_frame(plant: MultibodyPlant, name: str | None, instance: ModelInstanceIndex) -> Frame | None:
    from pydrake.multibody.tree import FrameIndex

    if name is None:
        return None
    frames = [plant.get_frame(FrameIndex(index)) for index in range(plant.num_frames())]
    own = [frame for frame in frames if frame.model_instance() == instance]
    found = [frame for frame in own if frame.name() == name] or [frame for frame in frames if frame.name() == name]
    if len(found) != 1:
        raise InputError(
            f"no frame called {name!r} on the arm, and {len(found) or 'none'} elsewhere in the plant",
            expected="one of " + ", ".join(frame.name() for frame in own if frame.name()),
        )
    return found[0]


def _root_frame(plant: MultibodyPlant, flange: Frame, instance: ModelInstanceIndex) -> Frame:
    """Frame of the body from which the arm's own model starts, seen from its flange."""
    from pydrake.multibody.tree import JointIndex

    inboard, body = inboard_joints(plant), flange.body()
    while (j := inboard.get(int(body.index()))) is not None:
        joint = plant.get_joint(JointIndex(j))
        # A model may start with a joint right on the world: then that is where it stands.
        outside = joint.parent_body().model_instance() != instance
        if outside and joint.type_name() != "revolute":
            break
        body = joint.parent_body()
        if outside:
            break
    return body.body_frame()


def _called_flange(plant: MultibodyPlant, instance: ModelInstanceIndex) -> Frame | None:
    for name in FLANGE_NAMES:
        if plant.HasFrameNamed(name, instance):
            return plant.GetFrameByName(name, instance)
    return None


def _last_link_before(plant: MultibodyPlant, carried: str | Frame | None, instance: ModelInstanceIndex) -> Frame | None:
    """The link of the arm's model that carries a frame by welds alone; None where that is not clear."""
    from pydrake.multibody.tree import BodyIndex, FrameIndex

    if carried is None:
        return None
    if isinstance(carried, str):
        every = [plant.get_frame(FrameIndex(index)) for index in range(plant.num_frames())]
        frames = [frame for frame in every if frame.name() == carried]
    else:
        frames = [carried]
    found = {_last_link(plant, frame) for frame in frames} - {None}
    bodies = [plant.get_body(BodyIndex(index)) for index in found]
    own = [body for body in bodies if body.model_instance() == instance]
    return own[0].body_frame() if len(own) == 1 else None


def _last_link(plant: MultibodyPlant, frame: Frame) -> int | None:
    """The body, by its index, to which a frame is fixed and that a joint moves; None for what stands still."""
    from pydrake.multibody.tree import JointIndex

    inboard, body = inboard_joints(plant), frame.body()
    while (j := inboard.get(int(body.index()))) is not None:
        joint = plant.get_joint(JointIndex(j))
        if joint.type_name() != "weld":
            return int(body.index())
        body = joint.parent_body()
    return None


def _refuse_a_gripper(joints: list[RevoluteJoint]) -> None:
    """The end of a chain that nobody named: a finger there would be calibrated as if it were a joint of the arm."""
    doubtful = [
        k for k, joint in enumerate(joints) if OF_A_GRIPPER.search(f"{joint.name()} {joint.child_body().name()}")
    ]
    last = joints[-1]
    if last.position_upper_limits()[0] - last.position_lower_limits()[0] < LEAST_RANGE_RAD:
        doubtful.append(len(joints) - 1)
    if doubtful:
        first = max(min(doubtful), 1)
        beyond = ", ".join(repr(joint.name()) for joint in joints[first:])
        raise InputError(
            f"the joints at the end of the arm look like those of a gripper: {beyond}",
            expected=_where_the_arm_ends(joints[first - 1].child_body().name()),
            found=f"no frame called {', '.join(FLANGE_NAMES)}, so the chain was followed to "
            f"{last.child_body().name()!r}",
        )


def _where_the_arm_ends(link: str = "") -> str:
    such = f", as flange_frame={link!r}" if link else ""
    return f"flange_frame, the name of the frame or link where the arm ends{such}; or a tool_frame that it carries"


def _ends(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[RigidBody]:
    parents = {int(plant.get_joint(i).parent_body().index()) for i in plant.GetJointIndices(instance)}
    return [plant.get_body(b) for b in plant.GetBodyIndices(instance) if int(b) not in parents]


def _single_end(plant: MultibodyPlant, instance: ModelInstanceIndex) -> Frame | None:
    ends = _ends(plant, instance)
    return ends[0].body_frame() if len(ends) == 1 else None


def _no_single_end(plant: MultibodyPlant, instance: ModelInstanceIndex) -> InputError:
    return InputError(
        "cannot tell which body carries the tool",
        expected=f"a frame called {', '.join(FLANGE_NAMES)}, a single end of the chain, or {_where_the_arm_ends()}",
        found=", ".join(body.name() for body in _ends(plant, instance)),
    )


def inboard_joints(plant: MultibodyPlant) -> dict[int, int]:
    """For each body (by index) the joint (by index) that connects it towards the world."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    return {int(joint.child_body().index()): int(joint.index()) for joint in joints}


def _chain(plant: MultibodyPlant, base: Frame, flange: Frame) -> list[RevoluteJoint]:
    from pydrake.multibody.tree import JointIndex

    inboard, chain = inboard_joints(plant), []
    body = flange.body()
    while body.index() != base.body().index():
        if int(body.index()) not in inboard:
            raise InputError(f"frame {flange.name()!r} does not hang on frame {base.name()!r}")
        joint = plant.get_joint(JointIndex(inboard[int(body.index())]))
        if joint.type_name() == "revolute":
            chain.append(joint)
        elif joint.type_name() != "weld":
            raise InputError(
                f"joint {joint.name()!r} is of a type that truepath does not calibrate",
                expected="revolute (or weld) joints between base and flange. If this one is beyond the arm, a finger "
                f"of a gripper: {_where_the_arm_ends(joint.parent_body().name())}. If it is below the arm, a rail: "
                "base_frame, the name of the link on it",
                found=joint.type_name(),
            )
        body = joint.parent_body()
    if len(chain) < 2:
        raise InputError("the chain from base to flange is no arm", expected="two revolute joints or more")
    return chain[::-1]
