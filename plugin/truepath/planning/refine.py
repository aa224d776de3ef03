"""From the best candidates to the best poses: each pose is moved a little wherever that makes the design better."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from truepath.lie import Array
from truepath.planning.exchange import Criterion, information
from truepath.planning.visits import Visiting

POSES_AT_ONCE = 32
STEPS_RAD = (0.8, 0.4, 0.2, 0.1)  # one sweep over all poses with each
TRIES, LOOKS = 96, 8  # random moves of a pose, and how many of the best of them are tested for being possible

Progress = Callable[[str], None]


def refine(
    visiting: Visiting,
    criterion: Criterion,
    H: Array,
    q_rad: Array,
    directions: Array,
    rng: np.random.Generator,
    say: Progress = lambda _: None,
) -> Array:
    """``(N, n)`` better poses near ``q_rad`` ``(N, n)`` that can be visited too: a random coordinate exchange.

    Args:
        visiting: what poses tell, and which are possible.
        criterion: what for.
        H: ``(K, K)`` information besides these poses, priors included.
        q_rad: where to start.
        directions: ``(N, n)`` of first arrival.
        rng: of the moves.
        say: told how far it is.
    """
    q_rad = q_rad.copy()
    blocks = visiting.blocks(q_rad, directions)
    total = H + information(blocks)
    for sweep, step in enumerate(STEPS_RAD):
        for k, moved, offered in _offers(visiting, q_rad, directions, step, rng):
            say(f"sweep {sweep + 1} of {len(STEPS_RAD)}, pose {k + 1} of {len(q_rad)}")
            without = total - information(blocks[k])
            gains = criterion.gains(without, np.concatenate([blocks[k : k + 1], offered]))
            least = gains[0] + criterion.gain_of(criterion.value(total))
            order = np.argsort(-gains[1:], kind="stable")[:LOOKS]
            for choice in order[gains[1:][order] > least]:
                if visiting.are_possible(moved[choice : choice + 1], directions[k : k + 1])[0]:
                    q_rad[k], blocks[k] = moved[choice], offered[choice]
                    total = without + information(blocks[k])
                    break
    return q_rad


def _offers(
    visiting: Visiting, q_rad: Array, directions: Array, step: float, rng: np.random.Generator
) -> Iterator[tuple[int, Array, Array]]:
    """For each pose: its number, places ``(T, n)`` in its neighbourhood that are in sight, and their blocks.

    Derivatives are worked out for many poses at once, for one at a time they take ten times as long.
    """
    feasible = visiting.feasible
    for first in range(0, len(q_rad), POSES_AT_ONCE):
        some = range(first, min(first + POSES_AT_ONCE, len(q_rad)))
        moves = np.stack([_moves(step, q_rad.shape[1], rng) for _ in some])
        moved = np.clip(q_rad[some, None] + moves, feasible.lower_rad, feasible.upper_rad)
        moved = moved.reshape(-1, q_rad.shape[1])
        owner = np.repeat(some, TRIES)
        kept = feasible.are_in_place(moved)
        moved, owner = moved[kept], owner[kept]
        blocks = visiting.blocks(moved, directions[owner])
        for k in some:
            yield k, moved[owner == k], blocks[owner == k]


def _moves(step: float, num_joints: int, rng: np.random.Generator) -> Array:
    """``(TRIES, n)``: half of them of all joints together, half of one."""
    moves = rng.normal(scale=step / 2.0, size=(TRIES, num_joints))
    alone = np.zeros((TRIES // 2, num_joints))
    alone[np.arange(TRIES // 2), rng.integers(num_joints, size=TRIES // 2)] = rng.normal(scale=step, size=TRIES // 2)
    moves[: TRIES // 2] = alone
    return moves
