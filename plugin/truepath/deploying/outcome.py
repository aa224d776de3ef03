"""What a run has shown: where each target was commanded, where the robot was, and what that is at the tool."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from truepath.calibration import Calibration
from truepath.controller import Controller
from truepath.deploying.follow import Followed
from truepath.deploying.passages import ZONE_RAD, Passages
from truepath.deploying.rehearsal import Rehearsal
from truepath.iso9283 import ErrorStatistics
from truepath.lie import Array
from truepath.programs.motions import Kind


@dataclass(frozen=True, eq=False)
class Outcome:
    """Of a run.

    Attributes:
        rehearsal: what was commanded.
        followed: how it ended.
        reached_rad: ``(N, 6)`` joints nearest to each target, NaN where it was not passed.
        joint_off_rad: ``(N,)`` largest difference of one joint.
        tool_off_mm: ``(N,)`` distance of the tool from where the commanded joints put it, both by the calibration.
        time_s: ``(N,)`` of the controller's clock.
        count: targets that were passed, seen or not.
    """

    rehearsal: Rehearsal
    followed: Followed
    reached_rad: Array
    joint_off_rad: Array
    tool_off_mm: Array
    time_s: Array
    count: int

    @property
    def passed(self) -> int:
        return int((~np.isnan(self.time_s)).sum())

    @property
    def stops(self) -> Array:
        """``(N,)`` targets that were passed and at which the robot was to be, not only to come near."""
        return ~np.isnan(self.time_s) & (self.rehearsal.blend_m == 0)

    @property
    def unseen(self) -> int:
        """How many targets were passed while nothing was seen of the robot."""
        return self.count - self.passed

    @property
    def as_planned(self) -> bool:
        """It ran to its end, past all targets, and stands at the last one."""
        return self.followed.completed and self.passed + self.unseen == len(self.rehearsal) and self._stands_at_end

    @property
    def _stands_at_end(self) -> bool:
        """Where targets may have been passed unseen, standing there is what tells the end from a stop before it."""
        last = self.followed.last
        if not self.unseen or self.rehearsal.open_end or last is None:
            return True
        return bool(np.abs(last.q_rad - self.rehearsal.q_rad[-1]).max() <= ZONE_RAD)

    @property
    def ended(self) -> str:
        """In words."""
        if not self.followed.completed or self.as_planned:
            return self.followed.ended
        return f"the program ended after {self.passed + self.unseen} of {len(self.rehearsal)} targets"

    def summary(self) -> dict[str, Any]:
        """What a machine wants to know, as plain JSON types."""
        last = self.followed.last
        return {
            "schema": "truepath.deployment/1",
            "completed": self.as_planned,
            "ended": self.ended,
            "duration_s": self.followed.duration_s,
            "samples": self.followed.samples,
            "longest_gap_s": self.followed.gap_s,
            "targets": len(self.rehearsal),
            "via_points": self.rehearsal.through,
            "passed": self.passed,
            "passed_unseen": self.unseen,
            "not_known": self.rehearsal.open_end,
            "tool_off_mm": _statistics(self.tool_off_mm[self.stops]),
            "joint_off_deg": _statistics(np.degrees(self.joint_off_rad[self.stops])),
            "following_error_deg": float(np.degrees(self.followed.lag_rad)),
            "last_joints_rad": None if last is None else last.q_rad.tolist(),
            "per_target": [self._target(k) for k in range(len(self.rehearsal))],
        }

    def _target(self, k: int) -> dict[str, Any]:
        known = not np.isnan(self.time_s[k])
        return {
            "line": int(self.rehearsal.line[k]),
            "kind": Kind(self.rehearsal.kind[k]).name.lower(),
            "blend_mm": float(1e3 * self.rehearsal.blend_m[k]),
            "commanded_rad": self.rehearsal.q_rad[k].tolist(),
            "reached_rad": self.reached_rad[k].tolist() if known else None,
            "tool_off_mm": float(self.tool_off_mm[k]) if known else None,
        }


def outcome_of(
    rehearsal: Rehearsal, followed: Followed, passages: Passages, calibration: Calibration, controller: Controller
) -> Outcome:
    """Compares, through the calibration."""
    commanded, reached = rehearsal.q_rad, passages.reached_rad
    known = ~np.isnan(passages.time_s)
    tool_off = np.full(len(rehearsal), np.nan)
    if known.any():
        X_FT = controller.X_F0 @ rehearsal.X_0T[known]
        places = [(calibration.model.flange_poses(q[known]) @ X_FT)[:, :3, 3] for q in (commanded, reached)]
        tool_off[known] = 1e3 * np.linalg.norm(places[1] - places[0], axis=1)
    joint_off = np.abs(reached - commanded).max(axis=1, initial=0.0)
    return Outcome(rehearsal, followed, reached, joint_off, tool_off, passages.time_s, passages.count)


def _statistics(values: Array) -> dict[str, float] | None:
    return vars(ErrorStatistics.of(values)).copy() if len(values) else None
