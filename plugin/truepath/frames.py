"""Registration of base and tool frame: where the robot stands for the tracker, and where the probe sits on it.

Closed form first, so that no first guess is needed; then a few robust refinements, so that gross
measuring errors do not decide. The kinematics is given (X_BF); M measurement frame, B base, F flange,
E probe or reflector.

Sources: Arun, Huang, Blostein 1987 (point sets by singular values); Shah 2013 (X_MB and X_FE from poses
by the Kronecker product); Gan, Dai 2011 (base frames of robots).
"""

from __future__ import annotations

import numpy as np

from truepath import lie
from truepath.errors import CalibrationError
from truepath.lie import Array

FIRST_REFINEMENTS, REFINEMENTS = 4, 40
SETTLED = 1e-7  # m and rad
STUDENT_DOF = 3.0
SUBSETS, SUBSET_SIZE = 64, 12
SUSPICIOUS_MISFIT_M, MAX_MEDIAN_MISFIT_M = 0.005, 0.1
MAX_MEDIAN_TURN_RAD = 0.2
WORST_CONDITION = 100.0  # of the equations for the frames; good poses have 10, lengths being in metres


def register(
    X_BF: Array,
    p_ME: Array,
    R_ME: Array | None = None,
    *,
    X_MB: Array | None = None,
    X_FE: Array | None = None,
) -> tuple[Array, Array]:
    """Base and tool frame that fit measured probe positions (and orientations) best.

    Args:
        X_BF: ``(N, 4, 4)`` flange poses of the model.
        p_ME: ``(N, 3)`` measured positions, m.
        R_ME: ``(N, 3, 3)`` measured orientations or None; without them X_FE gets no rotation.
        X_MB, X_FE: ``(4, 4)`` a frame that is known and stays as it is.

    Returns:
        X_MB, X_FE, each ``(4, 4)``.

    Raises:
        CalibrationError: no placement brings the model within 0.1 m of half of the measurements, as
            with wrong units, another robot or another order of joints.
    """
    if X_MB is None or X_FE is None:
        if R_ME is None:
            X_MB, X_FE = _register_points(X_BF, p_ME, X_MB, X_FE)
        else:
            X_MB, X_FE = _register_poses_or_points(X_BF, p_ME, R_ME, X_MB, X_FE)
    misfit = _median_misfit(X_BF, p_ME, X_MB, X_FE)
    if misfit > MAX_MEDIAN_MISFIT_M:
        raise CalibrationError(
            f"the nominal robot misses half of the measurements by more than {1e3 * misfit:.0f} mm, wherever it is "
            "placed\n  expected: within 100 mm\n  likely:   radians and degrees or mm and m mixed up, "
            "another robot, joints in another order, or wrong nominal frames"
        )
    if R_ME is not None:
        turns = lie.rotation_vector((X_MB @ X_BF @ X_FE)[:, :3, :3] @ np.swapaxes(R_ME, 1, 2))
        turn = float(np.median(np.linalg.norm(turns, axis=1)))
        if turn > MAX_MEDIAN_TURN_RAD:
            raise CalibrationError(
                f"the measured orientations are {turn:.2f} rad off the nominal robot's in half of the poses\n"
                f"  expected: within {MAX_MEDIAN_TURN_RAD:g} rad\n  likely:   quaternions in another order than "
                "qw, qx, qy, qz, or turned the other way (frame to probe instead of probe to frame)"
            )
    return X_MB, X_FE


def _median_misfit(X_BF: Array, p_ME: Array, X_MB: Array, X_FE: Array) -> float:
    return float(np.median(np.linalg.norm((X_MB @ X_BF @ X_FE)[:, :3, 3] - p_ME, axis=1)))


def require_variety(X_BF: Array, X_FE: Array, has_orientation: bool) -> None:
    """The poses ``(N, 4, 4)`` must tell a moved base from a moved probe.

    Raises:
        CalibrationError: the derivatives of the readings by the frames are nearly dependent.
    """
    R, points = X_BF[:, :3, :3], (X_BF @ X_FE)[:, :3, 3]
    same, none = np.broadcast_to(np.eye(3), R.shape), np.zeros(R.shape)
    J = np.concatenate([-lie.skew(points), same, R], axis=2)  # turn and shift of the base, shift of the probe
    if has_orientation:
        turn = np.concatenate([same, none, none, R], axis=2)
        J = np.concatenate([np.concatenate([J, none], axis=2), turn], axis=1)
    condition = np.linalg.cond(J.reshape(-1, J.shape[2]))
    if not condition <= WORST_CONDITION:
        raise CalibrationError(
            "the poses are too much alike to find base and probe\n  expected: joints that move, of wrist and arm\n"
            f"  found:    equations of condition {condition:.3g}, more than {WORST_CONDITION:g}"
        )


