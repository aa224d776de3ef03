"""Whether a network enters the model, and why: proved on poses that took no part in learning it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truepath.errors import CalibrationError
from truepath.residual.learning import learn_ensemble
from truepath.residual.limits import SIGNIFICANT
from truepath.residual.options import Options, require_device
from truepath.residual.proof import FitTo, Proof, cross_validated
from truepath.residual.samples import Samples

if TYPE_CHECKING:
    from truepath.diagnosis import Gain
    from truepath.kept_away import KeptAway
    from truepath.model import CalibratedModel

TOO_FEW = "left out: there are too few poses to prove anything"

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Decision:
    """What became of the networks.

    Attributes:
        proof: by cross-validation.
        gain: mean error without and with networks on poses that neither they nor anything else has seen; None where
            it did not come to that.
        model: fitted to the poses that were seen, with the networks that learnt from them; None where they are left
            out.
        why: in plain words.
    """

    proof: Proof
    gain: Gain | None
    model: CalibratedModel | None
    why: str


def decide(trial: KeptAway, fit: FitTo, options: Options, progress: Progress = lambda _: None) -> Decision:
    """Learns from the poses that were seen what a model leaves of them, and asks those that nobody has seen.

    Args:
        trial: the poses.
        fit: fits the model, all but the networks, to some rows; with a slow drift of the frame besides, if told so.
        options: how to learn.
        progress: told what is being done.

    Raises:
        InputError: the device is not there.
    """
    require_device(options.device)
    try:
        proof = cross_validated(trial, fit, options, progress)
    except CalibrationError:
        return impossible()
    if not proof.holds:
        return Decision(proof, None, None, left_out(proof))
    named = fit(np.flatnonzero(trial.seen), False)
    samples = Samples.of(named, trial.measurements, trial.context).subset(trial.seen)
    model = named.with_residual(learn_ensemble(samples, options, "learning the network", progress))
    gain = trial.gain(named, model)
    if not gain.after_mm < gain.before_mm:  # in this way round for what is no number
        why = (
            f"left out: on the poses kept away the mean error is {gain.after_mm:.4f} mm with it and "
            f"{gain.before_mm:.4f} mm without"
        )
        return Decision(proof, gain, None, why)
    return Decision(proof, gain, model, entered(proof))


def impossible() -> Decision:
    """Where no pose can be spared to prove anything."""
    return Decision(Proof(1.0, 0.0, 0.0), None, None, TOO_FEW)


def left_out(proof: Proof) -> str:
    """Why a network does not enter."""
    if proof.before_mm == proof.after_mm == 0.0:
        return TOO_FEW
    if proof.turns_away:
        return "left out: on poses that it did not learn from, orientations become worse with it"
    if proof.p_value < SIGNIFICANT:
        gain_um = 1e3 * (proof.before_mm - proof.after_mm)
        return f"left out: it would lower the mean error by {gain_um:.2g} um only, which nobody would notice"
    return (
        f"left out: on poses that it did not learn from, the mean error is {proof.after_mm:.4f} mm with it and "
        f"{proof.before_mm:.4f} mm without; p = {proof.p_value:.2g} does not prove a gain (less than {SIGNIFICANT:g} "
        "would)"
    )


def entered(proof: Proof) -> str:
    """Why a network enters."""
    return (
        f"in the model: on poses that it did not learn from, the mean error falls from {proof.before_mm:.4f} to "
        f"{proof.after_mm:.4f} mm (p = {proof.p_value:.2g})"
    )
