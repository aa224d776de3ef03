"""Simulated measuring campaigns: poses free of collision, measured on a real robot with noise."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from truepath import lie
from truepath.errors import InputError
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.virtual.hidden_causes import HiddenCause, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.visits import CAMPAIGN_S, Visits

MOST_TRIES_PER_POSE = 400
LEAST_HEIGHT_M = 0.05  # of the reflector above the floor: lower, the tracker does not see it


@dataclass(frozen=True)
class Campaign:
    """How a virtual robot is measured.

    Attributes:
        poses: number of different poses.
        noise_mm: standard deviation of each measured coordinate.
        orientation_noise_mrad: of each component of a measured orientation; None measures a mere reflector.
        repeats: visits of each pose.
        tracker: measure in the frame of a tracker that stands somewhere, instead of in the cell's world.
        seed: of poses, noise and tracker.
    """

    poses: int = 300
    noise_mm: float = 0.02
    orientation_noise_mrad: float | None = None
    repeats: int = 1
    tracker: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.poses, self.repeats) < 1:
            raise InputError("a campaign without poses", expected="one pose and one visit of it, or more")
        for noise in (self.noise_mm, self.orientation_noise_mrad or 0.0):
            if not (math.isfinite(noise) and noise >= 0):
                raise InputError("this is no size of noise", expected="0 or a finite positive number", found=str(noise))
        if self.seed < 0:
            raise InputError("a seed cannot be negative", found=str(self.seed))


def free_poses(real: RealRobot, count: int, rng: np.random.Generator) -> Array:
    """``(count, n)`` random joints within limits (half a turn at most), free of collision, the reflector in sight.

    Raises:
        InputError: hardly any pose of the cell is free.
    """
    lower = np.maximum(real.robot.lower_rad, -np.pi)
    upper = np.minimum(real.robot.upper_rad, np.pi)
    found: list[Array] = []
    for _ in range(MOST_TRIES_PER_POSE * count):
        q = rng.uniform(lower, upper)
        if real.is_free(q) and real.reflector_poses(q[None])[0, 2, 3] > LEAST_HEIGHT_M:
            found.append(q)
            if len(found) == count:
                return np.array(found)
    raise InputError(f"only {len(found)} of {count} poses free of collision were found in {real.spec}")


def measure(
    real: RealRobot, q_rad: Array, campaign: Campaign, causes: Mapping[str, HiddenCause] | None = None
) -> Measurements:
    """Measures the robot at joints ``(N, n)``, each ``campaign.repeats`` times, one round after the other.

    With hidden causes the time is recorded, and with play the direction from which each joint arrived.
    """
    hidden = list((causes or {}).values())
    rng = np.random.default_rng([campaign.seed, 1])
    X_MW = _somewhere(rng) if campaign.tracker else None
    q_rad, rounds = np.tile(q_rad, (campaign.repeats, 1)), np.tile(np.arange(len(q_rad)), campaign.repeats)
    visits = Visits.of(real, q_rad, _times(campaign, len(q_rad)))
    X_ME = true_poses(real, visits, hidden, X_MW)
    position = X_ME[:, :3, 3] + rng.normal(scale=1e-3 * campaign.noise_mm, size=(len(X_ME), 3))
    R_ME = None
    if campaign.orientation_noise_mrad is not None:
        turn = rng.normal(scale=1e-3 * campaign.orientation_noise_mrad, size=(len(X_ME), 3))
        R_ME = lie.from_rotation_vector(turn) @ X_ME[:, :3, :3]
    return Measurements(
        q_rad=q_rad,
        p_ME=position,
        R_ME=R_ME,
        time_s=visits.time_s if hidden else None,
        approach=visits.approach if any(cause.needs_approach for cause in hidden) else None,
        pose_id=rounds if campaign.repeats > 1 else None,
        source="virtual cell",
    )


def to_csv(measurements: Measurements) -> str:
    """The data set as truepath's CSV."""
    n = measurements.q_rad.shape[1]
    columns = {f"q{i + 1}_rad": (measurements.q_rad[:, i], "%.12f") for i in range(n)}
    columns |= {f"{axis}_mm": (1e3 * measurements.p_ME[:, k], "%.6f") for k, axis in enumerate("xyz")}
    if measurements.R_ME is not None:
        quaternion = lie.to_quaternion(measurements.R_ME)
        columns |= {name: (quaternion[:, k], "%.12f") for k, name in enumerate(("qw", "qx", "qy", "qz"))}
    if measurements.time_s is not None:
        columns["t_s"] = (measurements.time_s, "%.1f")
    if measurements.approach is not None:
        columns |= {f"approach{i + 1}": (measurements.approach[:, i], "%d") for i in range(n)}
    if measurements.pose_id is not None:
        columns["pose_id"] = (measurements.pose_id, "%d")
    cells = np.stack([np.char.mod(form, values) for values, form in columns.values()], axis=1)
    return "\n".join([",".join(columns), *(",".join(row) for row in cells)]) + "\n"


def truth_json(real: RealRobot, campaign: Campaign, causes: Mapping[str, HiddenCause] | None = None) -> str:
    """What was hidden, for whoever wants to check a calibration or a diagnosis afterwards."""
    stated = asdict(campaign)
    stated["poses_seed"] = stated.pop("seed")  # the robot has one, too
    content: dict[str, Any] = {
        "schema": "truepath.truth/1",
        "cell": str(real.spec),
        "robot_seed": real.seed,
        "campaign": stated,
        "hidden_frame_errors": real.hidden_errors,
    }
    if causes:
        content["hidden_causes"] = [
            {"effect": name, "joints": cause.joints, "sizes": cause.sizes} for name, cause in causes.items()
        ]
    return json.dumps(content, indent=1) + "\n"


def _times(campaign: Campaign, count: int) -> Array:
    """When the poses are measured: not quite regularly, the last one before the campaign is over."""
    late = np.random.default_rng([campaign.seed, 2]).uniform(0.0, 0.9, count)
    return np.round(CAMPAIGN_S / count * (np.arange(count) + late), 1)


def _somewhere(rng: np.random.Generator) -> Array:
    """Pose X_MW of the cell seen by a tracker that stands 2 to 4 m away, turned by any angle, level to 0.02 rad."""
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(2.0, 4.0)
    level = lie.from_rotation_vector(rng.normal(scale=0.02, size=3))
    R_MW = level @ lie.from_rotation_vector(np.array([0.0, 0.0, angle]))
    return lie.make_pose(R_MW, np.array([distance, rng.normal(), rng.normal(scale=0.3)]))