def _student_weights(distance_m: Array) -> Array:
    """Weights of a Student t likelihood (Lange, Little, Taylor 1989), its scale from the median distance."""
    scale = max(float(np.median(distance_m)) / 1.538, 1e-9)  # 1.538: median of a chi distribution, 3 dof
    return (STUDENT_DOF + 3) / (STUDENT_DOF + (distance_m / scale) ** 2)


def _fit_rigid(source: Array, target: Array, weights: Array) -> Array:
    """``(..., 4, 4)`` rigid motion from source to target points ``(..., N, 3)``, least weighted squares."""
    w = weights[..., None] / weights.sum(-1)[..., None, None]
    c_source, c_target = (w * source).sum(-2), (w * target).sum(-2)
    H = np.swapaxes(w * (target - c_target[..., None, :]), -1, -2) @ (source - c_source[..., None, :])
    u, _, vt = np.linalg.svd(H)
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    rotation = u @ vt
    return lie.make_pose(rotation, c_target - np.einsum("...ij,...j->...i", rotation, c_source))


def _register_points(X_BF: Array, p_ME: Array, X_MB: Array | None, X_FE: Array | None) -> tuple[Array, Array]:
    """Best of several closed-form starts after robust Gauss-Newton on base (6) and reflector point (3)."""
    p_FE = np.zeros(3) if X_FE is None else X_FE[:3, 3]
    starts = [(X_MB, p_FE)] if X_MB is not None else _point_starts(X_BF, p_ME, p_FE)
    free = X_MB is None, X_FE is None
    refined = [_refine_points(X_BF, p_ME, *start, *free, FIRST_REFINEMENTS) for start in starts]
    _, X_MB_near, p_FE_near = min(refined, key=lambda item: item[0])
    _, best_X_MB, best_p_FE = _refine_points(X_BF, p_ME, X_MB_near, p_FE_near, *free, REFINEMENTS)
    return best_X_MB, (lie.make_pose(translation=best_p_FE) if X_FE is None else X_FE)


def _point_starts(X_BF: Array, p_ME: Array, p_FE: Array) -> list[tuple[Array, Array]]:
    points = X_BF[:, :3, :3] @ p_FE + X_BF[:, :3, 3]
    whole = _fit_rigid(points, p_ME, np.ones(len(points)))
    # Small random subsets: most of them hold no outlier even when one row in ten is one.
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(points), (SUBSETS, min(SUBSET_SIZE, len(points))))
    subsets = _fit_rigid(points[picks], p_ME[picks], np.ones(picks.shape))
    fitted = np.einsum("sij,kj->ski", subsets[:, :3, :3], points) + subsets[:, None, :3, 3]
    medians = np.median(np.linalg.norm(fitted - p_ME, axis=2), axis=1)
    starts = [(whole, p_FE), (subsets[int(np.argmin(medians))], p_FE)]
    if len(points) >= 20:
        starts.append(_linear_points(X_BF, p_ME))
    return starts


def _linear_points(X_BF: Array, p_ME: Array) -> tuple[Array, Array]:
    """Base and reflector at once: p_ME = R p_BF + (R (x) e) vec(R_BF) + t is linear in R, R (x) e and t."""
    N = len(p_ME)
    A = np.concatenate([X_BF[:, :3, 3], X_BF[:, :3, :3].reshape(N, 9), np.ones((N, 1))], axis=1)
    solution = np.linalg.lstsq(A, p_ME, rcond=1e-9)[0]  # (13, 3)
    R = lie.nearest_rotation(solution[:3].T)
    p_FE = np.einsum("rkc,rc->k", solution[3:12].T.reshape(3, 3, 3).transpose(1, 2, 0), R.T) / 3
    return lie.make_pose(R, solution[12]), p_FE


def _refine_points(
    X_BF: Array, p_ME: Array, X_MB: Array, p_FE: Array, free_base: bool, free_tool: bool, iterations: int
) -> tuple[float, Array, Array]:
    """Robust Gauss-Newton; returns the median distance, X_MB and p_FE."""
    N = len(p_ME)
    for _ in range(iterations):
        R_MF = X_MB[:3, :3] @ X_BF[:, :3, :3]
        points = R_MF @ p_FE + X_BF[:, :3, 3] @ X_MB[:3, :3].T
        residual = points + X_MB[:3, 3] - p_ME
        weights = np.sqrt(_student_weights(np.linalg.norm(residual, axis=1)))[:, None]
        columns = []
        if free_base:
            columns += [-lie.skew(points), np.broadcast_to(np.eye(3), (N, 3, 3))]
        if free_tool:
            columns += [R_MF]
        J = (weights[..., None] * np.concatenate(columns, axis=2)).reshape(3 * N, -1)
        step = -np.linalg.pinv(J.T @ J, rcond=1e-12, hermitian=True) @ (J.T @ (weights * residual).ravel())
        if free_base:
            turn = lie.from_rotation_vector(step[:3])
            X_MB = lie.make_pose(lie.nearest_rotation(turn @ X_MB[:3, :3]), X_MB[:3, 3] + step[3:6])
        if free_tool:
            p_FE = p_FE + step[-3:]
        if np.abs(step).max() < SETTLED:
            break
    residual = (X_MB[:3, :3] @ (X_BF[:, :3, :3] @ p_FE + X_BF[:, :3, 3]).T).T + X_MB[:3, 3] - p_ME
    return float(np.median(np.linalg.norm(residual, axis=1))), X_MB, p_FE


