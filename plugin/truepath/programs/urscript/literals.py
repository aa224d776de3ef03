"""Moves that take several literals, as in a function that is called with one target after the other.

Such a move is resolved where the literals are written: each is a target of its own. That is right only where a
literal serves for nothing else: whoever indexes it, computes with it or compares it means the uncorrected one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from truepath.programs.urscript.moves import Move, Moves, Step
from truepath.programs.urscript.written import Key, Written


@dataclass(frozen=True, slots=True, eq=False)
class Resolved:
    """A move with one target each time, or one literal of a move that takes several.

    Attributes:
        at: line and column by which it is ordered.
        move: what it is; of a literal: of all moves that take it.
        steps: under which the program was noted to make it.
        literal: what is to be rewritten; None: the argument of the move.
    """

    at: Key
    move: Move
    steps: tuple[Step, ...]
    literal: Written | None = None


def resolve(moves: Moves) -> tuple[list[Resolved], list[tuple[Key, Move]]]:
    """What can be resolved, and where and why the rest cannot, both in the order of the text."""
    by_call: dict[Key, list[Step]] = {}
    for step in moves.by_step:
        by_call.setdefault((step[0], step[1]), []).append(step)
    literals = _at_literals(moves, by_call) if len(by_call) < len(moves.by_step) else []
    elsewhere = {step for each in literals for step in each.steps}
    found, left = literals, list[tuple[Key, Move]]()
    for call, steps in by_call.items():
        if steps[0] in elsewhere:
            continue
        move = moves.by_step[steps[0]] if len(steps) == 1 else _merged([moves.by_step[step] for step in steps])
        if move.problem is None:
            found.append(Resolved(call, move, tuple(steps)))
            continue
        left.append((call, move))
        for step in steps:
            moves.by_step[step].problem = move.problem
    return sorted(found, key=lambda each: each.at), sorted(left, key=lambda each: each[0])


def _merged(moves: list[Move]) -> Move:
    merged = replace(moves[0])
    for other in moves[1:]:
        merged.merge(other)
    return merged


def _at_literals(moves: Moves, by_call: dict[Key, list[Step]]) -> list[Resolved]:
    takers: dict[Key, list[Step]] = {}
    for step, move in moves.by_step.items():
        if move.literal is not None:
            takers.setdefault(move.literal.key, []).append(step)
    seen: set[Key] = set()
    found: list[Resolved] = []
    for call, steps in by_call.items():
        first = moves.by_step[steps[0]]
        if call in seen or all(moves.by_step[step].targets == first.targets for step in steps):
            continue
        # A literal belongs to all moves that take it, and these to all literals that they take: all of them or none.
        calls, literals = {call}, set[Key]()
        waiting = [call]
        while waiting:
            for step in by_call[waiting.pop()]:
                literal = moves.by_step[step].literal
                if literal is None or literal.key in literals:
                    continue
                literals.add(literal.key)
                further = {(step[0], step[1]) for step in takers[literal.key]} - calls
                calls |= further
                waiting += further
        seen |= calls
        everything = [moves.by_step[step] for each in calls for step in by_call[each]]
        if not literals & moves.used and all(move.literal is not None and not move.problem for move in everything):
            found += _each(moves, literals, takers)
    return found


def _each(moves: Moves, literals: set[Key], takers: dict[Key, list[Step]]) -> list[Resolved]:
    """Every literal as a target of its own; none if one of them is taken by moves of different kinds."""
    found = []
    for key in literals:
        steps = takers[key]
        taken = [moves.by_step[step] for step in steps]
        move = _merged(taken)
        if move.problem is not None or any(each.name != move.name for each in taken):
            return []
        found.append(Resolved(key, move, tuple(steps), move.literal))
    return found
