"""A robot controller of our own: runs a list of moves; Drake computes its kinematics from Denavit-Hartenberg rows.

Nothing of truepath is used. Frames: C the controller's base, 0 its tool flange, T tool.

What it does, it does as a Universal Robots controller: ``movej`` turns all joints in step; ``movel`` and ``movep`` move
the tool along a straight line and turn it about one axis; ``movec`` moves it along the circle through the pose between
and turns it from start to end, however the pose between is turned (mode 0). A blend leaves the path at its radius
before the target and is back on it at its radius after; between, the corner is rounded by a parabola.
"""

import re
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable, RevoluteJoint, SpatialInertia, UnitInertia
from scipy.spatial.transform import Rotation

# Theta, a, d, alpha of a UR5 as Universal Robots publishes them (m, rad).
UR5_ROWS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, -0.425, -0.39225, 0.0, 0.0, 0.0],
        [0.089159, 0.0, 0.0, 0.10915, 0.09465, 0.0823],
        [np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0],
    ]
)
NUMBER = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
SIX = r"p?\[\s*(?:" + NUMBER + r"\s*,\s*){5}" + NUMBER + r"\s*\]"
CALL = re.compile(r"^\s*(movej|movel|movep|movec)\((.*)\)\s*(?:#\s*target (\d+))?\s*$")
KEYWORD = re.compile(rf"\b(a|v|t|r)=({NUMBER})(?:\*\(({NUMBER})\))?")


@dataclass(frozen=True)
class Move:
    """One call: ``poses`` ``(K, 6)``, or ``joints`` ``(6,)``, or both where a pose is to be reached near joints."""

    name: str
    poses: np.ndarray | None
    joints: np.ndarray | None
    settings: dict
    target: int | None  # as the comment at the end of the line says; None for a line that was added


def read_moves(script):
    """The moves of a script, one a line, whose arguments are numbers; by regular expressions."""
    moves = []
    for line in script.splitlines():
        match = CALL.match(line)
        if match is None:
            continue
        name, inside, target = match.groups()
        sixes = re.findall(SIX, inside)
        numbers = [np.array([float(n) for n in re.findall(NUMBER, six)]) for six in sixes]
        is_pose = [six.startswith("p") for six in sixes]
        assert len(sixes) == 1 + (name == "movec") + ("get_inverse_kin" in inside), line
        joints = next((n for n, pose in zip(numbers, is_pose, strict=True) if not pose), None)
        poses = [n for n, pose in zip(numbers, is_pose, strict=True) if pose]
        settings = {key: float(value) * float(times or 1.0) for key, value, times in KEYWORD.findall(inside)}
        moves.append(
            Move(name, np.array(poses) if poses else None, joints, settings, None if target is None else int(target))
        )
    return moves


