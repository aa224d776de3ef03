"""What can be wrong with a virtual robot besides its frames: a few causes, drawn from its seed.

The formulas are written here and gravity is Drake's: nothing is taken from what truepath fits. Frames: W world of the
cell, M of the tracker, E reflector.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from truepath import lie
from truepath.errors import InputError
from truepath.lie import Array
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.visits import CAMPAIGN_S, Visits

MOST_JOINTS = 2
HEAVY = 0.2  # of the largest swing of a gravity torque: a joint below it would hardly show that it is soft
POSES_WEIGHED = 200


@dataclass(frozen=True)
class HiddenCause:
    """A cause with its sizes (SI, units in the names, for the truth file); each kind overrides what it moves."""

    sizes: list[dict[str, Any]] = field(default_factory=list)
    needs_approach: ClassVar[bool] = False

    @classmethod
    def drawn(cls, rng: np.random.Generator, real: RealRobot) -> HiddenCause:
        """The cause as a robot may have it."""
        raise NotImplementedError

    @property
    def joints(self) -> list[int]:
        """From 1; empty where no joint is concerned."""
        return [size["joint"] for size in self.sizes if "joint" in size]

    def joint_errors(self, visits: Visits) -> Array:
        """``(N, n)`` by how much the joints stand off from their commands, rad."""
        errors = np.zeros_like(visits.q_rad)
        for size in self.sizes:
            if "joint" in size:
                i = size["joint"] - 1
                errors[:, i] = self._turn(size, visits.q_rad[:, i], visits.torque_nm[:, i], visits.approach[:, i])
        return errors

    def moved(self, X_ME: Array, visits: Visits) -> Array:
        """Poses ``(N, 4, 4)`` after whatever else moves: what the tracker would see."""
        return X_ME

    def _turn(self, size: dict[str, Any], q_rad: Array, torque_nm: Array, approach: Array) -> Array:
        raise NotImplementedError


class TransmissionError(HiddenCause):
    """A gear or encoder out of round: amplitude sin(cycles q + phase). On a joint with a long lever."""

    @classmethod
    def drawn(cls, rng: np.random.Generator, real: RealRobot) -> HiddenCause:
        def wave(joint: int) -> dict[str, Any]:
            size = {"joint": joint, "amplitude_rad": rng.uniform(60e-6, 150e-6)}
            return size | {"cycles_per_turn": int(rng.integers(3, 13)), "phase_rad": rng.uniform(-np.pi, np.pi)}

        return cls([wave(joint) for joint in _some(rng, _first_half(real))])

    def _turn(self, size: dict[str, Any], q_rad: Array, torque_nm: Array, approach: Array) -> Array:
        return size["amplitude_rad"] * np.sin(size["cycles_per_turn"] * q_rad + size["phase_rad"])


class JointCompliance(HiddenCause):
    """A joint that yields to gravity by 1 to 3 arc minutes under the largest torque: c tau(q). On a heavy joint."""

    @classmethod
    def drawn(cls, rng: np.random.Generator, real: RealRobot) -> HiddenCause:
        lower, upper = np.maximum(real.robot.lower_rad, -np.pi), np.minimum(real.robot.upper_rad, np.pi)
        torque_nm = real.gravity_torques(np.random.default_rng(0).uniform(lower, upper, (POSES_WEIGHED, len(lower))))
        swing = torque_nm.std(axis=0)
        if not swing.max() > 0:
            raise InputError("no joint of this robot feels gravity", expected="a model with masses, to hide compliance")
        heavy = [i + 1 for i in range(len(lower)) if swing[i] >= HEAVY * swing.max()]
        largest = np.abs(torque_nm).max(axis=0)
        return cls(
            [
                {"joint": joint, "compliance_rad_per_nm": rng.uniform(0.3e-3, 0.9e-3) / largest[joint - 1]}
                for joint in _some(rng, heavy)
            ]
        )

    def _turn(self, size: dict[str, Any], q_rad: Array, torque_nm: Array, approach: Array) -> Array:
        return size["compliance_rad_per_nm"] * torque_nm


class Backlash(HiddenCause):
    """Play of a gear: the joint stops half its width short of the command, seen in the direction of travel."""

    needs_approach = True

    @classmethod
    def drawn(cls, rng: np.random.Generator, real: RealRobot) -> HiddenCause:
        joints = _some(rng, _first_half(real))
        return cls([{"joint": joint, "width_rad": rng.uniform(200e-6, 600e-6)} for joint in joints])

    def _turn(self, size: dict[str, Any], q_rad: Array, torque_nm: Array, approach: Array) -> Array:
        return -0.5 * size["width_rad"] * approach


class FrameDrift(HiddenCause):
    """The tracker slips once: from a moment on everything seems shifted, and turned about the tracker."""

    @classmethod
    def drawn(cls, rng: np.random.Generator, real: RealRobot) -> HiddenCause:
        size = {"moment_s": _moment(rng), "shift_m": _vector(rng, 0.1e-3, 0.3e-3)}
        return cls([size | {"turn_rad": _vector(rng, 0.1e-3, 0.2e-3)}])

    def moved(self, X_ME: Array, visits: Visits) -> Array:
        (size,) = self.sizes
        slip = lie.make_pose(lie.from_rotation_vector(np.array(size["turn_rad"])), np.array(size["shift_m"]))
        return np.where((visits.time_s > size["moment_s"])[:, None, None], slip @ X_ME, X_ME)


class ToolShift(HiddenCause):
    """The reflector slips in its nest once, along its own axes."""

    @classmethod
    def drawn(cls, rng: np.random.Generator, real: RealRobot) -> HiddenCause:
        return cls([{"moment_s": _moment(rng), "shift_m": _vector(rng, 0.1e-3, 0.3e-3)}])

    def moved(self, X_ME: Array, visits: Visits) -> Array:
        (size,) = self.sizes
        slip = lie.make_pose(translation=np.array(size["shift_m"]))
        return np.where((visits.time_s > size["moment_s"])[:, None, None], X_ME @ slip, X_ME)


# Names as in a diagnosis. New ones go to the end: the place of a cause is part of the seed of its sizes.
CAUSES: dict[str, type[HiddenCause]] = {
    "transmission_error": TransmissionError,
    "joint_compliance": JointCompliance,
    "backlash": Backlash,
    "frame_drift": FrameDrift,
    "tool_shift": ToolShift,
}


def draw_causes(real: RealRobot, names: Sequence[str]) -> dict[str, HiddenCause]:
    """The named causes as the robot of this seed has them: each the same whichever others are hidden too.

    Raises:
        InputError: an unknown name.
    """
    for name in names:
        if name not in CAUSES:
            raise InputError(f"no cause {name!r} can be hidden", expected="one of " + ", ".join(CAUSES))
    places = {name: list(CAUSES).index(name) for name in names}
    return {name: CAUSES[name].drawn(np.random.default_rng([real.seed, place]), real) for name, place in places.items()}


def true_poses(real: RealRobot, visits: Visits, causes: Sequence[HiddenCause], X_MW: Array | None = None) -> Array:
    """``(N, 4, 4)`` true poses X_ME of the reflector, by Drake, all causes being at work; M is W without ``X_MW``."""
    q_rad = sum((cause.joint_errors(visits) for cause in causes), visits.q_rad)
    X_ME = real.reflector_poses(q_rad) if X_MW is None else X_MW @ real.reflector_poses(q_rad)
    for cause in causes:
        X_ME = cause.moved(X_ME, visits)
    return X_ME


def _some(rng: np.random.Generator, joints: list[int]) -> list[int]:
    count = int(rng.integers(1, min(MOST_JOINTS, len(joints)) + 1))
    return sorted(int(joint) for joint in rng.choice(joints, count, replace=False))


def _first_half(real: RealRobot) -> list[int]:
    """Joints far from the reflector: what they do is magnified by the arm."""
    return list(range(1, max(1, real.robot.num_joints // 2) + 1))


def _moment(rng: np.random.Generator) -> float:
    return float(rng.uniform(0.3, 0.7) * CAMPAIGN_S)


def _vector(rng: np.random.Generator, least: float, most: float) -> list[float]:
    direction = rng.normal(size=3)
    return list(rng.uniform(least, most) * direction / np.linalg.norm(direction))
