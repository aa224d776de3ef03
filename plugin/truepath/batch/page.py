"""``batch.html``: the summary of a batch as one self-contained page. It loads nothing, and runs one script."""

from __future__ import annotations

import base64
import hashlib
import re
from importlib.resources import files
from typing import Any
from urllib.parse import quote

import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.ticker import MaxNLocator

from truepath.expected import NOT_KNOWN
from truepath.look import stylesheet
from truepath.report.canvas import AFTER, BEFORE, PALE, new_axes, write_svg

SIGNS = {"corrected": "✓", "unchanged": "=", "partial": "◐", "refused": "✕", "failed": "!", "pending": "…"}
MEANINGS = {
    "corrected": "targets moved, file written",
    "unchanged": "nothing had to move, file written as it was",
    "partial": "some targets cannot be corrected; they stay as they are",
    "refused": "a guard forbids it or the program is faulty; no file written",
    "failed": "truepath or its workers broke; no file written",
    "pending": "stopped before its turn; the same command goes on",
}
BINS = 40


def render(summary: dict[str, Any]) -> str:
    """The text of the page.

    Args:
        summary: as ``summarise`` makes it.
    """
    script = _own("page.js")
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(mm=_mm, link=_link, breakable=_breakable, duration=_duration)
    programs = summary["programs"]
    return environment.from_string(_own("page.html.jinja")).render(
        policy=policy,
        css=Markup(stylesheet() + _own("page.css")),
        script=Markup(script),
        summary=summary,
        totals=summary["totals"],
        programs=programs,
        signs=SIGNS,
        meanings=MEANINGS,
        calibrations=sorted({each["calibration"] for each in programs}),
        histogram=_histogram(programs),
        expected=_expected(summary["totals"]),
        not_known=NOT_KNOWN,
    )


def _expected(totals: dict[str, Any]) -> dict[str, float] | None:
    """Errors to be expected after the correction; None where nobody knows, or nothing was corrected."""
    known = totals["outside_calibrated_region"] < totals["corrected_targets"]
    return totals["heldout_error_mm"] if known else None


def _histogram(programs: list[dict[str, Any]]) -> Markup | None:
    """How far targets move, mean and largest of each program; None where nothing moves."""
    known = [each["displacement_mm"] for each in programs if each["displacement_mm"] is not None]
    largest = max((each["max"] for each in known), default=0.0)
    if not largest > 0:
        return None
    figure, axes = new_axes(560, 220, x_label="correction, mm", y_label="programs")
    edges = np.linspace(0.0, 1.02 * largest, BINS + 1).tolist()
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    mean, most = (np.array([each[name] for each in known]) for name in ("mean", "max"))
    axes.hist(mean, edges, histtype="stepfilled", facecolor=PALE[AFTER], edgecolor=AFTER, linewidth=1.2, zorder=2)
    axes.hist(most, edges, histtype="step", edgecolor=BEFORE, linewidth=1.8, linestyle=(0, (5, 2)), zorder=3)
    axes.set_xlim(0.0, 1.02 * edges[-1])  # the last edge is a line of some width
    label = (
        f"Histogram of corrections of {len(known)} programs: mean of a program {np.median(mean):.3f} mm, "
        f"largest of a program {np.median(most):.3f} mm (medians), largest of all {largest:.3f} mm"
    )
    return Markup(write_svg(figure, label, "corrections"))


def _mm(value: float | None) -> str:
    """Micrometres are the last that matter; what is smaller but not zero is said to be so."""
    if value is None:
        return ""
    return "< 0.001" if 0 < value < 0.0005 else f"{value:.3f}"


def _link(place: str) -> str:
    return "./" + quote(place)


def _breakable(path: str) -> Markup:
    """A long path may go on in the next line where a person would break it."""
    return Markup(re.sub(r"([/_])", r"\1<wbr>", str(escape(path))))


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.1f} s"


def _own(name: str) -> str:
    return files("truepath.batch").joinpath(name).read_text(encoding="utf-8").replace("\r\n", "\n")
