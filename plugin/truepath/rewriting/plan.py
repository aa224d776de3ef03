"""What a program means: for each target the flange pose in space, and the joints with which the nominal robot takes it.

Frames: B robot base, F flange; C controller's base, 0 its tool flange, T tool.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from truepath import lie
from truepath.controller import Controller
from truepath.errors import CorrectionError
from truepath.guards import Finding
from truepath.lie import Array
from truepath.model import nominal_flange_poses
from truepath.postures import follow_targets
from truepath.programs.motions import Motions
from truepath.rewriting.known_postures import known_postures
from truepath.rewriting.named_robot import ANOTHER_ROBOT, is_most_of
from truepath.robot import NominalRobot

OF_THE_WHOLE = ("tools", "possible")  # of a program, not of each of its targets


@dataclass(frozen=True, eq=False)
class Plan:
    """N targets that can be corrected.

    Attributes:
        motions: of these targets; ``previous`` counts among them.
        index: ``(N,)`` which targets of the program they are.
        q_rad: ``(N, n)`` nominal joints.
        q_today_rad: ``(N, n)`` joints that the controller takes today: others than the nominal ones where it turns
            poses into joints by kinematics of its own.
        X_BF: ``(N, 4, 4)`` flange poses that the program means.
        posture_unknown: indices of targets of the program that no one posture can be told for.
        findings: what is worth a warning.
    """

    motions: Motions
    index: Array
    q_rad: Array
    q_today_rad: Array
    X_BF: Array
    posture_unknown: Array
    findings: tuple[Finding, ...] = ()

    def __len__(self) -> int:
        return len(self.index)


def flange_of(X_CT: Array, X_0T: Array, controller: Controller) -> Array:
    """X_BF ``(N, 4, 4)`` of tool poses in the controller's base."""
    return controller.X_BC @ X_CT @ lie.invert(X_0T) @ lie.invert(controller.X_F0)


def tool_of(X_BF: Array, X_0T: Array, controller: Controller) -> Array:
    """X_CT ``(N, 4, 4)`` of flange poses."""
    return lie.invert(controller.X_BC) @ X_BF @ controller.X_F0 @ X_0T


def tool_poses_meant(plan: Plan, controller: Controller) -> Array:
    """``(N, 4, 4)`` X_CT that the program means, whether it states poses or joints."""
    motions = plan.motions
    return np.where(motions.is_pose[:, None, None], motions.X_CT, tool_of(plan.X_BF, motions.X_0T, controller))


def with_tool_of(motions: Motions, X_CT: Array, start: Array, target: Array) -> Array:
    """``(W, 4, 4)`` where the tool that is in force at targets ``(W,)`` is while the robot is at others ``(W,)``.

    Args:
        X_CT: ``(N, 4, 4)`` of the tool in force at each target.
    """
    X = X_CT[start]
    changed = np.flatnonzero(motions.tool[start] != motions.tool[target])
    before, then = motions.X_0T[start[changed]], motions.X_0T[target[changed]]
    X[changed] = X[changed] @ lie.invert(before) @ then
    return X


def plan_targets(
    motions: Motions, robot: NominalRobot, controller: Controller, file: str, start_rad: tuple[float, ...] | None
) -> Plan:
    """Finds the joints of all targets.

    Raises:
        CorrectionError: a pose out of reach, or a joint target beyond a limit; with its line.
    """
    is_pose = motions.is_pose
    X_BF = np.empty((len(motions), 4, 4))
    X_BF[~is_pose] = nominal_flange_poses(robot, motions.q_rad[~is_pose])
    X_BF[is_pose] = flange_of(motions.X_CT[is_pose], motions.X_0T[is_pose], controller)
    near = motions.q_near_rad.copy()
    if start_rad is not None:
        near[is_pose & motions.starts & (motions.origin < 0) & np.isnan(near[:, 0])] = start_rad
    followed = known_postures(robot, motions, X_BF, near)
    lost = ~followed.reached & ~followed.start_unknown & ~followed.ambiguous
    if lost.any():
        k = int(np.argmax(lost))
        x, y, z = 1e3 * motions.X_CT[k, :3, 3]
        hint = f"; so are most targets: {ANOTHER_ROBOT}" if is_most_of(_nowhere_near(robot, X_BF[is_pose])) else ""
        raise CorrectionError(
            "the target is out of reach, or beyond a joint limit from where the robot comes",
            file=file,
            line=int(motions.line[k]),
            expected=f"a pose that {robot.name} can take from there, in its base frame",
            found=f"the tool at ({x:.1f}, {y:.1f}, {z:.1f}) mm{hint}",
        )
    doubtful = followed.start_unknown | followed.ambiguous | ~followed.certain
    kept = np.flatnonzero(~doubtful)
    chosen = select(motions, kept)
    q = followed.q_rad[kept]
    q_today = q.copy()
    poses = np.flatnonzero(chosen.is_pose)
    if len(poses):
        today = controller.joints(chosen.X_CT[poses], chosen.X_0T[poses], q[poses])
        q_today[poses] = np.where(today.converged[:, None], today.q_rad, q[poses])
    return Plan(chosen, kept, q, q_today, X_BF[kept], np.flatnonzero(doubtful))


def select(motions: Motions, kept: Array) -> Motions:
    """Some of the targets; a target whose predecessor is not among them comes from nobody knows where."""
    place = np.full(len(motions) + 1, -1)  # the last one is that of "not known"
    place[kept] = np.arange(len(kept))
    each = {part.name: getattr(motions, part.name) for part in fields(motions) if part.name not in OF_THE_WHOLE}
    parts = {name: values[kept] for name, values in each.items() if values is not None}
    return replace(motions, **{**parts, "previous": place[parts["previous"]], "origin": place[parts["origin"]]})


def _nowhere_near(robot: NominalRobot, X_BF: Array) -> Array:
    """``(N,)`` True where the robot reaches a flange pose ``(N, 4, 4)`` in no posture, wherever it comes from."""
    anywhere = np.clip(np.zeros(robot.num_joints), robot.lower_rad, robot.upper_rad)
    untold = np.full((len(X_BF), robot.num_joints), np.nan)
    return ~follow_targets(robot, X_BF, untold, untold, np.full(len(X_BF), -1), anywhere).reached
