"""What holds something in a plant by welds, and can be moved in a context.

Drake keeps the pose of a ``FixedOffsetFrame`` as a parameter of a context, but not that of a weld. So what is welded
can be moved if the weld is made with such a frame: of the body that holds it, or of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from truepath import lie
from truepath.arm import inboard_joints
from truepath.lie import Array

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import FixedOffsetFrame, Frame, Joint, RigidBody
    from pydrake.systems.framework import Context


@dataclass(frozen=True, eq=False)
class Mount:
    """A frame by which something is held.

    Attributes:
        frame: whose pose is a parameter of a context.
        held: the body that moves with it, and all beyond; None: no body does, only the frame itself.
        on_held: whether the frame is one of that body: it then stays where it is, and the body moves the other way.
    """

    frame: FixedOffsetFrame
    held: RigidBody | None
    on_held: bool = False

    def move(self, context: Context, motion_W: Array) -> None:
        """Moves what it holds by a motion ``(4, 4)`` of the world."""
        X_WG = self.frame.CalcPoseInWorld(context).GetAsMatrix4()
        if not self.on_held:
            self.put(context, motion_W @ X_WG)
            return
        self.put(context, lie.invert(motion_W) @ X_WG)

    def put(self, context: Context, X_WG: Array) -> None:
        """Puts the frame where it would be ``(4, 4)`` if the body that it is on stayed, whatever it is counted from."""
        from pydrake.math import RigidTransform, RotationMatrix

        X_PG = self.frame.GetPoseInParentFrame(context).GetAsMatrix4()
        X_WP = self.frame.CalcPoseInWorld(context).GetAsMatrix4() @ lie.invert(X_PG)
        X = lie.invert(X_WP) @ X_WG
        R = RotationMatrix.ProjectToRotationMatrix(X[:3, :3])  # without the last rounding
        self.frame.SetPoseInParentFrame(context, RigidTransform(R, X[:3, 3]))


def mounts_on_the_way(plant: MultibodyPlant, frame: Frame, until: RigidBody) -> list[Mount]:
    """All mounts between a body and a frame that is welded to it through others, from that body outwards."""
    from pydrake.multibody.tree import FixedOffsetFrame

    found = []
    for weld in reversed(list(welds_inboard(plant, frame.body(), until))):
        held = weld.child_body()
        for side, on_held in ((weld.frame_on_parent(), False), (weld.frame_on_child(), True)):
            if isinstance(side, FixedOffsetFrame):
                found.append(Mount(side, held, on_held))
    if isinstance(frame, FixedOffsetFrame):
        found.append(Mount(frame, None))
    return found


def welds_inboard(plant: MultibodyPlant, body: RigidBody, until: RigidBody | None = None) -> Iterator[Joint]:
    """Welds from a body towards the world, up to another body."""
    from pydrake.multibody.tree import JointIndex

    inboard = inboard_joints(plant)
    while (until is None or body.index() != until.index()) and (j := inboard.get(int(body.index()))) is not None:
        joint = plant.get_joint(JointIndex(j))
        if joint.type_name() != "weld":
            return
        yield joint
        body = joint.parent_body()
