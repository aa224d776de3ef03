"""One simulated robot, or one split of the measured set: every way of predicting, compared with the truth."""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from truepath.calibrate import calibrate
from truepath.iso9283 import Accuracy, accuracy
from truepath.learn import learn
from truepath.measurements import Measurements
from truepath.model import nominal_model
from truepath.plants import load_robot
from truepath.readers import read_measurements
from truepath.residual.direct import learn_direct
from truepath.residual.options import Options
from truepath.robot import NominalRobot

from reproduction.published import POSES_TO_FIT, POSES_TO_VERIFY
from reproduction.simulated import Design, simulate

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


@dataclass(frozen=True)
class Case:
    """What is to be run.

    Attributes:
        protocol: ``simulation``, ``ranges`` (the simulation again, for other joint ranges) or ``experiment``.
        seed: of the simulated robot, or number of the split.
        rows: which ways of predicting.
        design: of the simulation; None for the experiment.
    """

    protocol: str
    seed: int
    rows: tuple[str, ...]
    design: Design | None = None


@dataclass
class Outcome:
    """What became of a case.

    Attributes:
        accuracy: row to its accuracy on the poses to verify.
        position_mm, distance_mm: row to its error pose by pose, ``(100,)``; see ``pose_errors_mm``.
        notes: what a row learnt, in short: causes, hidden neurons.
        seconds: row to the time it took; of two rows from one calibration, all of it stands in one.
        trouble: traceback of a failure.
    """

    case: Case
    accuracy: dict[str, Accuracy] = field(default_factory=dict)
    position_mm: dict[str, np.ndarray] = field(default_factory=dict)
    distance_mm: dict[str, np.ndarray] = field(default_factory=dict)
    notes: dict[str, dict[str, Any]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    trouble: str | None = None


def run_case(case: Case) -> Outcome:
    """Runs a case; a failure is written down, not raised."""
    outcome = Outcome(case)
    try:
        robot, known, fresh = _data(case)
        start = time.perf_counter()
        for learnt in learn_rows(case.rows, robot, known, case.seed):
            row = learnt.row
            outcome.seconds[row] = time.perf_counter() - start
            outcome.notes[row] = learnt.notes
            X_predicted = learnt.predict(fresh.q_rad)
            outcome.accuracy[row] = accuracy(X_predicted, fresh.p_ME, None, fresh.groups())
            outcome.position_mm[row], outcome.distance_mm[row] = pose_errors_mm(X_predicted[:, :3, 3], fresh.p_ME)
            start = time.perf_counter()
    except Exception:
        outcome.trouble = traceback.format_exc()
    return outcome


def pose_errors_mm(p_predicted: np.ndarray, p_true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``(N,)`` positioning error of each pose, and the mean of its distance errors to all others (eq. 23 to 28).

    The mean of either over the poses is the mean of the table.
    """
    position = np.linalg.norm(p_predicted - p_true, axis=1)
    distances = [np.linalg.norm(p[:, None] - p[None, :], axis=2) for p in (p_predicted, p_true)]
    return 1e3 * position, 1e3 * np.abs(distances[0] - distances[1]).sum(axis=1) / (len(position) - 1)


def grid_csv() -> Path:
    """Where the measured UR5 set is looked for."""
    return Path(os.environ.get("TRUEPATH_DATA") or DATA) / "ur5_jacobi2025" / "grid.csv"


def experiment(number: int) -> tuple[NominalRobot, Measurements, Measurements]:
    """A random split of the real UR5 set: nominal robot, 600 poses to fit, 100 others to verify."""
    robot = load_robot("ur5")
    measurements = read_measurements(grid_csv(), robot, "jacobi2025")
    known, fresh = split(len(measurements), number)
    return robot, measurements.subset(known), measurements.subset(fresh)


def split(count: int, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows to fit and rows to verify, each in the order of measurement.

    Raises:
        ValueError: fewer rows than the paper's protocol takes.
    """
    fit = POSES_TO_FIT["experiment"]
    if count < fit + POSES_TO_VERIFY:
        raise ValueError(f"{count} rows, but {fit} are to be fitted and {POSES_TO_VERIFY} to be verified")
    order = np.random.default_rng([number, 0]).permutation(count)
    return np.sort(order[:fit]), np.sort(order[fit : fit + POSES_TO_VERIFY])


def _data(case: Case) -> tuple[NominalRobot, Measurements, Measurements]:
    """Nominal robot, poses to fit, poses to verify."""
    if case.protocol == "experiment":
        return experiment(case.seed)
    drawn = simulate(case.seed, case.design or Design())
    return drawn.robot, drawn.known, drawn.fresh


@dataclass(frozen=True)
class Learnt:
    """A way of predicting.

    Attributes:
        row: its name.
        predict: joints ``(N, n)``, rad, to poses of the probe ``(N, 4, 4)`` in the measurement frame.
        notes: what it learnt, in short.
    """

    row: str
    predict: Callable[[np.ndarray], np.ndarray]
    notes: dict[str, Any] = field(default_factory=dict)


def learn_rows(rows: Container[str], robot: NominalRobot, known: Measurements, seed: int) -> Iterator[Learnt]:
    """Every wanted way of predicting, one after the other, from the poses to fit."""
    if "before" in rows:
        # Both protocols know where base and reflector are meant to be.
        yield Learnt("before", nominal_model(robot, known.X_MB_nominal, known.X_FE_nominal).predict)
    if "direct" in rows:
        yield _direct(known, seed)
    if "kinematic+network" in rows:
        yield from _with_and_without_network(("kinematic", "kinematic+network"), rows, robot, known, seed)
    elif "kinematic" in rows:
        yield Learnt("kinematic", calibrate(robot, known).model.predict)  # what learn() fits, without its checks
    if "named" in rows or "all" in rows:
        yield from _with_and_without_network(("named", "all"), rows, robot, known, seed)


def _direct(known: Measurements, seed: int) -> Learnt:
    network = learn_direct(known.q_rad, known.p_ME, seed=seed)

    def predict(q_rad: np.ndarray) -> np.ndarray:
        X = np.tile(np.eye(4), (len(q_rad), 1, 1))
        X[:, :3, 3] = network.predict(q_rad)
        return X

    return Learnt("direct", predict, {"hidden_neurons": network.hidden})


def _with_and_without_network(
    names: tuple[str, str], rows: Container[str], robot: NominalRobot, known: Measurements, seed: int
) -> Iterator[Learnt]:
    """Two rows from one calibration: the networks learn what the rest leaves, and the rest is as it is without them."""
    without, with_it = names
    options = Options(seed=seed) if with_it in rows else None
    learnt = learn(robot, known, effects="auto" if without == "named" else (), network=options)
    model = learnt.calibration.model
    notes = {"causes": [f"{part.term.effect} {part.term.joint or ''}".strip() for part in model.effects]}
    if with_it in rows:
        yield Learnt(with_it, model.predict, {**notes, "network": learnt.network})
    if without in rows:
        yield Learnt(without, replace(model, residual=None).predict, notes)
