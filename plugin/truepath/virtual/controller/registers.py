"""What the protocols write into a controller and read from it: registers, outputs, the speed slider."""

from __future__ import annotations

import math
from typing import Any

COUNT = 48
INPUT_TYPES: dict[str, str] = {
    "speed_slider_mask": "UINT32",
    "speed_slider_fraction": "DOUBLE",
    "standard_digital_output_mask": "UINT8",
    "standard_digital_output": "UINT8",
    "configurable_digital_output_mask": "UINT8",
    "configurable_digital_output": "UINT8",
    "tool_digital_output_mask": "UINT8",
    "tool_digital_output": "UINT8",
    "standard_analog_output_mask": "UINT8",
    "standard_analog_output_type": "UINT8",
    "standard_analog_output_0": "DOUBLE",
    "standard_analog_output_1": "DOUBLE",
    "external_force_torque": "VECTOR6D",
    **{f"input_int_register_{k}": "INT32" for k in range(COUNT)},
    **{f"input_double_register_{k}": "DOUBLE" for k in range(COUNT)},
}
DIGITAL = {"standard_digital": 0, "configurable_digital": 8, "tool_digital": 16}  # first bit of each kind


class Registers:
    """All of them.

    Attributes:
        inputs: variables of ``INPUT_TYPES`` as they were written last.
        output_ints, output_doubles: ``COUNT`` each.
        digital_outputs: bits as in ``actual_digital_output_bits``.
        analogue_outputs: two shares of the range.
        speed_slider: 0 to 1.
    """

    def __init__(self) -> None:
        self._owners: dict[str, object] = {}
        self.clear()

    def clear(self) -> None:
        """As after switching on; who uses what stays as it is."""
        self.inputs: dict[str, Any] = {}
        self.output_ints, self.output_doubles = [0] * COUNT, [0.0] * COUNT
        self.digital_outputs, self.analogue_outputs = 0, [0.0, 0.0]
        self.speed_slider = 1.0

    def claim(self, name: str, owner: object) -> bool:
        """Whether a connection may write a variable: nobody else does."""
        return self._owners.setdefault(name, owner) is owner

    def release(self, owner: object) -> None:
        """All that a connection claimed is free again."""
        self._owners = {name: other for name, other in self._owners.items() if other is not owner}

    def write(self, values: dict[str, Any]) -> None:
        """A data package from a client."""
        self.inputs.update(values)
        for kind in DIGITAL:
            if f"{kind}_output_mask" in values:
                mask, level = values[f"{kind}_output_mask"], values.get(f"{kind}_output", 0)
                for bit in range(8):
                    if mask >> bit & 1:
                        self.set_digital(kind, bit, bool(level >> bit & 1))
        for number in (0, 1):
            share = values.get(f"standard_analog_output_{number}")
            if (
                share is not None
                and values.get("standard_analog_output_mask", 0) >> number & 1
                and math.isfinite(share)
            ):
                self.analogue_outputs[number] = min(max(share, 0.0), 1.0)
        slider = values.get("speed_slider_fraction")
        if slider is not None and values.get("speed_slider_mask", 0) & 1 and math.isfinite(slider):
            self.speed_slider = min(max(slider, 0.0), 1.0)

    def set_digital(self, kind: str, number: int, level: bool) -> None:
        """An output of a kind of ``DIGITAL``, numbered from 0; a number that no robot has is left alone."""
        if 0 <= number < (2 if kind == "tool_digital" else 8):
            bit = 1 << (DIGITAL[kind] + number)
            self.digital_outputs = self.digital_outputs | bit if level else self.digital_outputs & ~bit

    def int_in(self, number: int) -> int:
        """``input_int_register``."""
        return int(self.inputs.get(f"input_int_register_{number}", 0))

    def doubles_in(self, first: int, count: int) -> list[float]:
        """``input_double_register`` from one on."""
        return [float(self.inputs.get(f"input_double_register_{first + k}", 0.0)) for k in range(count)]