def _register_poses_or_points(
    X_BF: Array, p_ME: Array, R_ME: Array, X_MB: Array | None, X_FE: Array | None
) -> tuple[Array, Array]:
    """As _register_poses; where all poses turn about one axis, or not at all, the points tell how the base stands."""
    found = _register_poses(X_BF, p_ME, R_ME, X_MB, X_FE)
    if X_MB is not None or X_FE is not None or _median_misfit(X_BF, p_ME, *found) < SUSPICIOUS_MISFIT_M:
        return found
    X_MB_of_points, _ = _register_points(X_BF, p_ME, None, None)
    other = _register_poses(X_BF, p_ME, R_ME, X_MB_of_points, None)
    return min(found, other, key=lambda frames: _median_misfit(X_BF, p_ME, *frames))


def _register_poses(
    X_BF: Array, p_ME: Array, R_ME: Array, X_MB: Array | None, X_FE: Array | None
) -> tuple[Array, Array]:
    """Shah 2013, repeated with robust weights: rotations from one singular vector pair, then linear translations."""
    weights = np.ones(len(p_ME))
    R_BF, p_BF = X_BF[:, :3, :3], X_BF[:, :3, 3]
    for _ in range(8):
        R_MB, R_FE = _rotations(R_BF, R_ME, weights, X_MB, X_FE)
        # p_ME = R_MB p_BF + R_MB R_BF p_FE + p_MB
        known = p_BF @ R_MB.T
        columns, fixed = [], np.zeros_like(p_ME)
        R_MF = R_MB @ R_BF
        if X_FE is None:
            columns.append(R_MF)
        else:
            fixed = fixed + R_MF @ X_FE[:3, 3]
        if X_MB is None:
            columns.append(np.broadcast_to(np.eye(3), R_BF.shape))
        else:
            fixed = fixed + X_MB[:3, 3]
        root = np.sqrt(weights)[:, None]
        A = (root[..., None] * np.concatenate(columns, axis=2)).reshape(3 * len(p_ME), -1)
        solution = np.linalg.lstsq(A, (root * (p_ME - known - fixed)).ravel(), rcond=1e-9)[0]
        p_FE = solution[:3] if X_FE is None else X_FE[:3, 3]
        p_MB = solution[-3:] if X_MB is None else X_MB[:3, 3]
        distance = np.linalg.norm(known + R_MF @ p_FE + p_MB - p_ME, axis=1)
        angle = np.linalg.norm(lie.rotation_vector(R_MF @ R_FE @ np.swapaxes(R_ME, 1, 2)), axis=1)
        weights = np.minimum(_student_weights(distance), _student_weights(angle))
    return lie.make_pose(R_MB, p_MB), lie.make_pose(R_FE, p_FE)


def _rotations(R_BF: Array, R_ME: Array, weights: Array, X_MB: Array | None, X_FE: Array | None) -> tuple[Array, Array]:
    if X_MB is not None:
        R_MB = X_MB[:3, :3]
        return R_MB, lie.nearest_rotation(np.einsum("k,kji,kjl->il", weights, R_MB @ R_BF, R_ME))
    if X_FE is not None:
        R_FE = X_FE[:3, :3]
        return lie.nearest_rotation(np.einsum("k,kij,klj->il", weights, R_ME, R_BF @ R_FE)), R_FE
    # R_ME = R_MB R_BF R_FE, row-major: vec(R_ME) = (R_MB (x) R_FE^T) vec(R_BF). The weighted sum
    # K = sum vec(R_ME) vec(R_BF)^T is rearranged so that R_MB and R_FE^T are its first singular pair.
    K = np.einsum("k,kij,klm->iljm", weights, R_ME, R_BF).reshape(9, 9)
    u, _, vt = np.linalg.svd(K)
    R_MB, R_FE_t = u[:, 0].reshape(3, 3), vt[0].reshape(3, 3)
    sign = np.sign(np.linalg.det(R_MB))
    return lie.nearest_rotation(sign * R_MB), lie.nearest_rotation(sign * R_FE_t).T
