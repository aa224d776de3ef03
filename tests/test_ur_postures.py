"""All joints that bring a UR to a pose, in closed form; the truth is Drake, and Newton's method from many starts."""

from dataclasses import replace

import numpy as np
import pytest
from drake_arm import DrakeArm
from posture_truth import all_solutions, misses
from scipy.spatial.transform import Rotation
from truepath.model import nominal_flange_poses
from truepath.plants import load_robot
from truepath.ur_postures import ThreeParallelAxes


@pytest.mark.parametrize("name", ["ur5", "ur10"])
def test_all_eight_postures_reach_the_pose(name):
    drake, q = DrakeArm(name), np.random.default_rng(1).uniform(-np.pi, np.pi, (40, 6))
    X = drake.flange_poses(q)
    found = ThreeParallelAxes.of(load_robot(name)).solve(X).q_rad
    assert (np.nanmin(np.abs(found - q.T).max(axis=1), axis=0) < 1e-7).all()
    for posture in found:
        there = ~np.isnan(posture[0])
        assert there.sum() > 20
        assert misses(drake.flange_poses(posture[:, there].T), X[there]) < 1e-7


@pytest.mark.parametrize("seed", range(6))
def test_there_are_no_others(ur5, seed):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, 6)
    X = nominal_flange_poses(ur5, q[None])
    found = ThreeParallelAxes.of(ur5).solve(X).q_rad[..., 0]
    found = found[~np.isnan(found[:, 0])]
    truth = all_solutions(ur5, X[0])
    assert len(found) == len(truth)
    assert np.abs(found[:, None] - truth).max(axis=2).min(axis=0).max() < 1e-6


def test_arms_of_another_kind_are_told(seven, ur5):
    assert ThreeParallelAxes.of(seven) is None
    tilted = ur5.X_BA.copy()
    tilted[3, :3, :3] = Rotation.from_rotvec([0.3, 0, 0]).as_matrix() @ tilted[3, :3, :3]
    assert ThreeParallelAxes.of(replace(ur5, X_BA=tilted)) is None
    apart = ur5.X_BA.copy()
    apart[4, 0, 3] += 0.05
    assert ThreeParallelAxes.of(replace(ur5, X_BA=apart)) is None
