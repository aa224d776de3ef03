"""Motions, plans and ways put together by hand."""

import numpy as np
from scipy.spatial.transform import Rotation
from truepath.programs.motions import Kind, Motions
from truepath.rewriting.plan import Plan
from truepath.rewriting.ways import Ways


def at(x, y, z, rotation_vector=(0.0, 0.0, 0.0)):
    """``(4, 4)``."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec(rotation_vector).as_matrix(), (x, y, z)
    return X


def motions(kinds, X_CT=None, q_rad=None, *, previous=None, blend_m=None, tools=None, tool=None):
    """Targets in lines 10, 11 ...; NaN rows in ``q_rad`` are poses. Each comes from the one before it."""
    count = len(kinds)
    before = np.arange(count) - 1 if previous is None else np.array(previous)
    nothing = np.full(count, np.nan)
    return Motions(
        kind=np.array(kinds, int),
        q_rad=np.full((count, 6), np.nan) if q_rad is None else np.array(q_rad, float),
        X_CT=np.full((count, 4, 4), np.nan) if X_CT is None else np.array(X_CT, float),
        q_near_rad=np.full((count, 6), np.nan),
        tools=np.eye(4)[None] if tools is None else np.array(tools),
        tool=np.zeros(count, int) if tool is None else np.array(tool),
        line=10 + np.arange(count),
        previous=before,
        origin=before,
        starts=before < 0,
        speed=nothing,
        acceleration=nothing,
        time_s=nothing,
        blend_m=nothing if blend_m is None else np.array(blend_m, float),
    )


def plan_of(made):
    """A plan of these motions of which only the motions matter."""
    q = np.zeros((len(made), 6))
    X = np.broadcast_to(np.eye(4), (len(made), 4, 4))
    return Plan(made, np.arange(len(made)), q, q, X, np.zeros(0, int))


def ways_of(start, target, points, arcs=None):
    """Ways between targets whose samples the controller must believe at ``points``, a list of ``(K, 3)`` in m."""
    counts = [len(each) for each in points]
    samples = np.concatenate(points) if points else np.zeros((0, 3))
    X = np.broadcast_to(np.eye(4), (len(samples), 4, 4)).copy()
    X[:, :3, 3] = samples
    share = np.concatenate([np.arange(1, n + 1) / (n + 1) for n in counts])
    joints = np.zeros((len(samples), 6))
    length = [np.linalg.norm(each[-1] - each[0]) * (n + 1) / (n - 1) for each, n in zip(points, counts, strict=True)]
    return Ways(
        target=np.array(target),
        start=np.array(start),
        length_m=np.array([arcs[k].length_m if k in (arcs or {}) else length[k] for k in range(len(points))]),
        turn_rad=np.zeros(len(points)),
        arcs=arcs or {},
        first=np.concatenate([[0], np.cumsum(counts)]),
        share=share,
        X_CT=X,
        q_rad=joints,
        q_corrected_rad=joints,
        X_CT_commanded=X,
        followed=np.ones(len(points), bool),
    )


LINEAR, JOINT, THROUGH, ARC, PROCESS = Kind.LINEAR, Kind.JOINT, Kind.THROUGH, Kind.ARC, Kind.PROCESS
