"""How strongly the error of a joint repeats with its angle: amplitude over cycles per turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truepath.lie import Array
from truepath.report.canvas import INK, TEXT_SIZE, new_axes, write_svg
from truepath.report.drawn import AFTER_STAGE, BEFORE_STAGE, COLOURS, Drawn, Plot
from truepath.report.words import significant

MOST_CYCLES = 100.0
MOST_POINTS = 3000
FEWEST_POINTS = 30
STEPS_PER_PEAK = 4.0
CHANCE = 0.01
CLIP_SIGMAS = 4.0  # one far-off reading would lift the spectrum everywhere
MAD_PER_SIGMA = 0.6745
WHEN = {BEFORE_STAGE: "before", AFTER_STAGE: "after"}


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitudes ``(F,)`` of the best sine at each of ``(F,)`` cycles per turn, and what chance makes of noise.

    ``chance`` is the amplitude that the largest of all F passes in one spectrum of pure noise out of a hundred,
    the noise having the size of the values themselves.
    """

    cycles: Array
    amplitude: Array
    chance: float

    def strongest(self) -> tuple[float, float]:
        """Cycles per turn and amplitude of the highest peak."""
        k = int(np.argmax(self.amplitude))
        return float(self.cycles[k]), float(self.amplitude[k])


def spectrum(angle_rad: Array, values: Array) -> Spectrum | None:
    """Lomb-Scargle spectrum of values ``(N,)`` at uneven angles ``(N,)``; None where they are too few.

    Equal to ``scipy.signal.lombscargle``, scaled to amplitudes, and several times as fast: the waves of
    neighbouring frequencies are computed from each other.
    """
    known = np.isfinite(values)
    angle, y = angle_rad[known], values[known]
    if len(y) > MOST_POINTS:
        rows = np.random.default_rng(0).choice(len(y), MOST_POINTS, replace=False)
        angle, y = angle[rows], y[rows]
    turns = np.ptp(angle) / (2 * np.pi) if len(y) else 0.0
    if len(y) < FEWEST_POINTS or turns < 0.02:
        return None
    y = y - np.median(y)
    bound = CLIP_SIGMAS * float(np.median(np.abs(y))) / MAD_PER_SIGMA
    y = np.clip(y, -bound, bound)
    y = y - y.mean()
    lowest = max(1.0 / turns, 0.5)
    highest = min(MOST_CYCLES, max(0.5 * len(y) / turns, 4 * lowest))
    if highest <= lowest:
        return None
    cycles = np.linspace(lowest, highest, max(int(STEPS_PER_PEAK * (highest - lowest) * turns), 2))
    amplitude = np.sqrt(4.0 * _power(angle, y, cycles) / len(y))
    independent = max((highest - lowest) * turns, 1.0)
    chance = float(np.sqrt(4.0 * y.var() * np.log(independent / CHANCE) / len(y)))
    return Spectrum(cycles, amplitude, chance)


def _power(angle: Array, y: Array, cycles: Array) -> Array:
    """The periodogram of Scargle 1982 ``(F,)`` at evenly spaced frequencies."""
    wave, step = np.exp(1j * cycles[0] * angle), np.exp(1j * (cycles[1] - cycles[0]) * angle)
    power = np.empty(len(cycles))
    for k in range(len(cycles)):
        # tau makes sine and cosine orthogonal over these very angles.
        doubled = np.sum(wave * wave)
        tau = 0.5 * np.angle(doubled)
        half = 0.5 * abs(doubled)
        projected = np.sum(y * wave) * np.exp(-1j * tau)
        cos_square, sin_square = 0.5 * len(y) + half, 0.5 * len(y) - half
        power[k] = 0.5 * (projected.real**2 / cos_square + (projected.imag**2 / sin_square if sin_square > 1e-9 else 0))
        wave *= step
    return power


def spectra(drawn: Drawn, joint_names: Sequence[str]) -> list[Plot]:
    """One plot a joint, before and after."""
    plots = []
    for i, name in enumerate(joint_names if drawn.joint_view_urad else ()):
        found = {}
        for stage in drawn.stages:
            values = spectrum(drawn.q_rad[:, i], drawn.joint_view_urad[stage][:, i])
            if values is not None:
                found[stage] = values
        if found:
            plots.append(_plot(found, i + 1, name))
    return plots


def _plot(found: dict[str, Spectrum], joint: int, name: str) -> Plot:
    title = f"Joint {joint}"
    labels = {"x_label": "cycles per turn of the joint", "y_label": "amplitude, µrad"}
    figure, axes = new_axes(360, 200, title=title, **labels)
    highest = max(float(each.amplitude.max()) for each in found.values())
    said = []
    for stage, each in found.items():
        axes.plot(each.cycles, each.amplitude, color=COLOURS[stage], linewidth=1.1, zorder=3 + (stage == AFTER_STAGE))
        axes.axhline(each.chance, color=COLOURS[stage], linewidth=1.1, linestyle=(0, (4, 2)), zorder=5)
        cycles, amplitude = each.strongest()
        strength = f"{significant(amplitude, 2)} µrad at {significant(cycles, 2 if cycles < 10 else 3)} per turn"
        when = "strongest" if len(found) == 1 else WHEN[stage]
        said.append(f"{when} {strength} (chance up to {significant(each.chance, 2)})")
    first = next(iter(found.values()))
    cycles, amplitude = first.strongest()
    if amplitude > first.chance:
        nearly_right = cycles > 0.8 * first.cycles[-1]
        axes.annotate(
            significant(cycles, 2 if cycles < 10 else 3),
            (cycles, amplitude),
            xytext=(-4 if nearly_right else 4, -2),
            textcoords="offset points",
            ha="right" if nearly_right else "left",
            fontsize=TEXT_SIZE - 0.5,
            color=INK,
        )
    axes.set_ylim(0.0, 1.15 * max(highest, *(each.chance for each in found.values())) or 1.0)
    axes.set_xlim(0.0, float(first.cycles[-1]))
    caption = f"{name}: {', '.join(said)}"
    return Plot(write_svg(figure, f"Spectrum of joint {joint}: {caption}", f"spectrum{joint}"), caption)
