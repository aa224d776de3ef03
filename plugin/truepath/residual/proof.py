"""Whether a network is worth having: it must lower the error on poses that it did not learn from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truepath.kept_away import KeptAway
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.residual.learning import FEWEST_POSES, Progress, learn_for_each
from truepath.residual.limits import SIGNIFICANT
from truepath.residual.options import Options
from truepath.residual.samples import Samples
from truepath.splits import block_parts, random_parts

FitTo = Callable[[Array, bool], CalibratedModel]  # to some rows; whether the frame may drift

WORTH_MENTIONING_MM = 1e-4  # no tracker sees less; data without noise would prove any gain
TOLERATED = 1.02  # times the orientation error without networks: less is chance, and nobody would notice
FOLDS = 5


@dataclass(frozen=True)
class Proof:
    """A network on poses that it did not learn from.

    Attributes:
        p_value: of the error being no lower with it than without.
        before_mm, after_mm: mean error without and with it.
        turns_away: whether orientations become worse with it; then nothing else counts.
    """

    p_value: float
    before_mm: float
    after_mm: float
    turns_away: bool = False

    @property
    def holds(self) -> bool:
        """Significant, and large enough for anybody to notice."""
        return self.p_value < SIGNIFICANT and self.before_mm - self.after_mm > WORTH_MENTIONING_MM


def compare(without: Samples, with_it: Samples) -> Proof:
    """A one-sided paired test of the position errors; where orientations were measured they must not become worse.

    Args:
        without, with_it: what is left of the same poses without and with networks that did not learn from them.
    """
    before, after = (_by_visit(samples.position_mm, samples.visits) for samples in (without, with_it))
    p_value, turns_away = 1.0, not with_it.orientation_mrad.mean() <= TOLERATED * without.orientation_mrad.mean()
    if np.ptp(before - after) > 0 and not turns_away:
        from scipy import stats  # takes a quarter of a second, and few commands come here

        p_value = float(stats.ttest_1samp(before - after, 0.0, alternative="greater").pvalue)
    return Proof(p_value, float(before.mean()), float(after.mean()), turns_away)


def cross_validated(trial: KeptAway, fit: FitTo, options: Options, progress: Progress = lambda _: None) -> Proof:
    """The worse of two cross-validations over the poses that were seen: at random, and in short blocks of neighbours.

    Whatever comes before the network is fitted anew each time, without the poses that are left out: what a fit leaves
    of its own poses is less than it leaves of others, and different.

    Where poses were measured in some order of the joints, a drift looks like something that goes with the pose. At
    random, the frame may therefore drift slowly in the model before the network: what that explains is not its gain.

    Args:
        trial: the poses.
        fit: fits all but the network to some rows.
        options: how to learn.
        progress: told what is being done.
    """
    seen = np.flatnonzero(trial.seen)
    visits = np.unique(trial.measurements.groups()[seen], return_inverse=True)[1]
    if visits.max(initial=-1) + 1 < FEWEST_POSES:
        return Proof(1.0, 0.0, 0.0)
    proofs = []
    for title, folds, drifting in (
        ("cross-validation of the network", random_parts(visits, FOLDS), True),
        ("cross-validation of the network in blocks", block_parts(len(seen), FOLDS), False),
    ):
        learnt_from, asked = [], []
        for number, fold in enumerate(folds):
            progress(f"{title}: fit {number + 1} of {FOLDS}")
            rest = np.delete(seen, fold)
            samples = Samples.of(fit(rest, drifting), trial.measurements, trial.context)
            learnt_from.append(samples.subset(rest))
            asked.append(samples.subset(seen[fold]))
        networks = learn_for_each(learnt_from, options, title, progress)
        without = Samples.joined(asked, folds, visits)
        left = [part.less(network.shift(part.q_rad)) for part, network in zip(asked, networks, strict=True)]
        proofs.append(compare(without, Samples.joined(left, folds, visits)))
    return max(proofs, key=lambda proof: proof.p_value)


def _by_visit(values: Array, visits: Array) -> Array:
    """Visits of one pose are no independent witnesses: their mean counts once."""
    return np.bincount(visits, values) / np.bincount(visits)
