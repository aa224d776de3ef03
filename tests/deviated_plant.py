"""A Drake plant whose joints stand where deviations put them, and can be moved further one by one."""

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

BASE_LINK = {"ur5": "base_link", "seven": "foot"}


def pose(rotation, translation):
    """``(4, 4)``."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation, translation
    return X


def step(pos_x=0.0, pos_y=0.0, pos_z=0.0, rot_x=0.0, rot_y=0.0, rot_z=0.0):
    """The small step of ``poe``'s docstring, a second time: shift, then Rx Ry Rz."""
    return pose(Rotation.from_euler("XYZ", [rot_x, rot_y, rot_z]).as_matrix(), [pos_x, pos_y, pos_z])


class DeviatedPlant:
    """A Drake context in which every joint frame stands where the deviations put it.

    Drake places a joint by its frame on the parent body and lets the child body be the moving frame. At the
    zero pose joint i of the nominal robot stands at J_i and its axis frame at A_i, both in the base. The
    deviated axis frame is A_i X(d_i), so the joint stands at J_i' = A_i X(d_i) A_i^-1 J_i, and its frame on
    the parent is (J_{i-1}' W)^-1 J_i', W leading through welds from link i-1 to the parent. The zero pose of
    the flange is not a parameter: on the last link it sits at J_n'^-1 M.
    """

    def __init__(self, robot, plant, p):
        self.plant, self.context = plant, plant.CreateDefaultContext()
        self.joints = [plant.GetJointByName(name) for name in robot.joint_names]
        plant.SetPositions(self.context, np.zeros(plant.num_positions()))
        self.base = plant.GetFrameByName(BASE_LINK[robot.name])
        M = self._pose(plant.GetFrameByName("flange"), self.base)
        zero = [self._pose(joint.frame_on_parent(), self.base) for joint in self.joints]
        welds = [np.eye(4)]
        for joint, previous in zip(self.joints[1:], self.joints, strict=False):
            welds.append(self._pose(joint.parent_body().body_frame(), previous.child_body().body_frame()))
        first_parent = self._pose(self.joints[0].parent_body().body_frame(), self.base)
        stands = first_parent
        self.X_JA = []
        for i, (joint, J, W) in enumerate(zip(self.joints, zero, welds, strict=True)):
            assert joint.frame_on_child().index() == joint.child_body().body_frame().index()
            A = self._axis_frame(J, joint.revolute_axis())
            px, py, rx, ry = p[4 * i : 4 * i + 4]
            moved = A @ step(px, py, 0, rx, ry, 0) @ np.linalg.inv(A) @ J
            self._place(joint, np.linalg.inv(stands @ W) @ moved)
            self.X_JA.append(np.linalg.inv(J) @ A)
            stands = moved
        self.X_LF = np.linalg.inv(stands) @ M

    @staticmethod
    def _axis_frame(J, axis):
        z = J[:3, :3] @ axis
        helper = np.eye(3)[np.argmin(np.round(np.abs(z), 6))]
        x = helper - z * (helper @ z)
        x /= np.linalg.norm(x)
        return pose(np.stack([x, np.cross(z, x), z], axis=1), J[:3, 3])

    def _pose(self, frame, relative_to):
        return frame.CalcPose(self.context, relative_to).GetAsMatrix4()

    def _place(self, joint, X_PF):
        R_PF = RotationMatrix.ProjectToRotationMatrix(X_PF[:3, :3])  # without the last rounding
        joint.frame_on_parent().SetPoseInParentFrame(self.context, RigidTransform(R_PF, X_PF[:3, 3]))

    def flange_pose(self, q):
        """X_BF ``(4, 4)`` at joints ``(n,)``."""
        for joint, angle in zip(self.joints, q, strict=True):
            joint.set_angle(self.context, angle)
        return self._pose(self.joints[-1].child_body().body_frame(), self.base) @ self.X_LF

    def flange_pose_with_axis_moved(self, joint, X_step, q):
        """The same while what axis ``joint`` (from 1) carries is moved by a step in the frame of that axis."""
        moved, X_JA = self.joints[joint - 1], self.X_JA[joint - 1]
        X_PF = moved.frame_on_parent().GetPoseInParentFrame(self.context).GetAsMatrix4()
        try:
            self._place(moved, X_PF @ X_JA @ X_step @ np.linalg.inv(X_JA))
            return self.flange_pose(q)
        finally:
            self._place(moved, X_PF)
