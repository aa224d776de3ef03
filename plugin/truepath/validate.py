"""How good a calibration is on measurements that it has not seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from truepath import frames
from truepath.barycentre import pose_count
from truepath.context import Context
from truepath.errors import CalibrationError, InputError
from truepath.iso9283 import Accuracy, accuracy
from truepath.measurements import Measurements
from truepath.model import CalibratedModel, nominal_flange_poses
from truepath.motions import Moves

SCHEMA = "truepath.validation/1"
FEWEST_POSES = {3: 4, 6: 3}  # by readings a pose: fewer leave several placements that fit as well


@dataclass(frozen=True)
class Validation:
    """Accuracy of the nominal and of the calibrated robot on the same poses."""

    poses: int
    nominal: Accuracy
    calibrated: Accuracy

    def to_dict(self) -> dict:
        """The content of ``validate --json``, as the design document has it."""
        return {
            "schema": SCHEMA,
            "poses": self.poses,
            "nominal": self.nominal.to_dict(),
            "calibrated": self.calibrated.to_dict(),
        }


def validate(model: CalibratedModel, measurements: Measurements) -> Validation:
    """ISO 9283 accuracy before and after calibration; repeated visits of a pose count as one."""
    groups, context = measurements.groups(), Context.of(measurements, same_campaign=False)
    nominal, calibrated = (
        accuracy(X_ME, measurements.p_ME, measurements.R_ME, groups)
        for X_ME in (
            model.predict_nominal(context),
            model.predict(context),
        )
    )
    return Validation(pose_count(groups), nominal, calibrated)


def require_other_poses(few: Measurements, measurements: Measurements) -> None:
    """Refuses to find frames from readings on which they are validated: what was fitted to them proves nothing there.

    Raises:
        InputError: some readings are in both.
    """
    both = [np.unique(np.concatenate([part.q_rad, part.p_ME], axis=1), axis=0) for part in (few, measurements)]
    shared = len(both[0]) + len(both[1]) - len(np.unique(np.concatenate(both), axis=0))
    if shared:
        raise InputError(
            "the frames cannot be found again from poses on which they are validated",
            file=few.source,
            expected="other poses",
            found=f"{shared} of {len(both[0])} readings are in {measurements.source} too",
        )


def refit_frames(model: CalibratedModel, measurements: Measurements) -> CalibratedModel:
    """The model after the tracker was moved: base and probe frame from a few new poses, all else as it was.

    Nominal frames are estimated anew from the same poses, so that the comparison stays fair.

    Raises:
        CalibrationError: too few or too similar poses, or they fit neither robot, wherever it stands.
    """
    p_ME, R_ME = measurements.p_ME, measurements.R_ME
    _require_poses(measurements)
    X_BF_real = model.flange_poses(Context.of(measurements, same_campaign=False))
    X_MB, X_FE = frames.register(X_BF_real, p_ME, R_ME)
    frames.require_variety(X_BF_real, X_FE, measurements.has_orientation)
    X_BF = nominal_flange_poses(model.robot, measurements.q_rad)
    X_MB_nominal, X_FE_nominal = frames.register(X_BF, p_ME, R_ME)
    return replace(
        model,
        X_MB=X_MB,
        X_FE=X_FE,
        X_MB_nominal=X_MB_nominal,
        X_FE_nominal=X_FE_nominal,
        base_is_given=False,
        tool_is_given=False,
        effects=tuple(part for part in model.effects if part.term.moves not in (Moves.BASE, Moves.PROBE)),
    )


def _require_poses(measurements: Measurements) -> None:
    needed = FEWEST_POSES[6 if measurements.has_orientation else 3]
    found = len(np.unique(np.round(measurements.q_rad, 6), axis=0))
    if found < needed:
        raise CalibrationError(
            "too few poses to find the frames again\n"
            f"  expected: at least {needed} different poses\n  found:    {found}"
        )
