"""The poses that make the parameters of a model as certain as possible, before their order and their ways."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truepath.calibrate import SPARE_POSES
from truepath.errors import InputError
from truepath.lie import Array
from truepath.planning.exchange import Criterion, exchange, greedy, information
from truepath.planning.feasible import Feasible
from truepath.planning.information import tool_sigma
from truepath.planning.refine import refine
from truepath.planning.visits import Visiting

CRITERIA = ("I", "D")
RANDOM_SETS = 50  # to compare with
RANDOM_POSES, RANDOM_SHARE = 400, 3  # out of so many random poses, or of so many for each of a set
LOOKS_AT_ONCE = 64

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Wish:
    """What a campaign may cost and what it is for.

    Attributes:
        stops: measurements, repeated visits and both sides of a pose included.
        repeats: of these, how many visit a pose once more than it needs.
        criterion: ``I``, mean variance of the tool position over the workspace; ``D``, volume of the parameters.
        local: move the best candidates to where they are better still.
        compared: with random poses.
    """

    stops: int
    repeats: int
    criterion: str = "I"
    local: bool = True
    compared: bool = True


@dataclass(frozen=True, eq=False)
class Design:
    """The chosen poses; N of them, K parameters.

    Attributes:
        q_rad: ``(N, n)``.
        directions: ``(N, n)`` of first arrival, for poses that are visited from both sides.
        again: numbers of poses that are visited once more.
        covariance: ``(K, K)`` expected once all is measured, in units of ``ReadingModel.widths``.
        before: ``(K, K)`` the same without these poses.
        tool_sigma_m: ``(W,)`` expected standard deviation of the tool at poses of the workspace.
        random_sigma_m: ``(R,)`` its mean over the workspace after as many stops at random feasible poses, R such sets;
            none where that was not asked for.
    """

    q_rad: Array
    directions: Array
    again: tuple[int, ...]
    covariance: Array
    before: Array
    tool_sigma_m: Array
    random_sigma_m: Array


def design(
    visiting: Visiting,
    candidates: Array,
    workspace: Array,
    wish: Wish,
    rng: np.random.Generator,
    known: Array | None = None,
    say: Progress = lambda _: None,
) -> Design:
    """Chooses among candidates, then moves the chosen.

    Args:
        visiting: what a visit tells, and what is possible.
        candidates: ``(k, n)`` random poses that pass its test ``roughly`` at least.
        workspace: ``(W, n)`` poses at which the tool shall be well known.
        wish: how many, what for.
        rng: of directions, moves and random sets.
        known: ``(K, K)`` information of what was measured already; None: nothing was.
        say: told what is being done.

    Raises:
        InputError: so few poses cannot carry the parameters, or there are too few candidates.
    """
    K = len(visiting.model.widths)
    count, over = divmod(wish.stops - wish.repeats, visiting.stops)
    repeats = wish.repeats + over
    if known is None:
        require_enough(visiting, count, wish.repeats)
    directions = visiting.directions(len(candidates), rng)
    possible = visiting.can_be_approached(candidates, directions)
    candidates, directions = candidates[possible], directions[possible]
    usable = _CloserLook(visiting.feasible, candidates)
    if len(candidates) < 2 * count:
        raise _too_few(count, len(candidates))
    H = np.eye(K) if known is None else known + np.eye(K)
    tool = visiting.model.tool(workspace, visiting.directions(len(workspace), rng))
    wanted = np.einsum("nij,nik->jk", tool, tool, optimize=True) / len(tool)
    criterion = Criterion(wanted if wish.criterion == "I" else None)
    say(f"choosing {count} of {len(candidates)} candidates for {K} parameters")
    blocks = visiting.blocks(candidates, directions)
    picked = greedy(criterion, H, blocks, count, usable)
    if len(picked) < count:
        raise _too_few(count, len(picked))
    picked = exchange(criterion, H, blocks, picked, usable)
    q_rad, directions = candidates[picked], directions[picked]
    by_chance = np.zeros(0)
    if wish.compared:
        pool = usable.first(max(RANDOM_POSES, RANDOM_SHARE * (count + repeats)))
        by_chance = _random_sigma(blocks[pool], H, tool, count, repeats, visiting, rng)
    if wish.local:
        q_rad = refine(visiting, criterion, H, q_rad, directions, rng, say)
    chosen = visiting.blocks(q_rad, directions)
    total = H + information(chosen)
    once = chosen[:, : chosen.shape[1] // visiting.stops]
    again = greedy(criterion, total, once, repeats)
    covariance = np.linalg.inv(total + information(once[again]))
    sigma = tool_sigma(tool, covariance)
    return Design(q_rad, directions, tuple(again), covariance, np.linalg.inv(H), sigma, by_chance)


class _CloserLook:
    """Which candidates pass ``Feasible.are_open``: found out only for those that matter, and remembered."""

    def __init__(self, feasible: Feasible, candidates: Array) -> None:
        self._feasible, self._candidates = feasible, candidates
        self._looked_at, self._passed = np.zeros((2, len(candidates)), bool)

    def __call__(self, number: int) -> bool:
        if not self._looked_at[number]:
            self._look(np.array([number]))
        return bool(self._passed[number])

    def first(self, count: int) -> Array:
        """Numbers of the first so many that pass, or of all."""
        for start in range(0, len(self._passed), LOOKS_AT_ONCE):
            self._look(np.arange(start, min(start + LOOKS_AT_ONCE, len(self._passed))))
            if self._passed.sum() >= count:
                break
        return np.flatnonzero(self._passed)[:count]

    def _look(self, numbers: Array) -> None:
        new = numbers[~self._looked_at[numbers]]
        if len(new):
            self._passed[new], self._looked_at[new] = self._feasible.are_open(self._candidates[new]), True


def _too_few(count: int, found: int) -> InputError:
    return InputError(
        f"too few of the poses of this cell can be measured to choose {count} from them",
        expected="a wider cone, a longer range, nothing in the beam, more room, or fewer --poses",
        found=f"{found} candidates",
    )


def require_enough(visiting: Visiting, count: int, repeats: int) -> None:
    """Refuses a budget that the parameters cannot be found with.

    Raises:
        InputError: with the smallest budget that would do.
    """
    model = visiting.model
    K, m = len(model.widths), len(model.sigma)
    least = max(-(-K // (m * visiting.stops)), -(-(4 * model.robot.num_joints + m) // m)) + SPARE_POSES
    if count < least:
        sides = ", each from both sides" if visiting.both_sides else ""
        raise InputError(
            f"too few poses for {K} parameters",
            expected=f"--poses {least * visiting.stops + repeats} or more: {least} different poses{sides}, "
            f"and {repeats} repeats",
            found=f"{count} different poses",
        )


def _random_sigma(
    blocks: Array, H: Array, tool: Array, count: int, repeats: int, visiting: Visiting, rng: np.random.Generator
) -> Array:
    """``(R,)`` mean standard deviation of the tool, m, after random sets of as many stops, none of them a repeat."""
    once = blocks.shape[1] // visiting.stops
    found = []
    for _ in range(RANDOM_SETS):
        rows = rng.permutation(len(blocks))[: count + repeats]
        total = H + information(blocks[rows[:count]]) + information(blocks[rows[count:], :once])
        found.append(tool_sigma(tool, np.linalg.inv(total)).mean())
    return np.array(found)
