"""The commands of ur_rtde's control script, by number; what is missing here the virtual controller does not know."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from truepath.errors import InputError
from truepath.lie import Array
from truepath.virtual.controller.control_state import ControlState, Done
from truepath.virtual.controller.driving import drive
from truepath.virtual.controller.injected_path import PathStep
from truepath.virtual.controller.kinematics import pose_vector
from truepath.virtual.controller.motions import AtSpeed, Pursuit
from truepath.virtual.controller.planning import Leg, at_tool_speed, joints_of, pose_of

LEAST_LAG_S, MOST_LAG_S = 0.03, 0.2  # servoj accepts no other lookahead
MOST_JOINT_SPEED = 6.5  # rad/s, twice what the joints of a UR do
STEP_S = 0.002

Command = Callable[[ControlState, Done], None]


def _move(state: ControlState, legs: list[Leg], done: Done, steps: list[PathStep] | None = None) -> None:
    """Now, or by itself if the client does not want to wait."""
    state.end_by_itself()
    alone = state.int_in(1) == 1

    def begins(number: int) -> None:
        if state.alive and steps is not None and steps[number].progress is not None:
            state.write_progress(state.progress.reached(steps[number].progress or 0))

    if alone:
        state.begin_by_itself()
    drive(state.machine, legs, state.end_by_itself if alone else done, begins)
    if alone:
        done()


def _target(state: ControlState, numbers: list[float], is_pose: bool, joint: bool, q_near: Array) -> Array:
    """Joints ``(6,)`` of a joint move, X_CT of a line, whichever of the two the client has sent."""
    if not is_pose:
        q = joints_of(numbers, state.machine.kinematics)
        return q if joint else state.machine.kinematics.forward(q) @ state.machine.X_0T
    X_CT = pose_of(numbers)
    if not joint:
        return X_CT
    found = state.inverse(X_CT, q_near)
    if found is None:
        raise InputError("no joints lead to this pose", found=str(np.round(numbers, 4).tolist()))
    return found


def _single(is_pose: bool, joint: bool) -> Command:
    def command(state: ControlState, done: Done) -> None:
        target = _target(state, state.doubles(0, 6), is_pose, joint, state.q)
        speed, acceleration = state.doubles(6, 2)
        _move(state, [Leg(target, speed, acceleration)], done)

    return command


def _path(state: ControlState, done: Done) -> None:
    if not state.path:
        raise InputError("there is no path to be driven")
    legs: list[Leg] = []
    q_near = state.q
    for step in state.path:
        target = _target(state, list(step.target), step.is_pose, step.joint, q_near)
        legs.append(Leg(target, step.speed, step.acceleration, blend_m=step.blend_m))
        q_near = target if step.joint else q_near
    _move(state, legs, done, state.path)


def _speed_joints(state: ControlState, done: Done) -> None:
    speeds, acceleration = np.array(state.doubles(0, 6)), state.double(6)
    if not (np.isfinite(speeds).all() and np.abs(speeds).max() <= MOST_JOINT_SPEED and 0 < acceleration < np.inf):
        raise InputError("joint speeds that are none", found=str(speeds.tolist()))
    state.speed_is_of_tool = False
    state.machine.arm.begin(AtSpeed(*state.machine.arm.sample(), speeds, acceleration))


def _speed_tool(state: ControlState, done: Done) -> None:
    machine = state.machine
    state.speed_is_of_tool = True
    motion = at_tool_speed(
        machine.kinematics, *machine.arm.sample(), machine.X_0T, state.doubles(0, 6), state.double(6)
    )
    machine.arm.begin(motion)


def _servo(is_pose: bool) -> Command:
    def command(state: ControlState, done: Done) -> None:
        goal = _target(state, state.doubles(0, 6), is_pose, True, state.q)
        lag = float(np.clip(state.double(9), LEAST_LAG_S, MOST_LAG_S)) if np.isfinite(state.double(9)) else MOST_LAG_S
        state.machine.arm.begin(Pursuit(*state.machine.arm.sample(), goal, lag))

    return command


def _speed_stop(state: ControlState, done: Done) -> None:
    state.machine.arm.stop(state.double(0), state.speed_is_of_tool, done)


def _servo_stop(state: ControlState, done: Done) -> None:
    state.machine.arm.stop(state.double(0), True, done)


def _stop(tool: bool) -> Command:
    def command(state: ControlState, done: Done) -> None:
        state.end_by_itself()
        alone = state.int_in(1) == 1
        if alone:
            state.begin_by_itself()
        state.machine.arm.stop(state.double(0), tool, state.end_by_itself if alone else done)
        if alone:
            done()

    return command


def _at_once(work: Callable[[ControlState], None]) -> Command:
    def command(state: ControlState, done: Done) -> None:
        work(state)
        done()

    return command


def _set_payload(state: ControlState) -> None:
    mass, *centre = state.doubles(0, 4)
    state.machine.set_payload(mass, centre if any(centre) else None)  # zeros: the centre stays, as in the script


def _set_target_payload(state: ControlState) -> None:
    _set_payload(state)
    inertia = np.array(state.doubles(4, 6))
    if not np.isfinite(inertia).all():
        raise InputError("an inertia that is none")
    state.machine.inertia = inertia


def _inverse(state: ControlState) -> Array | None:
    """With the posture to be near to, where the client says one (commands 30 and 61)."""
    near = joints_of(state.doubles(6, 6), state.machine.kinematics) if state.int_in(0) in (30, 61) else None
    return state.inverse(pose_of(state.doubles(0, 6)), near)


def _inverse_kinematics(state: ControlState) -> None:
    q = _inverse(state)
    if q is None:
        raise InputError("no joints lead to this pose", found=str(np.round(state.doubles(0, 6), 4).tolist()))
    state.write_doubles(0, q)


def _forward_of(state: ControlState) -> None:
    """Of the client's joints; it sends the tool as well, or zeros in the registers of a shorter recipe."""
    q = joints_of(state.doubles(0, 6), state.machine.kinematics)
    state.write_doubles(0, pose_vector(state.machine.kinematics.forward(q) @ pose_of(state.doubles(6, 6))))


