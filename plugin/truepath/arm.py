"""Finding a serial arm of revolute joints in a Drake plant that may hold anything else besides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from truepath.errors import InputError

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame, ModelInstanceIndex, RevoluteJoint

FLANGE_NAMES = ("flange", "tool0", "ee_link", "tool_flange")


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
) -> Arm:
    """Finds the arm.

    Args:
        plant: finalized.
        model_instance: where the arm is; found by itself when exactly one instance has revolute joints.
        base_frame, flange_frame: names; by default the root of the arm's model, and the end of the chain
            (a frame called flange, tool0, ee_link or tool_flange, else the last body).

    Raises:
        InputError: plant not finalized, no arm or several, a joint of another type in the chain.
    """
    if not plant.is_finalized():
        raise InputError("the plant is not finalized", expected="call plant.Finalize() first")
    instance = _find_instance(plant) if model_instance is None else model_instance
    flange = _named_frame(plant, flange_frame, instance) or _find_flange(plant, instance)
    base = _named_frame(plant, base_frame, instance) or _root_frame(plant, flange, instance)
    return Arm(instance, base, flange, _chain(plant, base, flange))


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


def _find_flange(plant: MultibodyPlant, instance: ModelInstanceIndex) -> Frame:
    for name in FLANGE_NAMES:
        if plant.HasFrameNamed(name, instance):
            return plant.GetFrameByName(name, instance)
    parents = {int(plant.get_joint(i).parent_body().index()) for i in plant.GetJointIndices(instance)}
    bodies = plant.GetBodyIndices(instance)
    leaves = [plant.get_body(b) for b in bodies if int(b) not in parents]
    if len(leaves) != 1:
        raise InputError(
            "cannot tell which body carries the tool",
            expected="a frame called " + ", ".join(FLANGE_NAMES) + ", a single end of the chain, or flange_frame given",
            found=", ".join(body.name() for body in leaves),
        )
    return leaves[0].body_frame()


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
                expected="revolute (or weld) joints between base and flange",
                found=joint.type_name(),
            )
        body = joint.parent_body()
    if len(chain) < 2:
        raise InputError("the chain from base to flange is no arm", expected="two revolute joints or more")
    return chain[::-1]
