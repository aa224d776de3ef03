"""What the plots draw: the arrays of a diagnosis in the units of the paper, without the rows left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.barycentre import barycentres, pose_count
from truepath.diagnosis import Diagnosis
from truepath.lie import Array
from truepath.report.canvas import AFTER, BEFORE, NETWORK, NOMINAL, PALE

BEFORE_STAGE, AFTER_STAGE, NETWORK_STAGE = "kinematic", "final", "network"
COLOURS = {"nominal": NOMINAL, BEFORE_STAGE: BEFORE, AFTER_STAGE: AFTER, NETWORK_STAGE: NETWORK}
PALE_COLOURS = {stage: PALE[colour] for stage, colour in COLOURS.items()}
STAGE_NAMES = {"nominal": "nominal model", BEFORE_STAGE: "kinematic model", AFTER_STAGE: "final model"}
STAGE_NAMES[NETWORK_STAGE] = "with networks"


@dataclass(frozen=True)
class Plot:
    """A plot in the page: the ``svg`` element, empty where there is nothing to see, and plain text below it."""

    svg: str
    caption: str


@dataclass(frozen=True, eq=False)
class Drawn:
    """K rows, outliers left out, in the order of measurement. B is the robot base.

    Attributes:
        q_rad: ``(K, n)`` commanded joints.
        p_BE_mm: ``(K, 3)`` measured positions.
        unseen: ``(K,)`` True where neither fit nor choice has looked.
        row: ``(K,)`` number of the pose, from 1.
        group: ``(K,)`` equal for visits of one pose.
        time_s, temperature_c: ``(K,)`` or None.
        error_B: by stage ``(K, 3)`` or ``(K, 6)`` predicted less measured along the axes of B, mm and mrad; also by
            ``network``, where networks are in the model.
        joint_view_urad: by stage ``(K, n)``; NaN where a joint says nothing.
        stages: those of ``kinematic`` and ``final`` that differ: one where nothing was found.
    """

    q_rad: Array
    p_BE_mm: Array
    unseen: Array
    row: Array
    group: Array
    time_s: Array | None
    temperature_c: Array | None
    error_B: dict[str, Array]
    joint_view_urad: dict[str, Array]
    stages: tuple[str, ...]

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Drawn:
        measurements, kept = diagnosis.measurements, ~np.asarray(diagnosis.outlier, bool)
        X_BM = lie.invert(diagnosis.calibration.base.estimated.matrix())
        p_BE = measurements.p_ME @ X_BM[:3, :3].T + X_BM[:3, 3]
        wanted = (BEFORE_STAGE, AFTER_STAGE) if diagnosis.findings else (BEFORE_STAGE,)
        return cls(
            q_rad=measurements.q_rad[kept],
            p_BE_mm=1e3 * p_BE[kept],
            unseen=np.asarray(diagnosis.unseen, bool)[kept],
            row=np.flatnonzero(kept) + 1,
            group=measurements.groups()[kept],
            time_s=None if measurements.time_s is None else measurements.time_s[kept],
            temperature_c=None if measurements.temperature_c is None else measurements.temperature_c[kept],
            error_B=_errors(diagnosis, X_BM[:3, :3], kept),
            joint_view_urad={stage: 1e6 * np.asarray(view)[kept] for stage, view in diagnosis.joint_view.items()},
            stages=tuple(stage for stage in wanted if stage in diagnosis.residuals),
        )

    @property
    def judged(self) -> tuple[Array, str]:
        """``(K,)`` the rows by which models are judged, and what they are called: all, where none was kept away."""
        several = f"{self.noun}s"
        return (self.unseen, f"unseen {several}") if self.unseen.any() else (np.ones(len(self.row), bool), several)

    @property
    def noun(self) -> str:
        """What a row is: a pose, or one of its readings where poses were visited again."""
        return "pose" if pose_count(self.group) == len(self.group) else "reading"

    def error_length(self, stage: str, first: int = 0) -> Array:
        """``(P,)`` lengths of the errors at unseen poses, visits of one pose averaged; from column ``first`` on."""
        errors = self.error_B[stage][self.unseen, first : first + 3]
        return np.linalg.norm(barycentres(errors, self.group[self.unseen]), axis=1)


def _errors(diagnosis: Diagnosis, R_BM: Array, kept: Array) -> dict[str, Array]:
    errors = {
        stage: 1e3 * _turned(R_BM, np.asarray(error))[kept]
        for stage, error in diagnosis.residuals.items()
        if stage in COLOURS
    }
    model = None if diagnosis.network is None else diagnosis.network.model
    if model is not None and model.residual is not None:
        shift = 1e3 * model.residual.shift(diagnosis.measurements.q_rad[kept])
        errors[NETWORK_STAGE] = errors[AFTER_STAGE] + shift[:, : errors[AFTER_STAGE].shape[1]]
    return errors


def _turned(R: Array, errors: Array) -> Array:
    return np.concatenate([errors[:, k : k + 3] @ R.T for k in range(0, errors.shape[1], 3)], axis=1)
