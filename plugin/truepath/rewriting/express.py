"""Corrected joints as a program's targets: as joints, or as the poses that its controller turns into these joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from truepath.controller import Controller, vectors_from_poses
from truepath.lie import Array
from truepath.programs.program import NewTargets
from truepath.programs.program import Via as WrittenVia
from truepath.rewriting.plan import Plan
from truepath.rewriting.vias import Vias
from truepath.rewriting.ways import Ways

UNCHANGED_RAD = 2e-8  # a target that moves by less, some hundredths of a micrometre, stays as it is written


@dataclass(frozen=True, eq=False)
class Expressed:
    """What is to be written: new targets by their index in the program, and targets to be added."""

    targets: NewTargets
    vias: list[WrittenVia]


def express(
    plan: Plan,
    q_corrected_rad: Array,
    ways: Ways,
    vias: Vias,
    controller: Controller,
    form: Literal["joints", "poses"] | None,
) -> Expressed:
    """Only targets that change are named.

    Args:
        q_corrected_rad: ``(N, n)`` for the plan's targets.
        form: None for each as it was held.
    """
    motions = plan.motions
    is_pose = motions.is_pose if form is None else np.full(len(plan), form == "poses")
    changed = np.abs(q_corrected_rad - plan.q_today_rad).max(axis=1, initial=0.0) > UNCHANGED_RAD
    changed |= is_pose != motions.is_pose if form is not None else False
    q = q_corrected_rad.copy()
    X_CT = controller.tool_poses(q, motions.X_0T)
    for index, sample in vias.through.items():
        q[index], X_CT[index], changed[index] = ways.q_corrected_rad[sample], ways.X_CT_commanded[sample], True
    poses = _turned_alike(vectors_from_poses(X_CT), motions.rotation_vector)
    # An arm may have more joints than a pose has numbers; then all targets are of one form.
    values = q if not is_pose.any() else poses if is_pose.all() else np.where(is_pose[:, None], poses, q)
    kept = np.flatnonzero(changed)
    targets = NewTargets(plan.index[kept], values[kept], is_pose[kept], q[kept])
    vectors = vectors_from_poses(ways.X_CT_commanded)
    if motions.rotation_vector is not None:
        way = np.repeat(np.arange(len(ways.target)), np.diff(ways.first))
        vectors = _turned_alike(vectors, motions.rotation_vector[ways.target[way]])
    written = []
    for via in vias.added:
        pose = bool(is_pose[via.target])
        source = vectors if pose else ways.q_corrected_rad
        numbers = tuple(tuple(source[sample].tolist()) for sample in via.samples)
        written.append(WrittenVia(_first_site(plan, via.target, len(numbers)), numbers, pose, via.blend_m, via.share))
    return Expressed(targets, written)


def _turned_alike(vectors: Array, written: Array | None) -> Array:
    """Pose vectors ``(N, 6)`` whose rotation vector is, of the two that mean the same, the one nearer to that written.

    Near half a turn the two point to opposite sides; a reader shall not wonder why the tool turned over.
    """
    if written is None:
        return vectors
    turn = vectors[:, 3:]
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    other = np.divide(turn * (angle - 2 * np.pi), angle, out=turn.copy(), where=angle > 0)
    nearer = np.linalg.norm(other - written, axis=1) < np.linalg.norm(turn - written, axis=1)  # never for NaN
    return np.where(nearer[:, None], np.hstack([vectors[:, :3], other]), vectors)


def _first_site(plan: Plan, target: int, targets_of_the_move: int) -> int:
    """Index in the program of the first target of the move that ends there."""
    return int(plan.index[target]) - targets_of_the_move + 1


def tool_errors_mm(X_BF_real: Array, X_BF_goal: Array, X_F0: Array, X_0T: Array) -> Array:
    """``(N,)`` distance of the tool point from where it should be, for real flange poses ``(N, 4, 4)``."""
    X_FT = X_F0 @ X_0T
    return 1e3 * np.linalg.norm((X_BF_real @ X_FT)[:, :3, 3] - (X_BF_goal @ X_FT)[:, :3, 3], axis=1)
