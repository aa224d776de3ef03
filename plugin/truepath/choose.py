"""Which named effects a data set speaks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from truepath.calibrate import calibrate
from truepath.effects import EFFECTS
from truepath.measurements import Measurements
from truepath.robot import NominalRobot

LEAST_LOG_ODDS = 10.0
ENOUGH_POSES = 1500  # to see what is there; more only takes longer


def choose_effects(
    robot: NominalRobot, measurements: Measurements, progress: Callable[[str], None] = lambda _: None
) -> tuple[str, ...]:
    """Takes effects one after the other, the one with the most evidence first, while they raise it decisively.

    The evidence is the marginal likelihood of the data given here, in which complexity is paid for; an effect
    must raise its logarithm by more than 10 (odds of 22,000 to 1: "decisive" by far, Kass, Raftery 1995).

    Returns:
        Names of the chosen effects.
    """
    if len(measurements) > ENOUGH_POSES:
        drawn = np.random.default_rng(0).permutation(len(measurements))[:ENOUGH_POSES]
        measurements = measurements.subset(np.sort(drawn))
    chosen: tuple[str, ...] = ()
    best = calibrate(robot, measurements)
    while remaining := [name for name in EFFECTS if name not in chosen]:
        trials = []
        for name in remaining:
            progress(f"is there {name.replace('_', ' ')}?")
            trials.append((calibrate(robot, measurements, (*chosen, name)), name))
        fit, name = max(trials, key=lambda trial: trial[0].log_evidence)
        if fit.log_evidence - best.log_evidence < LEAST_LOG_ODDS:
            break
        chosen, best = (*chosen, name), fit
    return chosen
