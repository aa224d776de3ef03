"""Numbers that a line states plainly: which of its slots, and with which sign."""

from __future__ import annotations

from functools import lru_cache

from truepath.programs.urscript.syntax import Node

SlotOf = tuple[int, float]  # slot, sign
TARGET = 6


def signed_slot(node: Node) -> SlotOf | None:
    """The slot of a number; None for anything else."""
    if node.op == "number":
        return (node.slot, 1.0) if node.slot >= 0 else None
    if node.op == "negative" and node.args[0].op == "number":
        inner = signed_slot(node.args[0])
        return None if inner is None else (inner[0], -1.0)
    return None


@lru_cache(maxsize=50_000)
def slots_of_target(node: Node) -> tuple[SlotOf, ...] | None:
    """The slots of ``p[...]`` or ``[...]`` with six plain numbers; None for anything else."""
    elements = node.args[1] if node.op == "pose" else node.args[0] if node.op == "list_" else ()
    if len(elements or ()) != TARGET:
        return None
    found = tuple(slot for slot in map(signed_slot, elements) if slot is not None)
    return found if len(found) == TARGET else None
