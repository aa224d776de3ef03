"""A calibration that nobody fitted, for reports."""

import numpy as np
from truepath.calibration import Calibration
from truepath.calibration_parts import (
    AccuracyPart,
    DataPart,
    FramePart,
    HeldOutPart,
    NoisePart,
    Parameter,
    Pose,
    RegionPart,
    RobotPart,
)
from truepath.poe import parameter_names


def calibration_by_hand(robot, measurements, X_MB, outlier):
    """A calibration that nobody fitted."""
    n = robot.num_joints
    rng = np.random.default_rng(3)
    statistics = {"mean": 0.05, "rms": 0.06, "p95": 0.1, "max": 0.2}
    part = AccuracyPart.model_validate({"position_mm": statistics, "distance_mm": None, "orientation_mrad": None})
    held = {"axis1.pos_x", "axis1.pos_y", "axis1.rot_x", "axis1.rot_y", "axis2.pos_y", "axis2.rot_y"}
    return Calibration(
        created_utc="2025-11-22T08:15:00+00:00",
        software={"truepath": "0.1.0", "python": "3.11", "numpy": "2.4.6", "drake": "1.51.1"},
        robot=RobotPart.of(robot, "ur5"),
        base=FramePart(estimated=Pose.of(X_MB), nominal=Pose.of(X_MB), nominal_source="registered"),
        tool=FramePart(estimated=Pose.of(np.eye(4)), nominal=Pose.of(np.eye(4)), nominal_source="registered"),
        parameters=[
            Parameter(
                name=str(name),
                joint=name.joint,
                value=0.0 if str(name) in held or name.joint is None else rng.normal(scale=4e-4),
                sigma=0.0 if str(name) in held else 3.3e-6,
                unit=name.unit,
                status="held" if str(name) in held else "estimated",
                reason="the base frame can take its place" if str(name) in held else None,
            )
            for name in parameter_names(n)
        ],
        effects=[],
        region=RegionPart(
            lower_rad=measurements.q_rad.min(axis=0).tolist(),
            upper_rad=measurements.q_rad.max(axis=0).tolist(),
            mean_rad=[0.0] * n,
            whitening=np.eye(n).tolist(),
            radius=5.0,
        ),
        noise=NoisePart(position_mm=0.025, orientation_mrad=None),
        heldout=HeldOutPart(method="by hand", poses=10, nominal=part, kinematic=None, calibrated=part),
        data=DataPart(
            file=measurements.source,
            sha256=measurements.sha256,
            poses=len(measurements),
            has_orientation=measurements.has_orientation,
            outlier_lines=measurements.line[outlier].tolist(),
        ),
    )
