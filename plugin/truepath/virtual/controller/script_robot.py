"""Functions of URScript that move a robot or ask it something, for a running program."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from truepath.lie import Array
from truepath.programs.motions import Kind
from truepath.virtual.controller.script_expressions import STEPS_OF_A_FUNCTION, STEPS_OF_KINEMATICS, Steps
from truepath.virtual.controller.script_instructions import (
    Instruction,
    Kinematics,
    Message,
    Move,
    Output,
    ScriptError,
    SetOutput,
    SetPayload,
    SetTcp,
    Six,
    SpeedJoints,
    Wait,
)
from truepath.virtual.controller.script_syntax import Syntax
from truepath.virtual.controller.script_values import (
    Joints,
    Pose,
    as_list,
    as_pose,
    checked,
    matrix,
    number,
    said,
    six,
    vector,
)
from truepath.virtual.controller.script_walk import Walk

# Asked with the name of a function and its arguments, or of a variable that the program does not define and none; the
# answer is a truth value, a number, a text, or a list of them. None: there is no such thing.
Ask = Callable[[str, tuple[Any, ...]], Any]

MOVES: dict[str, tuple[tuple[str, ...], tuple[tuple[str, Kind], ...]]] = {  # parameters, and the targets among them
    "movej": (("q", "a", "v", "t", "r"), (("q", Kind.JOINT),)),
    "movel": (("pose", "a", "v", "t", "r"), (("pose", Kind.LINEAR),)),
    "movep": (("pose", "a", "v", "r"), (("pose", Kind.PROCESS),)),
    "movec": (("pose_via", "pose_to", "a", "v", "r", "mode"), (("pose_via", Kind.THROUGH), ("pose_to", Kind.ARC))),
    "servoj": (("q", "a", "v", "t", "lookahead_time", "gain"), (("q", Kind.SERVO),)),
}
INVERSE = ("x", "qnear", "maxPositionError", "maxOrientationError", "tcp")
DEFAULTS = {Kind.JOINT: (1.05, 1.4), Kind.SERVO: (1.05, 1.4)}  # speed and acceleration
DEFAULT_OF_TOOL = (0.25, 1.2)
OUTPUTS = {
    "set_standard_digital_out": Output.DIGITAL,
    "set_digital_out": Output.DIGITAL,
    "set_configurable_digital_out": Output.CONFIGURABLE,
    "set_tool_digital_out": Output.TOOL,
    "set_standard_analog_out": Output.ANALOGUE,
    "set_analog_out": Output.ANALOGUE,
}
WITHOUT_EFFECT = {
    "set_gravity", "set_safety_mode_transition_hardness", "set_tool_voltage", "set_tool_communication",
    "set_analog_outputdomain", "set_standard_analog_input_domain", "set_tool_analog_input_domain", "rtde_set_watchdog",
    "set_runstate_standard_digital_output_to_value", "set_runstate_tool_digital_output_to_value",
    "set_runstate_configurable_digital_output_to_value", "set_standard_digital_input_action",
    "set_configurable_digital_input_action", "set_tool_digital_input_action", "reset_revolution_counter",
    "set_input_actions_to_default", "zero_ftsensor",
}  # fmt: skip
FARTHEST, LONGEST_S = 1000.0, 1e6


class RobotCalls(Walk):
    """One run.

    Attributes:
        q: joints ``(6,)`` at the last target.
        line: of the last call that asked for the world.
    """

    def __init__(
        self,
        syntax: Syntax,
        q_start_rad: Iterable[float],
        kinematics: Kinematics,
        ask: Ask,
        tool: Iterable[float],
        cycle_s: float,
    ) -> None:
        super().__init__(syntax, six([*tool], "the tool"))
        self.q = six([*q_start_rad], "the start")
        self.kinematics, self.ask, self.cycle_s = kinematics, ask, cycle_s
        self.line: int | None = None

    def undefined(self, name: str, node: ast.expr) -> Any:
        answer = self.answer(name, ())
        return self.fault(f"{name} has no value", node) if answer is None else answer

    def forward(self, q_rad: Any) -> Array:
        return self.kinematics.forward(np.array(six(q_rad, "a set of joints")))

    def outside(self, name: str, given: list[Any], named: dict[str, Any], node: ast.Call) -> Steps:
        self.line = node.lineno
        self.spend(STEPS_OF_A_FUNCTION, node)
        if name in MOVES:
            yield self.move(name, given, named, node)
            return None
        if name == "get_inverse_kin":
            arguments = self.arguments(INVERSE, given, named, node)
            tool = arguments.get("tcp", self.tool)
            near = six(arguments.get("qnear", self.q), "qnear")
            return Joints(self.joints_at(six(arguments.get("x"), "a pose"), near, six(tool, "a tool"), node))
        own = self.own_answer(name)
        if own is not None:
            return own
        instruction = self.instruction(name, given, named, node)
        if instruction is not None:
            yield instruction
            return None
        if name in WITHOUT_EFFECT:
            return None
        answer = self.answer(name, (*given, *named.values()))
        return self.fault(f"this controller knows no function {name}()", node) if answer is None else answer

    def answer(self, name: str, arguments: tuple[Any, ...]) -> Any:
        """What the world says."""
        answer = self.ask(name, arguments)
        if isinstance(answer, (list, tuple, np.ndarray)):
            return as_pose(map(float, answer)) if "pose" in name else as_list(checked(each) for each in answer)
        return checked(answer)

    def own_answer(self, name: str) -> Any:
        """What the program knows by itself; None if it does not."""
        match name:
            case "get_target_joint_positions":
                return Joints(self.q)
            case "get_target_tcp_pose" | "get_forward_kin":
                return vector(self.forward(self.q) @ matrix(self.tool))
            case "get_tcp_offset":
                return Pose(self.tool)
        return None

    def instruction(self, name: str, given: list[Any], named: dict[str, Any], node: ast.Call) -> Instruction | None:
        """What a function that is no move tells the robot; None if it tells it nothing."""
        line = node.lineno
        if name in OUTPUTS:
            arguments = self.arguments(("n", "b" if "digital" in name else "f"), given, named, node)
            value = arguments.get("b" if "digital" in name else "f")
            if not isinstance(value, (bool, int, float)):
                self.fault(f"{name}() takes a value", node)
            return SetOutput(line, OUTPUTS[name], int(number(arguments.get("n"), "n", 0)), float(value))
        match name:
            case "set_tcp":
                self.tool = Pose(six(self.arguments(("pose", "tcp_name"), given, named, node).get("pose"), "a tool"))
                return SetTcp(line, six(self.tool))
            case "set_payload" | "set_target_payload":
                arguments = self.arguments(("m", "cog", "inertia"), given, named, node)
                centre = arguments.get("cog")
                return SetPayload(line, number(arguments.get("m"), "the payload", 0.0), _three(centre))
            case "set_payload_mass":
                return SetPayload(line, number(self.arguments(("m",), given, named, node).get("m"), "mass", 0.0), None)
            case "sleep":
                return Wait(line, min(number(self.arguments(("t",), given, named, node).get("t"), "t", 0), LONGEST_S))
            case "sync":
                return Wait(line, self.cycle_s)
            case "textmsg" | "popup":
                words = given[:2] if name == "textmsg" else given[:1]
                words = words or [named.get("s1", named.get("s", ""))]
                return Message(line, "".join(map(said, words)), name == "popup")
            case "stopj" | "stopl":
                return SpeedJoints(line, (0.0,) * 6, number(given[0] if given else 2.0, "the deceleration", 0), None)
            case "speedj":
                arguments = self.arguments(("qd", "a", "t"), given, named, node)
                time_s = arguments.get("t")
                time_s = None if time_s is None else number(time_s, "t", 0)
                return SpeedJoints(line, six(arguments.get("qd")), number(arguments.get("a", 1.4), "a", 0), time_s)
        return None

    def move(self, name: str, given: list[Any], named: dict[str, Any], node: ast.Call) -> Move:
        names, targets = MOVES[name]
        arguments = self.arguments(names, given, named, node)
        parameter, kind = targets[-1]
        via = arguments.get("pose_via")
        if kind is Kind.ARC:
            via = six(via, "the point that an arc passes") if isinstance(via, Pose) else self.tool_at(six(via))
        target = six(arguments.get(parameter))
        if max(map(abs, (*target, *(via or ())))) > FARTHEST:
            self.fault("a target far from any robot", node)
        is_pose = isinstance(arguments[parameter], Pose)
        if is_pose:
            q, pose = self.joints_at(target, self.q, six(self.tool), node), target
        else:
            q, pose = target, self.tool_at(target)
        self.q = q
        speed, acceleration = DEFAULTS.get(kind, DEFAULT_OF_TOOL)
        time_s = number(arguments.get("t", 0.0), "t", 0) or (self.cycle_s if kind is Kind.SERVO else None)
        if kind is not Kind.SERVO:  # which does not use them
            speed, acceleration = (
                number(arguments.get("v", speed), "v", 0),
                number(arguments.get("a", acceleration), "a", 0),
            )
        if time_s is None and not (speed > 0 and acceleration > 0):
            self.fault("speed and acceleration are more than zero", node)
        blend = number(arguments.get("r", 0.0), "r", 0)
        turns_along = kind is Kind.ARC and arguments.get("mode", 0) != 0
        tool = six(self.tool)
        return Move(node.lineno, kind, q, pose, via, turns_along, tool, speed, acceleration, time_s, blend, is_pose)

    def tool_at(self, q_rad: Six) -> Six:
        return six(vector(self.forward(q_rad) @ matrix(self.tool)))

    def joints_at(self, pose: Six, near: Six, tool: Six, node: ast.Call) -> Six:
        self.spend(STEPS_OF_KINEMATICS, node)
        if max(map(abs, (*pose, *near, *tool))) > FARTHEST:
            self.fault("a target far from any robot", node)
        q = self.kinematics.inverse(matrix(pose) @ np.linalg.inv(matrix(tool)), np.array(near))
        if q is None:
            self.fault("the arm cannot reach this pose", node)
        return tuple(map(float, q))

    def arguments(
        self, names: tuple[str, ...], given: list[Any], named: dict[str, Any], node: ast.Call
    ) -> dict[str, Any]:
        if len(given) > len(names) or not named.keys() <= set(names):
            self.fault("more arguments than the function takes", node)
        return {**dict(zip(names, given, strict=False)), **named}


def _three(centre: Any) -> tuple[float, float, float] | None:
    if centre is None:
        return None
    if not isinstance(centre, list) or len(centre) != 3:
        raise ScriptError("a centre of gravity has three numbers")
    x, y, z = (number(each, "the centre of gravity") for each in centre)
    return x, y, z
