"""What the guards of a correction find: one shape for all of them, and a short form for the terminal."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from datetime import date, datetime, timezone
from typing import Any, Literal

from truepath.calibration import Calibration

MAX_AGE_DAYS = 365
LEVELS = ("error", "warning")
TYPE_OF_UR = re.compile(r"ur\d+e?")


@dataclass(frozen=True)
class Finding:
    """One thing that a guard holds against one place of a program.

    Attributes:
        level: an error keeps the program from being written, a warning does not.
        guard: short name, such as "collision", "joint-speed", "jump", "singularity", "outside", "robot".
        line: of the program, from 1; None for what is about all of it.
        message: a plain sentence with its figures.
        value, limit: what was found and what is allowed, in ``unit``; None where it is not a matter of size.
    """

    level: Literal["error", "warning"]
    guard: str
    line: int | None
    message: str
    value: float | None = None
    limit: float | None = None
    unit: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain JSON types; a figure that is not finite becomes null, which JSON has instead."""
        content = asdict(self)
        for name in ("value", "limit"):
            number = content[name]
            content[name] = float(number) if number is not None and math.isfinite(number) else None
        return content

    @property
    def excess(self) -> float:
        """How far beyond its limit, as a share of it (of one unit where the limit is zero); 0 without figures."""
        if self.value is None or self.limit is None or math.isnan(self.value - self.limit):
            return 0.0
        return abs(self.value - self.limit) / (abs(self.limit) or 1.0)


def condense(findings: Iterable[Finding]) -> list[str]:
    """One line for each guard and level, errors first: how many, the first line, the worst in its own words."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.level, finding.guard), []).append(finding)
    ordered = sorted(groups.items(), key=lambda item: LEVELS.index(item[0][0]))
    return [_one_line(level, guard, members) for (level, guard), members in ordered]


def _one_line(level: str, guard: str, findings: Sequence[Finding]) -> str:
    worst = max(findings, key=lambda finding: finding.excess)
    if len(findings) == 1:
        where = "" if worst.line is None else f" in line {worst.line}"
        return f"{level}: {guard}{where}: {worst.message}"
    lines = [finding.line for finding in findings if finding.line is not None]
    first = f", first in line {min(lines)}" if lines else ""
    where = "" if worst.line is None else f" in line {worst.line}"
    return f"{level}: {guard}: {len(findings)} times{first}, worst{where}: {worst.message}"


def calibration_findings(
    calibration: Calibration, robot_named_in_program: str | None, today: date, max_age_days: int = MAX_AGE_DAYS
) -> list[Finding]:
    """Whether a calibration is too old, or of another robot than the one that the program names.

    Args:
        calibration: as loaded; its date is the UTC day on which the file was created.
        robot_named_in_program: None where the program names none. Case, spaces and punctuation do not count:
            "UR5", "ur-5" and "ur5" are one robot, "UR5e" is another. In a Drake host a robot may have any name, which
            says nothing of its type: that is a warning.
        today: in UTC.
        max_age_days: a calibration older than this is a warning; a robot's gears and its cell change with time.
    """
    findings = _age_findings(calibration, today, max_age_days)
    name = calibration.robot.name.rsplit("::", 1)[-1]  # in a Drake host scopes stand before it
    if robot_named_in_program is not None and _bare(robot_named_in_program) != _bare(name):
        message = f"the program is for {robot_named_in_program!r}, the calibration is one of {name!r}"
        known = TYPE_OF_UR.search(_bare(name)) is not None
        findings.append(Finding("error" if known else "warning", "robot", None, message))
    return findings


def _age_findings(calibration: Calibration, today: date, max_age_days: int) -> list[Finding]:
    def warning(message: str, value: float | None = None, limit: float | None = None) -> list[Finding]:
        return [Finding("warning", "calibration-age", None, message, value, limit, "days")]

    created = _utc_day(calibration.created_utc)
    if created is None:
        return warning(f"the calibration does not say when it was made: {calibration.created_utc[:40]!r}")
    age = (today - created).days
    if age < -1:  # a day may be the clocks
        return warning(f"the calibration says that it was made in {-age} days, on {created}", age, 0)
    if age > max_age_days:
        return warning(f"the calibration is {age} days old, of {created}", age, max_age_days)
    return []


def _utc_day(text: str) -> date | None:
    try:
        moment = datetime.fromisoformat(text)
        return moment.astimezone(timezone.utc).date() if moment.tzinfo else moment.date()
    except (ValueError, OverflowError):  # no date, or one beyond the calendar in UTC
        return None


def _bare(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).casefold()
