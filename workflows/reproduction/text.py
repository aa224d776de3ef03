"""The report for people: the same tables in a terminal and in markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

WIDTH = 140


@dataclass(frozen=True)
class TextTable:
    """Words in rows and columns; the first ``left`` columns are words, the others numbers."""

    title: str
    header: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    left: int = 1


def tables(report: dict[str, Any]) -> Iterator[TextTable]:
    """All tables of a report: the paper's four, the joint ranges, what is required."""
    for table in report["tables"]:
        yield _paper_table(table)
    if report["ranges"]:
        yield _range_table(report["ranges"])
    if report["required"]:
        yield _required_table(report["required"])


def markdown(report: dict[str, Any]) -> str:
    """The report as a markdown document."""
    lines = ["# The paper's tables and truepath's", "", explanation(report), ""]
    for table in tables(report):
        rule = ["---" if k < table.left else "---:" for k in range(len(table.header))]
        lines += [f"## {table.title}", ""]
        lines += ["| " + " | ".join(row) + " |" for row in (table.header, rule, *table.rows)]
        lines.append("")
    return "\n".join([*lines, *(f"- {remark}" for remark in remarks(report))]).rstrip() + "\n"


def print_report(report: dict[str, Any], console: Console | None = None) -> None:
    """The report in a terminal."""
    console = console or Console(highlight=False, markup=False, width=WIDTH)
    console.print(explanation(report))
    for table in tables(report):
        shown = Table(title=table.title, title_justify="left", box=box.SIMPLE_HEAD)
        for k, name in enumerate(table.header):
            shown.add_column(name, justify="left" if k < table.left else "right")
        for cells in table.rows:
            shown.add_row(*cells)
        console.print(shown)
    for remark in remarks(report):
        console.print(remark)


def explanation(report: dict[str, Any]) -> str:
    """How the numbers came about."""
    settings = report["settings"]
    parts = ["All errors in mm, on poses that took no part in the fit: median (least - most)."]
    if settings["seeds"]:
        parts.append(
            f"Simulation: {settings['seeds']} robots, joints within ±{settings['half_range_deg']:g}°, joint errors of "
            f"order {settings['order']}, errors against the true positions, noise in the poses to fit only."
        )
    if settings["splits"]:
        parts.append(f"Experiment: {settings['splits']} random splits of a real UR5's 800 poses (Jacobi 2025).")
    return " ".join(parts)


def remarks(report: dict[str, Any]) -> list[str]:
    """What was missed, what was left out, what went wrong."""
    missed = [f"missed: {_what(line)}" for line in report["required"] if not line["met"]]
    skipped = [f"skipped: {text}" for text in report["skipped"]]
    broken = [
        f"failed: {case['protocol']} {case['seed']}: {case['trouble'].strip().splitlines()[-1]}"
        for case in report["failed"]
    ]
    return [*missed, *skipped, *broken]


def _paper_table(table: dict[str, Any]) -> TextTable:
    noises = {row["noise_mm"] for row in table["rows"]} - {None}
    rows = []
    for row in table["rows"]:
        cells = [row["name"]]
        if noises:
            cells.append(_noise(row["noise_mm"]))
        for statistic in ("mean", "max"):
            cells += [_number(row[statistic]["paper"]), _spread(row[statistic]["truepath"])]
        rows.append(tuple(cells))
    header = ("", *(("noise",) if noises else ()), "paper, mean", "truepath, mean", "paper, max", "truepath, max")
    return TextTable(f"Table {table['number']}: {table['title']}, mm", header, rows, left=2 if noises else 1)


def _range_table(ranges: list[dict[str, Any]]) -> TextTable:
    rows = []
    for line in ranges:
        reached = [name for name in ("mean", "max") if line[name]["reached"]]
        told = {0: "no", 2: "yes"}.get(len(reached), f"{reached[0]} only" if reached else "no")
        rows.append(
            (f"±{line['half_range_deg']:g}°", *(_spread(line[name]["truepath"]) for name in ("mean", "max")), told)
        )
    first = ranges[0]
    goal = " and ".join(f"{name} {_number(first[name]['paper'])}" for name in ("mean", "max"))
    title = (
        f"The paper's network alone by joint range, simulation, noise-free, mm (the paper: {goal}, range not stated)"
    )
    return TextTable(title, ("joint range", "mean", "max", "paper reached"), rows)


def _required_table(required: list[dict[str, Any]]) -> TextTable:
    rows = [
        (
            _what(line),
            f"<= {line['most_mm']:.3f}",
            _spread(line["truepath"]),
            "yes" if line["met"] else "missed",
            f"{line['met_in']} of {line['of']}",
        )
        for line in required
    ]
    return TextTable("What is required of the medians, mm", ("", "required", "found", "met", "cases"), rows)


def _what(line: dict[str, Any]) -> str:
    noise = "" if line["noise_mm"] is None else f", {_noise(line['noise_mm'])}"
    quantity = line["quantity"].removesuffix("_mm")
    return f"{line['protocol']}{noise}, {line['name']}: {quantity} {line['statistic']}"


def _noise(noise_mm: float) -> str:
    return f"{noise_mm:g} mm" if noise_mm else "noise-free"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4f}"


def _spread(values: dict[str, float] | None) -> str:
    if values is None:
        return ""
    return f"{values['median']:.4f} ({values['least']:.4f} - {values['most']:.4f})"
