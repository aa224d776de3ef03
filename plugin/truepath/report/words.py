"""Numbers, units and names as a person reads them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

EFFECT_NAMES = {
    "transmission_error": "Transmission error",
    "joint_compliance": "Joint compliance",
    "backlash": "Backlash",
    "encoder_scale": "Encoder scale",
    "thermal_expansion": "Thermal expansion",
    "warmup_drift": "Warm-up drift",
    "frame_drift": "Drift of tracker or pedestal",
    "tool_shift": "Slipped tool or reflector",
    "measurement_scale": "Scale of the measurement",
    "axis_wobble": "Axis wobble",
    "outlier": "Outlier",
    "unexplained": "Unexplained structure",
    "kinematic": "Geometry of the robot",
    "network": "Neural residual",
}
READABLE_UNITS = {  # SI unit: factor and unit on paper
    "rad": (1e6, "µrad"),
    "m": (1e6, "µm"),
    "rad/rad": (1e6, "ppm"),
    "m/m": (1e6, "ppm"),
    "1": (1e6, "ppm"),
    "1/K": (1e6, "ppm/K"),
    "rad/(N m)": (1e6, "µrad/(N m)"),
    "s": (1.0, "s"),
}
SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
MOST_POWERS = 12  # of ten in odds and probabilities: no model is right in so many digits, and nobody needs more
LARGEST_PLAIN_ODDS = 1e4


def effect_name(effect: str) -> str:
    """``transmission_error`` as ``Transmission error``; a name that is new here is made readable as it stands."""
    return EFFECT_NAMES.get(effect, effect.replace("_", " ").capitalize())


def inside_sentence(name: str) -> str:
    """The name of an effect where no capital belongs."""
    return name[:1].lower() + name[1:]


def joints_phrase(joints: Sequence[int]) -> str:
    """``joint 2``, ``joints 2, 3 and 5``; empty where no joint is concerned."""
    return ("joint " if len(joints) == 1 else "joints ") + listed([str(j) for j in joints]) if joints else ""


def listed(words: Sequence[str], conjunction: str = "and") -> str:
    """``a, b and c``."""
    if len(words) < 2:
        return "".join(words)
    return ", ".join(words[:-1]) + f" {conjunction} {words[-1]}"


def sentence(text: str) -> str:
    """With a capital and a full stop."""
    text = text.strip()
    if not text:
        return text
    return text[0].upper() + text[1:] + ("" if text[-1] in ".!?" else ".")


def counted(number: int, noun: str) -> str:
    """``1 pose``, ``1200 poses``."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def significant(value: float, digits: int = 3) -> str:
    """A number of everyday size without an exponent, to so many significant digits."""
    if not math.isfinite(value):
        return "unknown"
    if value == 0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    if decimals > 9 or abs(value) >= 1e7:
        return power_of_ten(value)
    return with_sign(f"{value:.{decimals}f}")


def with_sign(number: str) -> str:
    """A true minus sign, and none before nothing."""
    if number.startswith("-") and not number.strip("-0."):
        number = number[1:]
    return number.replace("-", "\N{MINUS SIGN}")


def with_powers(text: str) -> str:
    """A text in which ``3e-9`` is written ``3 × 10⁻⁹``, and ``p = 3e-40`` as ``probability`` writes it."""
    least = 10.0**-MOST_POWERS
    text = re.sub(r"\bp = (\d\S*e-\d+)", lambda m: probability(float(m[1])) if float(m[1]) < least else m[0], text)
    return re.sub(r"(?<=\d)e(-\d+)", lambda m: f" \N{MULTIPLICATION SIGN} 10{superscript(int(m[1]))}", text)


def power_of_ten(value: float) -> str:
    """``3 × 10⁻¹²``."""
    exponent = math.floor(math.log10(abs(value)))
    mantissa = round(value / 10.0**exponent)
    if abs(mantissa) == 10:
        mantissa, exponent = mantissa // 10, exponent + 1
    return f"{with_sign(str(mantissa))} \N{MULTIPLICATION SIGN} 10{superscript(exponent)}"


def superscript(number: int) -> str:
    """Of an integer."""
    return str(number).translate(SUPERSCRIPTS)


def probability(p_value: float) -> str:
    """``p = 0.02``, ``p = 3 × 10⁻⁹``, ``p < 10⁻¹²``."""
    if p_value < 10.0**-MOST_POWERS:
        return f"p < 10{superscript(-MOST_POWERS)}"
    return "p = " + (significant(p_value, 2) if p_value >= 1e-3 else power_of_ten(p_value))


def odds(log_odds: float) -> str:
    """A natural logarithm of odds: ``150 to 1``, ``10⁹ to 1``, ``more than 10¹² to 1``; ``1 to 20`` against it."""
    size = abs(log_odds)
    if size > MOST_POWERS * math.log(10.0):
        most = f"10{superscript(MOST_POWERS)}"
        return f"more than {most} to 1" if log_odds > 0 else f"less than 1 to {most}"
    if size < math.log(LARGEST_PLAIN_ODDS):
        number = significant(math.exp(size), 2)
    else:
        number = f"10{superscript(math.floor(size / math.log(10.0)))}"
    return f"{number} to 1" if log_odds >= 0 else f"1 to {number}"


def interval(limits: Sequence[float], decimals: int) -> str:
    """``0.0049 to 0.0113``."""
    low, high = sorted(limits)
    return with_sign(f"{low:.{decimals}f}") + " to " + with_sign(f"{high:.{decimals}f}")


def millimetres_decimals(smallest_mm: float) -> int:
    """Decimals for a column of lengths in mm: whole micrometres, or tenths where one is below 0.1 mm."""
    return 3 if smallest_mm >= 0.1 else 4


def in_readable_unit(value: float, sigma: float | None, unit: str) -> tuple[str, str, str]:
    """Value, standard deviation (empty if there is none) and unit, to two significant digits of the deviation."""
    factor, readable = READABLE_UNITS.get(unit, (1.0, unit))
    value *= factor
    if sigma is None or not sigma > 0 or not math.isfinite(sigma):
        return significant(value), "", readable
    sigma *= factor
    decimals = max(0, 1 - math.floor(math.log10(sigma)))
    if decimals > 9:
        return significant(value), significant(sigma, 2), readable
    return with_sign(f"{value:.{decimals}f}"), f"{sigma:.{decimals}f}", readable
