"""``truepath record`` between its files and the campaign: everything is checked, nothing has moved yet."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath.lie import Array
from truepath.planning.pose_list import read_pose_list
from truepath.recording.campaign import Campaign
from truepath.recording.circumstances import Circumstances, tracker_kind
from truepath.recording.free_robot import require_free_robot, serial_number
from truepath.recording.limits import require_of_robot, require_within_limits
from truepath.recording.manner import Manner
from truepath.recording.payload import extra_payload_kg
from truepath.recording.row_file import RowFile, require_free
from truepath.recording.trackers import open_tracker
from truepath.recording.visit import columns
from truepath.robot import NominalRobot
from truepath.robot_link import RobotLink


@dataclass(frozen=True, eq=False)
class Intention:
    """What is about to happen, for whoever must agree.

    Attributes:
        left, total: poses to be measured now, and of the list.
        first_row: of the list, from 0, to which the robot moves first.
        known: whether it stands on a way of the list; if not, nobody has looked at its first move.
        travel_deg: ``(n,)`` of the first move.
    """

    left: int
    total: int
    first_row: int
    known: bool
    travel_deg: Array


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
        RobotFault: the robot is not there, or not able to move, or in use.
    """
    poses = read_pose_list(poses_file)
    require_of_robot(poses, robot, str(poses_file))
    require_within_limits(poses, robot, str(poses_file))
    require_free(output, resume=resume)
    with RobotLink(host) as link, open_tracker(tracker_spec, host) as tracker:
        state = require_free_robot(link)
        if payload_kg is None:
            payload_kg = extra_payload_kg(state, robot)
        header = columns(robot.num_joints, tracker.gives_orientation)
        sha256 = hashlib.sha256(poses_file.read_bytes()).hexdigest()
        made_with = Circumstances(robot.model_sha256, payload_kg, tracker_kind(tracker_spec), serial_number(link))
        with RowFile(output, poses, sha256, header, resume=resume, circumstances=made_with) as rows:
            campaign = Campaign(link, tracker, poses, rows, robot, payload_kg, manner)
            way, intention = campaign.first_route(), None
            if way is not None:
                travel_deg = np.degrees(poses.q_rad[way.rows[0]] - state.q_target_rad)
                total = int(poses.measure.sum())
                intention = Intention(len(campaign.to_do()), total, way.rows[0], way.known, travel_deg)
            yield campaign, intention
