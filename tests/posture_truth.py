"""Paths of poses, and the truth of which joints reach them: by Newton from many starts, and in small steps."""

import numpy as np
from scipy.spatial.transform import Rotation
from truepath.inverse import solve
from truepath.model import nominal_flange_poses, nominal_model
from truepath.postures import follow_targets

HOME = np.array([0.2, -1.4, 1.3, -1.2, -1.5, 0.3])
TURN = 2 * np.pi


def smooth(count, size=0.6, seed=0):
    """``(count, 6)`` joints that wander about HOME, far from singularities."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, count)[:, None, None]
    waves = np.sin(TURN * (s * rng.uniform(0.5, 2, (3, 6)) + rng.uniform(0, 1, (3, 6))))
    return HOME + size / 3 * waves.sum(axis=1)


def follow(arm, q, *, given=(), near=None, previous=None, start=None, straight=None, X=None):
    """Targets that are the poses at joints ``q``, but for those that are given as joints."""
    robot = getattr(arm, "kinematics", arm)
    stated = np.full(q.shape, np.nan)
    stated[list(given)] = q[list(given)]
    near = np.full(q.shape, np.nan) if near is None else near
    previous = np.arange(len(q)) - 1 if previous is None else np.array(previous)
    X = nominal_flange_poses(robot, q) if X is None else X
    straight = None if straight is None else np.broadcast_to(straight, len(q))
    return follow_targets(arm, X, stated, near, previous, start, straight)


def misses(X, X_goal):
    """Largest position error in m and angle error in rad."""
    angle = Rotation.from_matrix(X[:, :3, :3] @ np.swapaxes(X_goal[:, :3, :3], 1, 2)).magnitude()
    return max(np.linalg.norm(X[:, :3, 3] - X_goal[:, :3, 3], axis=1).max(), angle.max())


def all_solutions(robot, X):
    """``(K, 6)`` all joints in [-pi, pi) that reach a pose, by Newton's method from 400 starts."""
    starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (400, 6))
    forward = nominal_model(robot).flange_poses_and_jacobian
    solution = solve(forward, np.broadcast_to(X, (400, 4, 4)), starts, max_iterations=60)
    q = solution.q_rad[solution.converged]
    q = q - TURN * np.floor((q + np.pi) / TURN)
    different: list = []
    for one in q:
        away = [np.abs((one - other + np.pi) % TURN - np.pi).max() for other in different]
        if min(away, default=1.0) > 1e-4:
            different.append(one)
    return np.array(different)


def with_turns(q, lower, upper):
    """The same joints with all whole turns within limits of at most two turns."""
    turns = np.stack(np.meshgrid(*[[-1, 0, 1]] * 6), axis=-1).reshape(-1, 1, 6)
    found = (q + TURN * turns).reshape(-1, 6)
    return found[((found >= lower) & (found <= upper)).all(axis=1)]


def along_line(robot, q, X_goal, steps=2000):
    """Joints at the end of the straight line from joints ``q``, in small steps."""
    X = nominal_flange_poses(robot, q[None])[0]
    turn = Rotation.from_matrix(X_goal[:3, :3] @ X[:3, :3].T).as_rotvec()
    forward = nominal_model(robot).flange_poses_and_jacobian
    for share in np.arange(1, steps + 1) / steps:
        goal = np.eye(4)
        goal[:3, :3] = Rotation.from_rotvec(share * turn).as_matrix() @ X[:3, :3]
        goal[:3, 3] = (1 - share) * X[:3, 3] + share * X_goal[:3, 3]
        solution = solve(forward, goal[None], q[None])
        assert solution.converged[0]
        assert np.abs(solution.q_rad[0] - q).max() < 0.1
        q = solution.q_rad[0]
    return q
