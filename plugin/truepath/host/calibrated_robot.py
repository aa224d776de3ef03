"""Where the real robot goes, as a Drake system."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.common.value import Value
from pydrake.math import RigidTransform_, RotationMatrix, RotationMatrix_
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from truepath.errors import InputError
from truepath.host.placed_robot import PlacedRobot
from truepath.lie import Array

DIFFERENCE_RAD = 1e-5


@TemplateSystem.define("CalibratedRobot_", T_list=[float, AutoDiffXd])
def CalibratedRobot_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """Predicts the real flange and the real tool for commanded joints, with all that the calibration knows.

        That is more than a plant's context can carry: transmission errors, compliance, backlash, encoder scale, wobble
        of axes, thermal growth, creep, networks.

        Ports: input ``commanded``; outputs ``flange_pose`` X_WF and ``tool_pose`` X_WT, ``RigidTransform`` in the
        world (of the plugin's tool frame; without one it is the flange). Direct feedthrough, no state. What was
        measured is the probe: a tool frame at its place is predicted as it will be measured there (its orientation only
        if orientations were), while the flange behind it is where the calibration's convention has it. No data tells a
        flange that sits elsewhere on the last link from a tool that sits elsewhere on the flange.

        Scalars: ``float`` and ``AutoDiffXd`` (derivatives by central differences, to about 1e-8 m per rad).
        ``Expression`` is not possible: Drake says so where a conversion is asked for.

        Args:
            source: a plugin, or a calibration alone (then the base stands where its model's world has it). The
                calibration that it has now: a later one is for a new system.
            of: ``arm``, in the order of its joints, or ``plant``, all positions of the plugin's plant.

        Raises:
            InputError: no calibration, no plant, an unknown word.
        """

        def _construct(self, source: Any, *, of: Literal["arm", "plant"] = "arm", converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.robot = source if isinstance(source, PlacedRobot) else PlacedRobot.of(source)
            self.of, place = of, self.robot.place
            n = self.robot.model.robot.num_joints
            if of == "arm":
                self._q, size = np.arange(n), n
            elif of != "plant":
                raise InputError("unknown kind of input", expected="of arm or plant")
            elif place is None:
                raise InputError("a calibration alone knows no plant", expected="a plugin, or of='arm'")
            else:
                self._q, size = place.positions, place.plant.num_positions()
            self.DeclareVectorInputPort("commanded", size)
            for name, poses in (("flange_pose", self.robot.flange_poses), ("tool_pose", self.robot.tool_poses)):
                self.DeclareAbstractOutputPort(name, lambda: Value[RigidTransform_[T]](), self._calc(poses))

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, of=other.of, converter=converter)

        def _calc(self, poses: Any) -> Any:
            def calc(context: Any, output: Any) -> None:
                q = self.get_input_port(0).Eval(context)[self._q]
                output.set_value(_pose(poses, q) if T is float else _pose_with_derivatives(poses, q))

            return calc

    return Impl


CalibratedRobot = CalibratedRobot_[float]


def _pose(poses: Any, q: Array) -> Any:
    return RigidTransform_[float](*_parts(poses(q[None])[0]))


def _parts(X: Array) -> tuple[Any, Array]:
    return RotationMatrix.ProjectToRotationMatrix(X[:3, :3]), X[:3, 3]


def _pose_with_derivatives(poses: Any, q_ad: Array) -> Any:
    q, gradient = ExtractValue(q_ad).ravel(), ExtractGradient(q_ad)
    steps = DIFFERENCE_RAD * np.eye(len(q))
    X, ahead, behind = np.split(poses(np.concatenate([q[None], q + steps, q - steps])), [1, 1 + len(q)])
    R, p = _parts(X[0])
    value = np.concatenate([R.matrix().ravel(), p])
    if gradient.shape[1] == 0:
        flat = InitializeAutoDiff(value).ravel()
    else:
        slopes = (ahead - behind)[:, :3] / (2.0 * DIFFERENCE_RAD)
        by_joint = np.concatenate([slopes[:, :, :3].reshape(len(q), 9), slopes[:, :, 3]], axis=1).T
        flat = InitializeAutoDiff(value, by_joint @ gradient).ravel()
    return RigidTransform_[AutoDiffXd](RotationMatrix_[AutoDiffXd](flat[:9].reshape(3, 3)), flat[9:])
