"""Where base and probe were found, against where they were stated, and whether that can be the robot's own doing.

Both are always estimated, so that a wrong statement spoils neither the fit nor what ``validate`` says of it. But
corrected programs believe what was stated, and are moved by its mistake.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truepath import lie
from truepath.calibration import Calibration
from truepath.calibration_parts import FramePart
from truepath.lie import Array

# The probe of a robot whose axes are off is found beside its place even if it sits there: what an axis is off along
# and about itself shows nowhere else. By the yardstick of ``_robots_own`` that was 0.1 to 1.3 with 40 virtual robots.
ALLOWED = 1.5
LEAST_PROBE_MM, LEAST_PROBE_MRAD = 2.0, 2.0
# No error of the arm moves the base, but for how axis 1 stands in it. The foot is set down to within millimetres.
BASE_MM, BASE_MRAD = 4.0, 4.0
SURE = 3.0  # standard deviations: what the data hardly see is no ground for a warning


@dataclass(frozen=True)
class FoundFrame:
    """Base or probe.

    Attributes:
        name: ``base`` or ``probe``.
        found_mm, stated_mm: place of the base in the frame of the measurements, of the probe on the flange;
            the latter None where nobody stated one.
        off_mm: distance between both; None where nothing was stated.
        off_mrad: angle between both; None there too, and for a probe without orientation.
        warning: what it means and what to check, where it is further off than is plausible; else None.
    """

    name: str
    found_mm: tuple[float, float, float]
    stated_mm: tuple[float, float, float] | None
    off_mm: float | None
    off_mrad: float | None
    warning: str | None

    @property
    def line(self) -> str:
        """In words."""
        place = ", ".join(f"{value + 0.0:.2f}" for value in np.round(self.found_mm, 2))
        where = "on the flange" if self.name == "probe" else "in the frame of the measurements"
        text = f"{self.name} found at ({place}) mm {where}"
        if self.off_mm is None:
            return f"{text}; where it is meant to be was not stated"
        turn = "" if self.off_mrad is None else f" and {self.off_mrad:.2f} mrad"
        return f"{text}, {self.off_mm:.2f} mm{turn} from where it was stated"


def found_frames(calibration: Calibration) -> tuple[FoundFrame, FoundFrame]:
    """Base and probe of a calibration."""
    return _base(calibration), _probe(calibration)


def _base(calibration: Calibration) -> FoundFrame:
    frame = calibration.base
    off_mm, off_mrad = _apart(frame)
    blur_mm, blur_mrad = _blur(calibration, "base")
    warning = None
    if _is_stated(frame) and (off_mm > max(BASE_MM, SURE * blur_mm) or off_mrad > max(BASE_MRAD, SURE * blur_mrad)):
        warning = (
            f"the base is {off_mm:.1f} mm and {off_mrad:.1f} mrad from where it was stated; robots are set down to "
            f"within {BASE_MM:g} mm and {BASE_MRAD:g} mrad. Corrected programs make up for a robot that stands wrong "
            "in its cell. If it is the tracker that was not aligned to the cell, or the model that has the base "
            "elsewhere, every target is moved by that mistake, and validate does not see it. Check the alignment and "
            "the base in the model, or do not state it (--measured-in tracker)"
        )
    return _found("base", frame, off_mm, off_mrad, warning)


def _probe(calibration: Calibration) -> FoundFrame:
    frame, has_orientation = calibration.tool, calibration.data.has_orientation
    off_mm, off_mrad = _apart(frame)
    own_mm, own_mrad = _robots_own(calibration)
    blur_mm, blur_mrad = _blur(calibration, "tool")
    limit_mm = max(LEAST_PROBE_MM, ALLOWED * own_mm, SURE * blur_mm)
    limit_mrad = max(LEAST_PROBE_MRAD, ALLOWED * own_mrad, SURE * blur_mrad)
    too_far, too_turned = off_mm > limit_mm, has_orientation and off_mrad > limit_mrad
    warning = None
    if _is_stated(frame) and (too_far or too_turned):
        off = [f"{off_mm:.1f} mm"] * too_far + [f"{off_mrad:.1f} mrad"] * too_turned
        limit = [f"{limit_mm:.1f} mm"] * too_far + [f"{limit_mrad:.1f} mrad"] * too_turned
        warning = (
            f"the probe is {' and '.join(off)} from where it was stated; what else is off with this robot would "
            f"explain up to {' and '.join(limit)}. Corrected programs believe the statement: if it is wrong, every "
            "target is moved by that mistake, and validate does not see it. Check --probe against the probe on the "
            "flange (axes, signs, the reflector's centre) and the flange in the model, or do not state it "
            "(--probe unknown)"
        )
    return _found("probe", frame, off_mm, off_mrad if has_orientation else None, warning)


def _found(name: str, frame: FramePart, off_mm: float, off_mrad: float | None, warning: str | None) -> FoundFrame:
    found = _place_mm(frame.estimated.translation_m)
    if not _is_stated(frame):
        return FoundFrame(name, found, None, None, None, None)
    return FoundFrame(name, found, _place_mm(frame.nominal.translation_m), off_mm, off_mrad, warning)


def _is_stated(frame: FramePart) -> bool:
    return frame.nominal_source == "given"


def _place_mm(p_m: list[float]) -> tuple[float, float, float]:
    x, y, z = p_m
    return 1e3 * x, 1e3 * y, 1e3 * z


def _apart(frame: FramePart) -> tuple[float, float]:
    """Distance, mm, and angle, mrad."""
    X = lie.invert(frame.nominal.matrix()) @ frame.estimated.matrix()
    return 1e3 * float(np.linalg.norm(X[:3, 3])), 1e3 * float(np.linalg.norm(lie.rotation_vector(X[:3, :3])))


def _robots_own(calibration: Calibration) -> tuple[float, float]:
    """How far, mm and mrad, the probe is likely found from its place if all that is off are the axes.

    An axis is as likely off along and about itself as it was found off in other directions; turned about itself, it
    moves the probe by its distance from it. Independent axes add up by squares. With all joints at zero.
    """
    robot = calibration.robot.robot()
    shift_m, turn_rad = _typical_deviation(calibration, "m"), _typical_deviation(calibration, "rad")
    p_BE = (robot.X_BF @ calibration.tool.nominal.matrix())[:3, 3]
    lever_m = np.linalg.norm(np.cross(p_BE - robot.X_BA[:, :3, 3], robot.X_BA[:, :3, 2]), axis=1)
    own_m = float(np.sqrt(robot.num_joints * shift_m**2 + np.sum((lever_m * turn_rad) ** 2)))
    return 1e3 * own_m, 1e3 * float(np.sqrt(robot.num_joints)) * turn_rad


def _typical_deviation(calibration: Calibration, unit: str) -> float:
    """Root mean square of what the axes were found to be off, m or rad."""
    axes = [p for p in calibration.parameters if p.joint is not None and p.unit == unit and p.status == "estimated"]
    return _root_mean_square(np.array([p.value for p in axes]))


def _blur(calibration: Calibration, group: str) -> tuple[float, float]:
    """Standard deviations of a frame, ``base`` or ``tool``, mm and mrad, all directions together."""
    own = [p for p in calibration.parameters if p.name.startswith(f"{group}.")]
    sigma = {unit: np.array([p.sigma for p in own if p.unit == unit]) for unit in ("m", "rad")}
    return 1e3 * float(np.linalg.norm(sigma["m"])), 1e3 * float(np.linalg.norm(sigma["rad"]))


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