def _joints_of_before(state: ControlState) -> None:
    if state.int_in(1) != 0:
        raise InputError("joints of a while ago are not known to the virtual controller", expected="0 steps")
    state.write_doubles(0, state.q)


def _joints_allowed(state: ControlState) -> None:
    try:
        joints_of(state.doubles(0, 6), state.machine.kinematics)
    except InputError:
        state.answer(False)
    else:
        state.answer(True)


def _protective_stop(state: ControlState) -> None:
    state.machine.protective_stop("asked for by a program")


def _nothing(state: ControlState) -> None:
    """What changes nothing here: there is no force sensor, and gravity is where the cell has it."""


COMMANDS: dict[int, Command] = {
    1: _single(is_pose=False, joint=True),
    2: _single(is_pose=True, joint=True),
    3: _single(is_pose=True, joint=False),
    4: _single(is_pose=False, joint=False),
    8: _at_once(_nothing),
    9: _speed_joints,
    10: _speed_tool,
    11: _servo(is_pose=False),
    15: _speed_stop,
    16: _servo_stop,
    17: _at_once(_set_payload),
    24: _servo(is_pose=True),
    26: _at_once(lambda state: state.write_doubles(0, np.array([STEP_S]))),
    27: _at_once(_joints_of_before),
    29: _at_once(lambda state: state.machine.set_tcp(state.doubles(0, 6))),
    30: _at_once(_inverse_kinematics),
    31: _at_once(_protective_stop),
    33: _stop(tool=True),
    34: _stop(tool=False),
    35: _at_once(lambda state: state.set_watchdog(state.double(0))),
    36: _at_once(lambda state: state.answer(_inverse(state) is not None)),
    37: _at_once(_joints_allowed),
    38: _at_once(lambda state: state.write_doubles(0, state.machine.kinematics.gravity_torques(state.q))),
    39: _at_once(
        lambda state: state.write_doubles(0, pose_vector(pose_of(state.doubles(0, 6)) @ pose_of(state.doubles(6, 6))))
    ),
    40: _at_once(lambda state: state.write_doubles(0, state.machine.tcp_offset)),
    43: _at_once(lambda state: state.write_doubles(0, pose_vector(state.X_CT))),
    44: _at_once(_forward_of),
    45: _path,
    46: _at_once(_inverse_kinematics),
    47: _at_once(lambda state: state.answer(state.machine.arm.stands)),
    58: _at_once(lambda state: state.write_doubles(0, pose_vector(state.machine.kinematics.forward(state.q)))),
    59: _at_once(_nothing),
    60: _at_once(lambda state: state.answer(_inverse(state) is not None)),
    61: _at_once(lambda state: state.answer(_inverse(state) is not None)),
    65: _at_once(_set_target_payload),
}
# A client does not wait for these to be done: they replace one another.
CONTINUOUS = frozenset({9, 10, 11, 24, 26, 27, 38, 58})