def pose(vector):
    """``(4, 4)`` from x, y, z and rotation vector."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec(vector[3:]).as_matrix(), vector[:3]
    return X


@dataclass
class Run:
    """What a controller commanded, sample by sample.

    Attributes:
        q_rad: ``(K, 6)``.
        move: ``(K,)`` number of the move in the script.
        is_blend: ``(K,)`` True where a blend rounds a corner.
    """

    q_rad: np.ndarray
    move: np.ndarray
    is_blend: np.ndarray


class Controller:
    """Kinematics by Drake.

    Args:
        deltas: ``(4, 6)`` what a calibrated controller adds to theta, a, d, alpha; None for the published rows.
        tool: x, y, z and rotation vector of T on 0.
    """

    def __init__(self, deltas=None, tool=(0.0,) * 6):
        rows = UR5_ROWS if deltas is None else UR5_ROWS + deltas
        self.plant = MultibodyPlant(0.0)
        body = self.plant.world_body()
        X_next = RigidTransform()
        for i, (theta, a, d, alpha) in enumerate(rows.T):
            link = self.plant.AddRigidBody(f"link{i}", SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(0.1)))
            place = self.plant.AddFrame(FixedOffsetFrame(f"place{i}", body.body_frame(), X_next))
            self.plant.AddJoint(RevoluteJoint(f"q{i}", place, link.body_frame(), [0.0, 0.0, 1.0]))
            turn = RigidTransform(RotationMatrix.MakeZRotation(theta), [0, 0, d])
            X_next = turn @ RigidTransform(RotationMatrix.MakeXRotation(alpha), [a, 0, 0])
            body = link
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.last, self.X_L0 = body.body_frame(), X_next
        self.X_0T = pose(np.array(tool, float))
        self.world = self.plant.world_frame()

    def flange(self, q_rad):
        """X_C0 ``(4, 4)``."""
        self.plant.SetPositions(self.context, q_rad)
        return (self.last.CalcPoseInWorld(self.context) @ self.X_L0).GetAsMatrix4()

    def tool_poses(self, q_rad):
        """``(N, 4, 4)`` X_CT."""
        return np.array([self.flange(q) @ self.X_0T for q in q_rad])

    def joints_of(self, X_CT, near_rad):
        """Joints ``(6,)`` that reach a pose, by Newton's method from others that are near."""
        X_C0 = X_CT @ np.linalg.inv(self.X_0T)
        q = np.array(near_rad, float)
        for _ in range(50):
            X = self.flange(q)
            turn = Rotation.from_matrix(X_C0[:3, :3] @ X[:3, :3].T).as_rotvec()
            error = np.concatenate([turn, X_C0[:3, 3] - X[:3, 3]])
            if np.abs(error).max() < 1e-10:
                return q
            step = np.linalg.solve(self._jacobian(), error)
            q += step * min(1.0, 0.3 / max(np.abs(step).max(), 1e-300))
        raise ValueError(f"the controller finds no joints for {np.round(X_CT[:3, 3], 4)}, {error}")

    def distance_to_singularity(self, q_rad):
        """Smallest singular value of the Jacobian at joints ``(6,)``, lengths in m."""
        self.plant.SetPositions(self.context, q_rad)
        return float(np.linalg.svd(self._jacobian(), compute_uv=False)[-1])

    def _jacobian(self):
        kind, at = JacobianWrtVariable.kV, self.X_L0.translation()
        return self.plant.CalcJacobianSpatialVelocity(self.context, kind, self.last, at, self.world, self.world)

    def run(self, moves, q_start, step_m=0.002):
        """Runs a program from joints ``(6,)``; a motion of the joints is not sampled, only its end is taken."""
        q, move, is_blend = [], [], []
        here = np.array(q_start, float)
        k = 0
        while k < len(moves):
            if moves[k].name == "movej":
                here = self._end_of_movej(moves[k], here)
                q.append(here)
                move.append(k)
                is_blend.append(False)
                k += 1
                continue
            last = k
            while last < len(moves) and moves[last].name != "movej":
                last += 1
            for X, number, blending in self._along(moves, k, last, here, step_m):
                at = self.joints_of(X, here)
                assert np.abs(at - here).max() < 0.5, "the controller would jump"
                here = at
                q.append(at)
                move.append(number)
                is_blend.append(blending)
            k = last
        return Run(np.array(q), np.array(move), np.array(is_blend))

    def _end_of_movej(self, move, here):
        if move.poses is None:
            return move.joints
        return self.joints_of(pose(move.poses[0]), here if move.joints is None else move.joints)

    def _targets_of(self, move):
        if move.poses is not None:
            return [pose(each) for each in move.poses]
        return [self.flange(move.joints) @ self.X_0T]

    def _along(self, moves, first, last, here, step_m):
        """Poses X_CT along motions of the tool that follow one another, the move, and whether it is on a blend."""
        X = self.flange(here) @ self.X_0T
        curves = []
        for k in range(first, last):
            targets = self._targets_of(moves[k])
            curves.append(Curve.to(X, *targets))
            X = targets[-1]
        radius = [moves[k].settings.get("r", 0.0) for k in range(first, last)]
        radius[-1] = 0.0  # before a motion of the joints, or at the end, there is nothing to blend with
        for n, curve in enumerate(curves):
            begin, end = radius[n - 1] if n else 0.0, curve.length_m - radius[n]
            assert begin <= end + 1e-9, f"the blends of move {first + n} overlap"
            count = max(2, int(np.ceil((end - begin) / step_m)) + 1)
            for s in np.linspace(begin, end, count):
                yield curve.at(s), first + n, False
            if radius[n]:
                following = curves[n + 1]
                one, corner, two = curve.at(end), curve.at(curve.length_m), following.at(radius[n])
                for u in np.linspace(0, 1, 9)[1:-1]:
                    yield parabola(one, corner, two, u), first + n + (u > 0.5), True


def parabola(one, corner, two, u):
    """A pose on the way round a corner."""
    X = np.eye(4)
    X[:3, 3] = (1 - u) ** 2 * one[:3, 3] + 2 * u * (1 - u) * corner[:3, 3] + u**2 * two[:3, 3]
    before = Rotation.from_matrix(one[:3, :3] @ corner[:3, :3].T).as_rotvec()
    after = Rotation.from_matrix(two[:3, :3] @ corner[:3, :3].T).as_rotvec()
    X[:3, :3] = Rotation.from_rotvec((1 - u) ** 2 * before + u**2 * after).as_matrix() @ corner[:3, :3]
    return X


@dataclass
class Curve:
    """A line (``centre`` None) or an arc of the tool."""

    X_start: np.ndarray
    X_end: np.ndarray
    length_m: float
    centre: np.ndarray | None = None
    axis: np.ndarray | None = None
    angle: float = 0.0

    @classmethod
    def to(cls, X_start, *targets):
        start, end = X_start[:3, 3], targets[-1][:3, 3]
        if len(targets) == 1:
            return cls(X_start, targets[0], float(np.linalg.norm(end - start)))
        centre, axis = circle_by_equations(start, targets[0][:3, 3], end)
        angle = turned(start - centre, end - centre, axis)
        return cls(X_start, targets[1], float(angle * np.linalg.norm(start - centre)), centre, axis, angle)

    def at(self, s):
        share = s / self.length_m if self.length_m else 1.0
        X = np.eye(4)
        turn = Rotation.from_matrix(self.X_start[:3, :3].T @ self.X_end[:3, :3]).as_rotvec()
        X[:3, :3] = self.X_start[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
        if self.centre is None:
            X[:3, 3] = (1 - share) * self.X_start[:3, 3] + share * self.X_end[:3, 3]
        else:
            by = Rotation.from_rotvec(share * self.angle * self.axis)
            X[:3, 3] = self.centre + by.apply(self.X_start[:3, 3] - self.centre)
        return X


def circle_by_equations(one, two, three):
    """Centre and axis of the circle through three points: it is in their plane, and as far from each of them."""
    axis = np.cross(two - one, three - two)
    axis /= np.linalg.norm(axis)
    rows = np.array([axis, two - one, three - one])
    sides = [axis @ one, (two @ two - one @ one) / 2, (three @ three - one @ one) / 2]
    return np.linalg.solve(rows, sides), axis


def turned(one, two, axis):
    """Angle from one to two about the axis, between 0 and a whole turn."""
    side = np.cross(axis, one)
    return float(np.arctan2(two @ side, two @ one)) % (2 * np.pi)
