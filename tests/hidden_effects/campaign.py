"""A measuring campaign: which poses, when, how warm, how noisy; and the CSV that is handed over."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from hidden_effects.robot import FRESH, pool
from hidden_effects.scene import rotation

PAUSE_S = 600.0  # before further poses are measured


@dataclass(frozen=True)
class Campaign:
    """How a robot is measured; N poses, SI units.

    Attributes:
        q: ``(N, n)``; pose_id, time_s, temperature_c, payload_kg: ``(N,)``; approach: ``(N, n)``.
        noise_m, noise_rad: of a coordinate; ``noise_rad`` None where a mere reflector is measured.
        X_MW: ``(4, 4)`` the world as the tracker sees it.
    """

    q: np.ndarray
    pose_id: np.ndarray
    time_s: np.ndarray
    temperature_c: np.ndarray
    payload_kg: np.ndarray
    approach: np.ndarray
    noise_m: float
    noise_rad: float | None
    X_MW: np.ndarray

    @property
    def repeats(self):
        return len(np.unique(self.pose_id)) < len(self.q)


def random_campaign(rng, spec, fewest=100, count=None, six_d=None, repeated=0.15):
    """Poses all over the cell in random order, ``fewest`` to 1000; one campaign in three is measured in 6D.

    With probability ``repeated`` every sixth pose is visited twice, one visit right after the other.
    """
    if count is None:
        most = 1000 if rng.random() < 0.1 else max(600, fewest)
        count = int(np.exp(rng.uniform(np.log(fewest), np.log(most))))
    pose_id = np.arange(count)
    if rng.random() < repeated:
        pose_id -= (np.arange(count) + 1) // 7
    q = rng.permutation(pool(spec)[:-FRESH])[pose_id]
    return campaign_at(rng, q, ticking(rng, count), six_d, pose_id)


def campaign_at(rng, q, time_s, six_d=None, pose_id=None):
    """A campaign that visits these poses at these times."""
    N, n = q.shape
    pose_id = np.arange(N) if pose_id is None else pose_id
    six_d = rng.random() < 1 / 3 if six_d is None else six_d
    return Campaign(
        q=q,
        pose_id=pose_id,
        time_s=time_s,
        temperature_c=np.round(_weather(rng, time_s / time_s[-1]), 2),
        payload_kg=np.zeros(N),
        approach=rng.choice([-1.0, 1.0], (N, n)),
        noise_m=np.exp(rng.uniform(np.log(1e-5), np.log(4e-5))),
        noise_rad=np.exp(rng.uniform(np.log(0.5e-4), np.log(2e-4))) if six_d else None,
        X_MW=tracker_frame(rng) if rng.random() < 0.5 else np.eye(4),
    )


def extended(rng, campaign, q):
    """The campaign and further poses ``(k, n)``, measured after a pause."""
    k, n = q.shape
    warmth = campaign.temperature_c[-1] + np.cumsum(rng.normal(scale=0.05, size=k))
    further = {
        "q": q,
        "pose_id": campaign.pose_id.max() + 1 + np.arange(k),
        "time_s": campaign.time_s[-1] + PAUSE_S + ticking(rng, k),
        "temperature_c": np.round(warmth, 2),
        "payload_kg": np.zeros(k),
        "approach": rng.choice([-1.0, 1.0], (k, n)),
    }
    return replace(
        campaign, **{name: np.concatenate([getattr(campaign, name), rows]) for name, rows in further.items()}
    )


def add_noise(rng, poses, noise_m, noise_rad):
    """What the tracker reads of true poses ``(N, 4, 4)``."""
    poses = poses.copy()
    poses[:, :3, 3] += rng.normal(scale=noise_m, size=(len(poses), 3))
    if noise_rad is not None:
        poses[:, :3, :3] = rotation(rng.normal(scale=noise_rad, size=(len(poses), 3))) @ poses[:, :3, :3]
    return poses


def add_outliers(rng, poses, share):
    """Some positions 1 to 50 mm off; returns the poses and which rows, counted from 1."""
    poses, count = poses.copy(), max(1, round(share * len(poses)))
    rows = np.sort(rng.choice(len(poses), count, replace=False))
    error = rng.normal(size=(count, 3))
    size = np.exp(rng.uniform(np.log(1e-3), np.log(50e-3), (count, 1)))
    poses[rows, :3, 3] += size * error / np.linalg.norm(error, axis=1, keepdims=True)
    return poses, tuple(int(row) + 1 for row in rows)


def to_csv(campaign, poses, columns):
    """The design document's CSV, with those of ``time``, ``temperature``, ``payload``, ``approach`` that are wanted."""
    n = campaign.q.shape[1]
    table = {f"q{i + 1}_rad": campaign.q[:, i] for i in range(n)}
    table |= {f"{axis}_mm": 1e3 * poses[:, k, 3] for k, axis in enumerate("xyz")}
    if campaign.noise_rad is not None:
        quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True, scalar_first=True)
        table |= {name: quaternion[:, k] for k, name in enumerate(("qw", "qx", "qy", "qz"))}
    if "time" in columns:
        table["t_s"] = campaign.time_s
    if "temperature" in columns:
        table["temperature_c"] = campaign.temperature_c
    if "payload" in columns:
        table["payload_kg"] = campaign.payload_kg
    if "approach" in columns:
        table |= {f"approach{i + 1}": campaign.approach[:, i] for i in range(n)}
    if campaign.repeats:
        table["pose_id"] = campaign.pose_id
    text = io.StringIO()
    np.savetxt(text, np.stack(list(table.values()), axis=1), "%.12g", ",", header=",".join(table), comments="")
    return text.getvalue()


def ticking(rng, count):
    """Times that start at 0, 5 to 20 s apart."""
    return np.concatenate([[0.0], np.cumsum(np.round(rng.uniform(5.0, 20.0, count - 1), 1))])


def _weather(rng, progress):
    """A trend and slow waves, 3 to 10 K between coldest and warmest."""
    curve = rng.normal() * progress
    for _ in range(3):
        curve = curve + 0.5 * rng.normal() * np.cos(2 * np.pi * (rng.uniform(0.3, 3.0) * progress + rng.random()))
    return rng.uniform(18, 26) + rng.uniform(3, 10) * (curve - curve[0]) / np.ptp(curve)


def tracker_frame(rng):
    """The world X_MW as seen by a tracker 2 to 4 m away, turned by any angle, level to 0.02 rad."""
    X = np.eye(4)
    turn = rotation(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    X[:3, :3] = rotation(rng.normal(scale=0.02, size=3)) @ turn
    angle = rng.uniform(-np.pi, np.pi)
    X[:3, 3] = rng.uniform(2.0, 4.0) * np.array([np.cos(angle), np.sin(angle), -0.25])
    return X
