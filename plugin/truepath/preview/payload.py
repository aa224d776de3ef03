"""The data of the page: arrays as binary, everything else as JSON."""

from __future__ import annotations

import base64
import json
from typing import Any, Literal

import numpy as np

from truepath.calibration_parts import StatisticsPart
from truepath.lie import Array
from truepath.preview import scene
from truepath.preview.keyframes import KeyFrames
from truepath.preview.recorded import RecordedScene
from truepath.preview.shown import ShownPath
from truepath.preview.stage import joint_node


def payload(
    shown: ShownPath, outside: Array, expected: StatisticsPart | None, recorded: RecordedScene, frames: KeyFrames
) -> str:
    """JSON that can stand in a script element; arguments as of ``page.render``.

    Args:
        expected: errors with the correction, of waypoints within the calibrated region; None: not known.
    """
    content: dict[str, Any] = {
        "root": scene.ROOT,
        "chunks": [base64.b64encode(chunk).decode("ascii") for chunk in recorded.chunks],
        "commands": recorded.commands,
        "views": {
            "arm": _binary(recorded.arm_points),
            "path": _binary(recorded.path_points),
            "region": _binary(recorded.region_points),
            "direction": recorded.view_direction.tolist(),
        },
        "region": scene.REGION_COVERED,
        "two_looks": [scene.PATH_UNCORRECTED, scene.ERROR_ARROWS],
        "arms": [scene.ARM, scene.GHOST],
        "joints": _binary(recorded.joint_quaternions),
        "joint_nodes": [joint_node(i) for i in range(len(recorded.joint_quaternions))],
        "frames": {
            "time_s": _binary(frames.time_s),
            "position": _binary(frames.position),
            "q_corrected": _binary(frames.q_corrected),
            "q_uncorrected": _binary(frames.q_uncorrected),
            "uncorrected_mm": _binary(frames.error_uncorrected_mm),
        },
        "waypoints": _binary(shown.waypoint, "u4"),
        "expected_mm": None if expected is None else expected.mean,
        "outside": _binary(outside, "u4"),
        "lines": None if shown.line is None else _binary(shown.line, "u4"),
        "labels": shown.labels,
    }
    # Within a script element nothing but its end tag (and a comment that hides it) can do harm: no "<" at all.
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _binary(values: Array, kind: Literal["f4", "u4"] = "f4") -> dict[str, str]:
    data = np.ascontiguousarray(values, "<" + kind).tobytes()
    return {"binary": kind, "base64": base64.b64encode(data).decode("ascii")}
