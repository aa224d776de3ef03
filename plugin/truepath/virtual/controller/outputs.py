"""What can be read over RTDE, and where each value comes from."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from truepath.lie import Array
from truepath.virtual.controller.kinematics import pose_vector
from truepath.virtual.controller.machine import Machine
from truepath.virtual.controller.registers import COUNT

AMBIENT_C, RISE_C, WARM_UP_S = 24.0, (7.0, 9.5, 9.0, 12.0, 12.5, 13.0), 2400.0  # small joints get warmer
NM_PER_A = np.array([13.0, 13.0, 13.0, 9.5, 9.5, 9.5])  # of motor and gear, roughly as in a UR5
GRAVITY = 9.81
JOINT_RUNNING, JOINT_OFF, JOINT_IDLE = 253, 239, 255


class Posture:
    """What goes with the joints and the tool alone; computed when it is asked for, then kept."""

    def __init__(self, machine: Machine, q: Array) -> None:
        self._kinematics, self._X_0T, self._q = machine.kinematics, machine.X_0T, q
        self.key = (q.tobytes(), machine.X_0T.tobytes())

    @cached_property
    def tcp_pose(self) -> Array:
        return pose_vector(self._kinematics.forward(self._q) @ self._X_0T)

    @cached_property
    def torques(self) -> Array:
        """``(6,)`` N m; that which gravity asks for, without friction and inertia."""
        return self._kinematics.gravity_torques(self._q)

    @cached_property
    def acceleration_felt(self) -> Array:
        """``(3,)`` in the tool's frame, m/s^2: gravity alone."""
        return GRAVITY * self._X_0T[:3, :3].T @ self._kinematics.up(self._q)


class Sample:
    """The robot at one time; what is expensive is computed when it is asked for.

    Args:
        machine: the controller.
        time_s: of the robot.
        before: an earlier sample, whose posture is used again if it is the same.
    """

    def __init__(self, machine: Machine, time_s: float, before: Sample | None = None) -> None:
        self.machine, self.time_s = machine, time_s
        self.q, self.qd = machine.arm.sample(time_s)
        self.posture = Posture(machine, self.q)
        if before is not None and before.posture.key == self.posture.key:
            self.posture = before.posture

    @cached_property
    def tcp_speed(self) -> Array:
        if not self.qd.any():
            return np.zeros(6)
        V = self.machine.kinematics.jacobian(self.q, self.machine.X_0T) @ self.qd
        return np.concatenate([V[3:], V[:3]])

    @cached_property
    def currents(self) -> Array:
        return self.posture.torques / NM_PER_A

    @property
    def temperatures(self) -> Array:
        """``(6,)`` of a robot that was cold when it was switched on, degrees Celsius."""
        return AMBIENT_C + np.array(RISE_C) * (1.0 - np.exp(-max(self.time_s, 0.0) / WARM_UP_S))

    @property
    def joint_modes(self) -> list[int]:
        mode = {3: JOINT_OFF, 5: JOINT_IDLE}.get(self.machine.condition.mode, JOINT_RUNNING)
        return [mode] * 6


Getter = Callable[[Sample], Any]


def _register(kind: str, number: int) -> Getter:
    return lambda s: getattr(s.machine.registers, kind)[number]


def _input(name: str, absent: Any) -> Getter:
    return lambda s: s.machine.registers.inputs.get(name, absent)


def _zeros(count: int) -> Getter:
    return lambda s: (0.0,) * count


OUTPUTS: dict[str, tuple[str, Getter]] = {
    "timestamp": ("DOUBLE", lambda s: s.time_s),
    "target_q": ("VECTOR6D", lambda s: s.q),
    "target_qd": ("VECTOR6D", lambda s: s.qd),
    "target_qdd": ("VECTOR6D", _zeros(6)),
    "target_current": ("VECTOR6D", lambda s: s.currents),
    "target_moment": ("VECTOR6D", lambda s: s.posture.torques),
    "actual_q": ("VECTOR6D", lambda s: s.q),
    "actual_qd": ("VECTOR6D", lambda s: s.qd),
    "actual_current": ("VECTOR6D", lambda s: s.currents),
    "joint_control_output": ("VECTOR6D", lambda s: s.currents),
    "actual_TCP_pose": ("VECTOR6D", lambda s: s.posture.tcp_pose),
    "actual_TCP_speed": ("VECTOR6D", lambda s: s.tcp_speed),
    "actual_TCP_force": ("VECTOR6D", _zeros(6)),  # it touches nothing
    "target_TCP_pose": ("VECTOR6D", lambda s: s.posture.tcp_pose),
    "target_TCP_speed": ("VECTOR6D", lambda s: s.tcp_speed),
    "actual_digital_input_bits": ("UINT64", lambda s: 0),
    "joint_temperatures": ("VECTOR6D", lambda s: s.temperatures),
    "actual_execution_time": ("DOUBLE", lambda s: 0.0),
    "robot_mode": ("INT32", lambda s: int(s.machine.condition.mode)),
    "joint_mode": ("VECTOR6INT32", lambda s: s.joint_modes),
    "safety_mode": ("INT32", lambda s: s.machine.condition.safety.mode),
    "safety_status": ("INT32", lambda s: s.machine.condition.safety.mode),
    "actual_tool_accelerometer": ("VECTOR3D", lambda s: s.posture.acceleration_felt),
    "speed_scaling": ("DOUBLE", lambda s: s.machine.arm.rate),
    "target_speed_fraction": ("DOUBLE", lambda s: s.machine.registers.speed_slider),
    "actual_momentum": ("DOUBLE", lambda s: 0.0),
    "actual_main_voltage": ("DOUBLE", lambda s: 48.0),
    "actual_robot_voltage": ("DOUBLE", lambda s: 48.0),
    "actual_robot_current": ("DOUBLE", lambda s: float(np.abs(s.currents).sum())),
    "actual_joint_voltage": ("VECTOR6D", lambda s: (48.0,) * 6),
    "actual_digital_output_bits": ("UINT64", lambda s: s.machine.registers.digital_outputs),
    "runtime_state": ("UINT32", lambda s: int(s.machine.condition.runtime)),
    "robot_status_bits": ("UINT32", lambda s: s.machine.condition.robot_status_bits),
    "safety_status_bits": ("UINT32", lambda s: s.machine.condition.safety.bits),
    "standard_analog_input0": ("DOUBLE", lambda s: 0.0),
    "standard_analog_input1": ("DOUBLE", lambda s: 0.0),
    "standard_analog_output0": ("DOUBLE", lambda s: s.machine.registers.analogue_outputs[0]),
    "standard_analog_output1": ("DOUBLE", lambda s: s.machine.registers.analogue_outputs[1]),
    "ft_raw_wrench": ("VECTOR6D", _zeros(6)),
    "payload": ("DOUBLE", lambda s: s.machine.payload_kg),
    "payload_cog": ("VECTOR3D", lambda s: s.machine.payload_cog_m),
    "payload_inertia": ("VECTOR6D", lambda s: s.machine.inertia),
    "tcp_offset": ("VECTOR6D", lambda s: s.machine.tcp_offset),
    **{f"output_int_register_{k}": ("INT32", _register("output_ints", k)) for k in range(COUNT)},
    **{f"output_double_register_{k}": ("DOUBLE", _register("output_doubles", k)) for k in range(COUNT)},
    **{f"input_int_register_{k}": ("INT32", _input(f"input_int_register_{k}", 0)) for k in range(COUNT)},
    **{f"input_double_register_{k}": ("DOUBLE", _input(f"input_double_register_{k}", 0.0)) for k in range(COUNT)},
}
