"""Commands for meshcat's viewer, recorded instead of sent to a server."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import umsgpack

from truepath.lie import Array

SHARED_BYTES = 200  # geometries from this size on are stored once, however often they are used


@dataclass
class RecordedScene:
    """Commands for meshcat's viewer; also the window that meshcat's ``Visualizer`` sends them to.

    Attributes:
        chunks: pieces of packed commands; pieces that are alike are stored once.
        commands: each command as the numbers of the chunks that make it up.
        arm_points, path_points: ``(K, 3)`` what a view of everything, or of the paths alone, must hold, z up, m.
        region_points: ``(K, 3)`` what it must hold as well if the calibrated region is shown.
        view_direction: ``(3,)`` from there to the camera.
        joint_quaternions: ``(n, 4)`` x, y, z, w: how each joint's node is turned when its joint is at zero.
    """

    chunks: list[bytes] = field(default_factory=list)
    commands: list[list[int]] = field(default_factory=list)
    arm_points: Array = field(default_factory=lambda: np.zeros((1, 3)))
    path_points: Array = field(default_factory=lambda: np.zeros((1, 3)))
    region_points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    view_direction: Array = field(default_factory=lambda: np.ones(3))
    joint_quaternions: Array = field(default_factory=lambda: np.zeros((0, 4)))
    _number: dict[bytes, int] = field(default_factory=dict)

    def send(self, command: Any) -> None:
        """Takes a meshcat command, as meshcat's own window does."""
        lowered = command.lower()
        packed = _pack(lowered)
        geometries = [_pack(geometry) for geometry in lowered.get("object", {}).get("geometries", [])]
        parts = []
        for geometry in geometries:
            if len(geometry) >= SHARED_BYTES:
                before, geometry, packed = packed.partition(geometry)
                parts += [before, geometry]
        self.commands.append([self._store(part) for part in (*parts, packed)])

    def _store(self, part: bytes) -> int:
        if part not in self._number:
            self._number[part] = len(self.chunks)
            self.chunks.append(part)
        return self._number[part]


def _pack(content: Any) -> bytes:
    return umsgpack.packb(content, force_float_precision="single")
