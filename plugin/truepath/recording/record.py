"""``truepath record`` between its files and the campaign: everything is checked, nothing has moved yet."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.planning.pose_list import PoseList, read_pose_list
from truepath.recording.campaign import Campaign
from truepath.recording.circumstances import Circumstances, tracker_kind
from truepath.recording.connected_robot import require_same_robot
from truepath.recording.free_robot import require_free_robot, serial_number
from truepath.recording.limits import require_of_robot, require_within_limits
from truepath.recording.manner import Manner
from truepath.recording.payload import extra_payload_kg
from truepath.recording.row_file import RowFile, require_free
from truepath.recording.trackers import open_tracker
from truepath.recording.visit import columns
from truepath.robot import NominalRobot
from truepath.robot_link import RobotLink

TIMEOUT_S = 2.0  # of a robot that may be moving; the client crashes after 2.5
MOST_PAYLOAD_KG = 100.0


@dataclass(frozen=True, eq=False)
class Intention:
    """What is about to happen, for whoever must agree.

    Attributes:
        left, total: poses to be measured now, and of the list.
        first_row: of the list, from 0, to which the robot moves first.
        known: whether it stands on a way of the list; if not, nobody has looked at its first move.
        travel_deg: ``(n,)`` of the first move.
        remark: what could not be looked at; empty if nothing.
    """

    left: int
    total: int
    first_row: int
    known: bool
    travel_deg: Array
    remark: str


@contextmanager
def prepared(
    poses_file: Path,
    host: str,
    tracker_spec: str,
    output: Path,
    robot: NominalRobot,
    manner: Manner,
    *,
    resume: bool = False,
    payload_kg: float | None = None,
) -> Iterator[tuple[Campaign, Intention | None]]:
    """A campaign that may begin, and what it will do first (None: everything is measured). All is closed afterwards.

    Args:
        poses_file: as ``planning.pose_list`` reads it.
        host: of the controller.
        tracker_spec: see ``trackers.open_tracker``.
        output: data set; see ``row_file``.
        robot: whose joint limits the list must keep.
        manner: of driving and measuring.
        resume: go on with the output.
        payload_kg: on the flange beyond the model's; None takes what the controller is set to.

    Raises:
        InputError: the files, the tracker's lines, the settings.
        RobotFault: the robot is not there, or not able to move, or in use, or another one.
    """
    if payload_kg is not None and not 0.0 <= payload_kg <= MOST_PAYLOAD_KG:
        expected = f"0 to {MOST_PAYLOAD_KG:g} kg"
        raise InputError("this is no payload of a robot", expected=expected, found=f"{payload_kg:g} kg")
    poses, sha256 = _read(poses_file)
    require_of_robot(poses, robot, str(poses_file))
    require_within_limits(poses, robot, str(poses_file))
    require_free(output, resume=resume)
    with RobotLink(host, TIMEOUT_S) as link, open_tracker(tracker_spec, host) as tracker:
        state = require_free_robot(link)
        if payload_kg is None:
            payload_kg = extra_payload_kg(state, robot)
        header = columns(robot.num_joints, tracker.gives_orientation)
        made_with = Circumstances(robot.model_sha256, payload_kg, tracker_kind(tracker_spec), serial_number(link))
        with RowFile(output, poses, sha256, header, resume=resume, circumstances=made_with) as rows:
            campaign = Campaign(link, tracker, poses, rows, robot, payload_kg, manner)
            if not campaign.to_do():
                yield campaign, None
                return
            remark = require_same_robot(link, robot)
            way, travel_rad = campaign.first_route()
            left, total = len(campaign.to_do()), int(poses.measure.sum())
            yield campaign, Intention(left, total, way.rows[0], way.known, np.degrees(travel_rad), remark)


def _read(poses_file: Path) -> tuple[PoseList, str]:
    """The list, and the hash of the bytes that were parsed."""
    before = _sha256(poses_file)
    poses = read_pose_list(poses_file)
    if _sha256(poses_file) != before:
        raise InputError("the file was changed while it was read", file=poses_file, expected="a file at rest")
    return poses, before


def _sha256(file: Path) -> str:
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError:  # who reads the table says why
        return ""
