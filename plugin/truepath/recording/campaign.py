"""The campaign: drive along the list, stand still, look, write the row, go on."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from truepath.lie import Array
from truepath.planning.pose_list import PoseList
from truepath.recording.belonging import Belonging
from truepath.recording.circumstances import SAME_PAYLOAD_KG
from truepath.recording.departures import Departures
from truepath.recording.free_robot import require_free_robot
from truepath.recording.manner import Manner
from truepath.recording.readings import BeamBroken, Reading
from truepath.recording.route import Route, back_and_forth, route
from truepath.recording.row_file import RowFile
from truepath.recording.trackers import Tracker
from truepath.recording.visit import Visit, cells
from truepath.robot import NominalRobot
from truepath.robot_link import ControlLost, RobotFault, RobotLink, RobotState
from truepath.robot_link.readiness import is_in_remote_control
from truepath.robot_link.standstill import STILL_RAD, wait_until_still

MOVED_RAD = 1e-6  # less, and a joint keeps the side from which it came
ELSEWHERE_RAD = 2e-4
NOT_OURS = "the robot was stopped or paused, at the pendant or by another program, while it stood at a pose"


@dataclass
class Outcome:
    """What became of a campaign.

    Attributes:
        measured: visits recorded now.
        skipped: rows of the list that could not be measured, and why.
    """

    measured: int = 0
    skipped: dict[int, str] = field(default_factory=dict)


class Campaign:
    """A robot, a tracker, a list of poses and a file for the rows.

    Args:
        link: to the robot.
        tracker: that sees its reflector.
        poses: the list.
        rows: where visits go; what is done already is left out.
        robot: as drawn; readings that cannot be of it are not believed.
        payload_kg: to be written in each row.
        manner: of driving and measuring.

    Raises:
        RobotFault: the rows that are there do not fit together; the robot does not answer.
    """

    def __init__(
        self,
        link: RobotLink,
        tracker: Tracker,
        poses: PoseList,
        rows: RowFile,
        robot: NominalRobot,
        payload_kg: float,
        manner: Manner,
    ) -> None:
        self._link, self._tracker, self._poses, self._rows = link, tracker, poses, rows
        self._payload_kg, self._manner = payload_kg, manner
        self._say: Callable[[str], None] = lambda text: None
        self._approach = np.zeros(poses.q_rad.shape[1], int)
        self._departures, self._belonging = Departures(tracker, robot), Belonging(robot, rows.taken_over)
        self._payload_set_kg = link.state().payload_kg
        self._has_moved, self._in_control_since_s = False, math.inf
        self._at: int | None = None
        self._agreed_q_rad: Array | None = None

    def run(self, say: Callable[[str], None] = lambda text: None) -> Outcome:
        """Measures what is not done yet; what could not be seen is tried once more at the end.

        Args:
            say: called with what is being done.

        Raises:
            ControlLost: somebody has stopped the robot, or runs another program on it.
            RobotFault: the robot stopped or is lost, or the tracker has lost the reflector for good.
            InputError: the tracker says nonsense, or the disk is full. Rows written stay in every case.
        """
        self._say, outcome = say, Outcome()
        self._pass(self.to_do(), outcome)
        again, outcome.skipped = sorted(outcome.skipped), {}
        self._pass(again, outcome)
        return outcome

    def require_free_robot(self) -> None:
        """To be asked once more after a question was answered. Raises RobotFault: the robot is in use by now."""
        require_free_robot(self._link)

    def to_do(self) -> list[int]:
        """Rows of the list that are to be measured and are not yet."""
        return [int(row) for row in np.flatnonzero(self._poses.measure) if int(row) not in self._rows.done]

    def first_route(self) -> tuple[Route, Array]:
        """The way to the first pose that is to be measured from where the robot stands, and by how much each joint
        ``(n,)`` turns in the first move, rad. From elsewhere the campaign will not begin.
        """
        self._agreed_q_rad = self._link.state().q_target_rad
        way = route(self._poses.q_rad, self._agreed_q_rad, self.to_do()[0])
        return way, self._poses.q_rad[way.rows[0]] - self._agreed_q_rad

    def _pass(self, goals: Iterable[int], outcome: Outcome) -> None:
        in_a_row = 0
        for goal in goals:
            for k, row in enumerate(self._way_to(goal)):
                self._say(self._progress(goal))
                if k == 0:  # the robot has stood still before: it can be seen how late the tracker tells
                    self._departures.robot_leaves()
                    self._samples()
                self._drive(row)
                if k == 0:
                    self._departures.look(self._samples())
            try:
                visit = self._visit(goal)
            except BeamBroken as broken:
                outcome.skipped[goal] = str(broken)
                in_a_row += 1
                self._say(f"pose {goal + 1} is left for later: {broken}")
                if in_a_row >= self._manner.skipped_in_a_row:
                    raise RobotFault(f"no reading at {in_a_row} poses in a row; at the last: {broken}") from None
                continue
            in_a_row = 0
            self._rows.append(goal, cells(visit))
            outcome.measured += 1

    def _way_to(self, goal: int) -> tuple[int, ...]:
        if self._at is None:
            q_now = self._link.state().q_target_rad
            return route(self._poses.q_rad, q_now, goal).rows
        if goal > self._at:
            return tuple(range(self._at + 1, goal + 1))
        return back_and_forth(self._poses.q_rad, self._at, goal)

    def _drive(self, row: int) -> None:
        goal = self._poses.q_rad[row]
        if is_in_remote_control(self._link) is False:
            raise RobotFault("the robot was switched to local control")
        now = self._link.state() if self._has_moved else require_free_robot(self._link)
        self._require_ours([now])
        q_now = now.q_target_rad
        where = self._agreed_q_rad if self._at is None else self._poses.q_rad[self._at]
        if where is not None:
            _require_place(q_now, where)
        travel = goal - q_now
        self._at = None  # while it is under way
        speed, acceleration = np.radians([self._manner.speed_deg_s, self._manner.acceleration_deg_s2])
        self._link.move_joints(goal, float(speed), float(acceleration))
        if not self._has_moved:
            self._has_moved, self._in_control_since_s = True, time.monotonic()
        # A joint that did not move rests on the side on which it was.
        self._approach = np.where(np.abs(travel) > MOVED_RAD, np.sign(travel), self._approach).astype(int)
        self._at = row

    def _visit(self, row: int) -> Visit:
        """Stands still and looks, a few times over. Raises BeamBroken if all of them fail."""
        why = ""
        for attempt in range(self._manner.tries):
            if attempt:
                self._say(f"{self._progress(row)}; again, because {why}")
                self._wait_watching()
            still_s = self._manner.settle_s + self._departures.delay_s
            self._require_ours(wait_until_still(self._link, still_s, self._manner.rest_s))
            self._departures.tracker_shows_standing()
            self._samples()
            try:
                reading = self._tracker.reading(self._manner.measure_s)
            except BeamBroken as broken:
                why = str(broken)
                continue
            during = [*self._samples(), self._link.state()]
            why = self._why_not_still(row, during, reading)
            if not why:
                return self._recorded(row, during, reading)
        raise BeamBroken(why)

    def _wait_watching(self) -> None:
        """Waits for the beam, but not beside a robot that has stopped."""
        self._require_ours(wait_until_still(self._link, self._manner.between_tries_s, self._manner.rest_s))

    def _samples(self) -> list[RobotState]:
        samples = self._link.samples()
        self._require_ours(samples)
        return samples

    def _require_ours(self, samples: Sequence[RobotState]) -> None:
        """From the first move on the program of this campaign runs, and the payload stays as it was set.

        Raises:
            ControlLost: it has ended, or is paused.
            RobotFault: the payload was changed.
        """
        for state in samples:
            if state.arrived_s > self._in_control_since_s and state.able_to_move and not state.program_plays:
                raise ControlLost(NOT_OURS)
            _require_same_payload(state, self._payload_set_kg)

    def _why_not_still(self, row: int, during: list[RobotState], reading: Reading) -> str:
        self._require_ours(during)
        for state in during:
            if not state.able_to_move:
                raise RobotFault(f"the robot stopped: safety status {state.safety.replace('_', ' ')}")
            _require_place(state.q_target_rad, self._poses.q_rad[row])
        if np.ptp([state.q_rad for state in during], axis=0).max() > STILL_RAD:
            return "the robot was not still"
        if reading.spread_mm > self._manner.max_spread_mm:
            return f"the reflector was not still: spread {reading.spread_mm:.3f} mm"
        return self._belonging.why_not(row, self._poses.q_rad[row], reading.p_ME)

    def _recorded(self, row: int, during: list[RobotState], reading: Reading) -> Visit:
        return Visit(
            row=row,
            pose_id=int(self._poses.pose_id[row]),
            q_rad=self._poses.q_rad[row],
            q_actual_rad=np.mean([state.q_rad for state in during], axis=0),
            temperatures_c=np.mean([state.temperatures_c for state in during], axis=0),
            approach=self._approach,
            time_s=self._rows.time_s(),
            payload_kg=self._payload_kg,
            reading=reading,
        )

    def _progress(self, row: int) -> str:
        total = int(self._poses.measure.sum())
        return f"pose {row + 1}, {len(self._rows.done)} of {total} measured"


def _require_place(q_now_rad: Array, q_rad: Array) -> None:
    """Raises RobotFault if the robot is not where this campaign left it: the way from there is not one of the list."""
    if np.abs(q_now_rad - q_rad).max() > ELSEWHERE_RAD:
        raise RobotFault("somebody else has moved the robot meanwhile")


def _require_same_payload(state: RobotState, set_kg: float | None) -> None:
    """Raises RobotFault if the controller is set to another payload than when the campaign began."""
    if set_kg is None or state.payload_kg is None or abs(state.payload_kg - set_kg) <= SAME_PAYLOAD_KG:
        return
    raise RobotFault(
        f"the payload on the controller was changed from {set_kg:.2f} to {state.payload_kg:.2f} kg while recording"
    )
