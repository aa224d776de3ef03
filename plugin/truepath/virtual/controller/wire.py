"""The bytes of RTDE version 2: packages and data types.

Source: Universal Robots, "Real-Time Data Exchange (RTDE) guide". All numbers are big-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Any

HEADER = struct.Struct(">HB")  # size of the whole package, kind
NOT_FOUND, IN_USE = "NOT_FOUND", "IN_USE"

# Format of one item, number of items.
TYPES: dict[str, tuple[str, int]] = {
    "BOOL": ("?", 1),
    "UINT8": ("B", 1),
    "UINT32": ("I", 1),
    "UINT64": ("Q", 1),
    "INT32": ("i", 1),
    "DOUBLE": ("d", 1),
    "VECTOR3D": ("d", 3),
    "VECTOR6D": ("d", 6),
    "VECTOR6INT32": ("i", 6),
    "VECTOR6UINT32": ("I", 6),
}


class Kind(IntEnum):
    """Kinds of packages."""

    PROTOCOL_VERSION = ord("V")
    CONTROL_VERSION = ord("v")
    TEXT_MESSAGE = ord("M")
    DATA = ord("U")
    SETUP_OUTPUTS = ord("O")
    SETUP_INPUTS = ord("I")
    START = ord("S")
    PAUSE = ord("P")


class ProtocolError(Exception):
    """What came over the line is not what the protocol allows; the connection is closed."""


class Recipe:
    """Variables in an order, packed into data packages.

    Args:
        number: of the recipe, first byte of its packages.
        names: of the variables.
        types: of the variables, keys of ``TYPES``.
    """

    def __init__(self, number: int, names: Sequence[str], types: Sequence[str]) -> None:
        self.number, self.names, self.types = number, list(names), list(types)
        self._counts = [TYPES[kind][1] for kind in types]
        self._struct = struct.Struct(">B" + "".join(f"{TYPES[kind][1]}{TYPES[kind][0]}" for kind in types))

    def package(self, values: Sequence[Any]) -> bytes:
        """A whole data package; vectors are sequences."""
        flat: list[Any] = []
        for value, count in zip(values, self._counts, strict=True):
            flat.extend(value) if count > 1 else flat.append(value)
        return HEADER.pack(HEADER.size + self._struct.size, Kind.DATA) + self._struct.pack(self.number, *flat)

    def values(self, payload: bytes) -> dict[str, Any]:
        """Of a data package without its header; vectors are tuples.

        Bytes beyond the recipe do not count: ur_rtde sends some when it is asked for forward kinematics.

        Raises:
            ProtocolError: shorter than the recipe says.
        """
        if len(payload) < self._struct.size:
            raise ProtocolError(f"recipe {self.number} takes {self._struct.size} bytes, not {len(payload)}")
        flat = self._struct.unpack_from(payload)[1:]
        found, at = {}, 0
        for name, count in zip(self.names, self._counts, strict=True):
            found[name] = flat[at] if count == 1 else flat[at : at + count]
            at += count
        return found


def package(kind: Kind, payload: bytes) -> bytes:
    """A whole package."""
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def names_in(payload: bytes, most: int) -> list[str]:
    """The comma-separated names of a set-up.

    Raises:
        ProtocolError: no names, or too many.
    """
    try:
        names = payload.decode("ascii").split(",")
    except UnicodeDecodeError as error:
        raise ProtocolError("names of variables are plain ASCII") from error
    names = names[:-1] if names and names[-1] == "" else names
    if not names or len(names) > most:
        raise ProtocolError(f"a recipe of {len(names)} variables (1 to {most} are allowed)")
    return names
