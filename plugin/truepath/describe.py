"""What a fit found, as a calibration file."""

from __future__ import annotations

import platform
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

import truepath
from truepath import calibration_parts as artefact
from truepath.barycentre import pose_count
from truepath.calibrate import BARELY_SEEN, Fit
from truepath.calibration import Calibration
from truepath.calibration_parts import HeldOutPart
from truepath.calibration_residual import ResidualPart
from truepath.iso9283 import Accuracy
from truepath.lie import Array
from truepath.measurements import Measurements
from truepath.region import cover
from truepath.robot import NominalRobot

if TYPE_CHECKING:
    from truepath.residual.proof import Proof


def held_out(
    method: str,
    poses: int,
    nominal: Accuracy,
    kinematic: Accuracy | None,
    calibrated: Accuracy,
    named: Accuracy | None = None,
) -> HeldOutPart:
    """Errors on held-out data, by model, for the file."""

    def part(value: Accuracy) -> artefact.AccuracyPart:
        return artefact.AccuracyPart.model_validate(value.to_dict())

    return artefact.HeldOutPart(
        method=method,
        poses=poses,
        nominal=part(nominal),
        kinematic=None if kinematic is None else part(kinematic),
        named=None if named is None else part(named),
        calibrated=part(calibrated),
    )


def describe(
    robot: NominalRobot,
    measurements: Measurements,
    fit: Fit,
    source: str,
    heldout: HeldOutPart | None,
    proof: Proof | None = None,
) -> Calibration:
    """The calibration file of a fit; with what proved its networks, if it has any."""
    model = fit.model
    return Calibration(
        created_utc=datetime.now(timezone.utc).isoformat(timespec="seconds"),
        software=_versions(),
        robot=artefact.RobotPart.of(robot, source),
        base=_frame(model.X_MB, model.X_MB_nominal, model.base_is_given),
        tool=_frame(model.X_FE, model.X_FE_nominal, model.tool_is_given),
        parameters=[
            artefact.Parameter(
                name=str(name),
                joint=name.joint,
                value=float(model.p[i]),
                sigma=float(fit.sigma[i]),
                unit=name.unit,
                status="held" if i in fit.held else "estimated",
                reason=fit.held.get(i, BARELY_SEEN if i in fit.barely_seen else None),
            )
            for i, name in enumerate(fit.names)
        ],
        effects=[artefact.EffectPart.of(fitted) for fitted in model.effects],
        residual=None if model.residual is None or proof is None else ResidualPart.of(model.residual, proof),
        region=artefact.RegionPart.of(cover(measurements.q_rad[~fit.outlier])),
        noise=artefact.NoisePart(
            position_mm=fit.sigma_position_m * 1e3,
            orientation_mrad=None if fit.sigma_orientation_rad is None else fit.sigma_orientation_rad * 1e3,
        ),
        heldout=heldout,
        data=artefact.DataPart(
            file=measurements.source,
            sha256=measurements.sha256,
            poses=pose_count(measurements.groups()),
            has_orientation=measurements.has_orientation,
            payload_kg=model.payload_kg,
            outlier_lines=measurements.line[fit.outlier].tolist(),
        ),
    )


def _frame(X: Array, X_nominal: Array, given: bool) -> artefact.FramePart:
    return artefact.FramePart(
        estimated=artefact.Pose.of(X),
        nominal=artefact.Pose.of(X_nominal),
        nominal_source="given" if given else "registered",
    )


def _versions() -> dict[str, str]:
    # What pip knows of truepath is that of the day when a checkout was installed.
    versions = {"python": platform.python_version(), "truepath": truepath.__version__}
    for package in ("drake", "casadi", "numpy", "scipy", "torch"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions
