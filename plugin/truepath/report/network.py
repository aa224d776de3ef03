"""The section about the neural residual: what became of it and why, and whether it says what is found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath.diagnosis import Diagnosis, Gain
from truepath.lie import Array
from truepath.networks_along import NetworksAlong
from truepath.report.canvas import draw_points, drawn_rows, new_axes, symmetric_limit, write_svg
from truepath.report.drawn import AFTER_STAGE, COLOURS, NETWORK_STAGE, Drawn, Plot
from truepath.report.words import (
    counted,
    interval,
    millimetres_decimals,
    probability,
    sentence,
    significant,
    with_powers,
    with_sign,
)

if TYPE_CHECKING:
    from truepath.residual.decision import Decision

SIZE = (360, 300)
MANY = 1000


@dataclass(frozen=True)
class NetworkCard:
    """The section as text and plots.

    Attributes:
        entered: whether the networks are in the model.
        why: why, or why not.
        probability: empty where it did not come to a test.
        before, after, gain, interval: mean error on unseen poses, mm; empty where none was asked.
        is_sure: whether the interval stays clear of zero.
        networks, spread, reach: how many of what size, how far they differ, where they speak; empty if left out.
        plots: what they say over what is there.
    """

    entered: bool
    why: str
    probability: str
    before: str
    after: str
    gain: str
    interval: str
    is_sure: bool
    networks: str
    spread: str
    reach: str
    plots: list[Plot]


def network_card(diagnosis: Diagnosis, drawn: Drawn) -> NetworkCard | None:
    """None where nobody asked for networks."""
    decision = diagnosis.network
    if decision is None:
        return None
    before, after, gain, limits = ("", "", "", "") if decision.gain is None else _gain(decision.gain)
    tested = decision.proof.before_mm > 0
    networks, spread, reach = _ensemble(decision, drawn)
    return NetworkCard(
        entered=decision.model is not None,
        why=sentence(with_powers(decision.why)),
        probability=probability(decision.proof.p_value) if tested else "",
        before=before,
        after=after,
        gain=gain,
        interval=limits,
        is_sure=decision.gain is not None and min(decision.gain.ci95_mm) > 0,
        networks=networks,
        spread=spread,
        reach=reach,
        plots=said_over_found(drawn),
    )


def said_over_found(drawn: Drawn) -> list[Plot]:
    """For each component of the error at unseen poses: what the networks say over what the other models miss."""
    if NETWORK_STAGE not in drawn.error_B or not drawn.unseen.any():
        return []
    missed = -drawn.error_B[AFTER_STAGE][drawn.unseen]
    said = missed + drawn.error_B[NETWORK_STAGE][drawn.unseen]
    return [_plot(missed[:, k], said[:, k], k) for k in range(missed.shape[1])]


def _plot(missed: Array, said: Array, k: int) -> Plot:
    kind, unit = (("Position, along", "mm"), ("Orientation, about", "mrad"))[k // 3]
    title = f"{kind} {'xyz'[k % 3]}"
    x_label, y_label = f"missed without networks, {unit}", f"said by the networks, {unit}"
    figure, axes = new_axes(*SIZE, x_label=x_label, y_label=y_label, title=title)
    limit = symmetric_limit(missed, said)
    axes.set_xlim(-limit, limit)
    axes.set_ylim(-limit, limit)
    axes.axhline(0.0, color="#8a949e", linewidth=0.8, zorder=1.5)
    axes.plot([-limit, limit], [-limit, limit], color="#8a949e", linewidth=1.2, linestyle=(0, (4, 2)), zorder=2.5)
    rows = drawn_rows(len(missed))
    x, y = (np.clip(values[rows], -limit, limit) for values in (missed, said))
    draw_points(axes, x, y, np.ones(len(rows), bool), COLOURS[NETWORK_STAGE], as_picture=len(rows) > MANY)
    share = 1.0 - float(np.sum((missed - said) ** 2)) / max(float(np.sum(missed**2)), 1e-30)
    beyond = int((np.maximum(np.abs(missed), np.abs(said)) > limit).sum())
    caption = f"the networks predict {with_sign(f'{100 * share:.0f}')} % of the mean square miss"
    caption += f"; {counted(beyond, 'point')} beyond the axis" if beyond else ""
    label = f"{title}: {y_label} over {x_label}; on the diagonal they are right. {caption}"
    return Plot(write_svg(figure, label, f"network{k}"), caption)


def _gain(gain: Gain) -> tuple[str, str, str, str]:
    decimals = millimetres_decimals(min(gain.before_mm, gain.after_mm))
    before, after = f"{gain.before_mm:.{decimals}f}", f"{gain.after_mm:.{decimals}f}"
    return before, after, with_sign(f"{gain.before_mm - gain.after_mm:.{decimals}f}"), interval(gain.ci95_mm, decimals)


def _ensemble(decision: Decision, drawn: Drawn) -> tuple[str, str, str]:
    residual = None if decision.model is None else decision.model.residual
    if residual is None:
        return "", "", ""
    sizes = sorted(network.neurons for network in residual.networks)
    size = f"{sizes[0]}" if sizes[0] == sizes[-1] else f"{sizes[0]} to {sizes[-1]}"
    judged, what = drawn.judged
    there = NetworksAlong.of(residual, drawn.q_rad[judged])
    middle, p95 = (significant(float(np.quantile(there.spread_mm, share)), 2) for share in (0.5, 0.95))
    faded, total = int(there.faded.sum()), len(there.weight)
    reach = f"at all {counted(total, what.removesuffix('s'))}" if not faded else f"at {total - faded} of {total} {what}"
    return (
        f"{counted(len(sizes), 'network')} of {size} hidden neurons; their mean counts",
        f"they differ by {middle} mm (standard deviation) or less at half of the {what}, {p95} mm at 95 %",
        f"full weight {reach}; they fade to nothing where no pose was measured near",
    )
