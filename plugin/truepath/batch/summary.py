"""``batch.json``: totals of a batch, and one entry for each of its programs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import truepath
from truepath.batch.results import Result, Spread, Summary, left_over
from truepath.batch.run import Batch
from truepath.batch.tasks import Task

SCHEMA = "truepath.batch/1"
PENDING = "pending"
STATUSES = ("corrected", "unchanged", "partial", "refused", "failed", PENDING)
HELD_OUT = ("mean", "p95", "max")
GOOD = ("corrected", "unchanged")


def summarise(batch: Batch, folder: Path) -> dict[str, Any]:
    """Plain JSON types.

    Args:
        batch: that has run, or was stopped: what is left to do is ``pending``.
        folder: from which the places of results are told.
    """
    programs = [_program(batch, task, batch.results.get(task.number), folder) for task in batch.tasks]
    count = {status: sum(each["status"] == status for each in programs) for status in STATUSES}
    return {
        "schema": SCHEMA,
        "created_utc": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "truepath": truepath.__version__,
        "output": str(folder),
        "complete": not count[PENDING],
        "workers": batch.workers,
        "seconds": batch.seconds,
        "totals": {
            "programs": len(programs),
            **count,
            "resumed": len(batch.resumed),
            "targets": _total(programs, "targets"),
            "corrected_targets": _total(programs, "corrected_targets"),
            "added_targets": _total(programs, "added_targets"),
            "unresolved": _total(programs, "unresolved"),
            "outside_calibrated_region": _total(programs, "outside_calibrated_region"),
            "warnings": sum(len(each["warnings"]) for each in programs),
            "displacement_mm": _mean_and_max(programs, "displacement_mm"),
            "predicted_error_before_mm": _mean_and_max(programs, "predicted_error_before_mm"),
            "predicted_error_after_mm": _mean_and_max(programs, "predicted_error_after_mm"),
            "heldout_error_mm": _worst(programs),
        },
        "left_over": [_from(path, folder) for path in left_over(folder, batch.tasks)],
        "programs": programs,
    }


def exit_code(summary: dict[str, Any], allow_partial: bool) -> int:
    """0 if every program is corrected as it was asked for, else 1."""
    good = (*GOOD, "partial") if allow_partial else GOOD
    return int(any(each["status"] not in good for each in summary["programs"]))


def _program(batch: Batch, task: Task, result: Result | None, folder: Path) -> dict[str, Any]:
    content = (result.summary if result is not None else None) or Summary()
    written = result is not None and result.output_sha256 is not None
    return {
        "program": task.name,
        "calibration": str(task.prepared.calibration_path),
        "output": _from(task.output, folder) if written else None,
        "result": _from(task.result, folder) if result is not None else None,
        "status": PENDING if result is None else result.status,
        "message": "" if result is None else result.message,
        "resumed": task.number in batch.resumed,
        "attempts": batch.attempts.get(task.number, 0),
        "writes": batch.writes.get(task.number, 0),
        "worker": None if result is None else result.worker,
        "seconds": None if result is None else result.seconds,
        "targets": content.targets,
        "corrected_targets": content.corrected,
        "added_targets": content.path.added,
        "unresolved": len(content.unresolved),
        "unresolved_lines": [each.line for each in content.unresolved],
        "outside_calibrated_region": content.outside_calibrated_region,
        "displacement_mm": _pick(content.displacement_mm),
        "predicted_error_before_mm": _pick(content.predicted_error_before_mm),
        "predicted_error_after_mm": _pick(content.predicted_error_after_mm),
        "heldout_error_mm": _heldout_mm(task),
        "warnings": content.warnings,
        "sha256": {} if result is None else {**result.key, "output": result.output_sha256},
    }


def _heldout_mm(task: Task) -> dict[str, float] | None:
    """Of the program's calibration, on poses that its fit had not seen; None if none were held back."""
    errors = task.prepared.heldout_mm
    return None if errors is None else {name: getattr(errors, name) for name in HELD_OUT}


def _worst(programs: Sequence[dict[str, Any]]) -> dict[str, float] | None:
    """Of all calibrations, each number for itself; None if it is not known of one of them."""
    errors = [each["heldout_error_mm"] for each in programs]
    if not errors or None in errors:
        return None
    return {name: max(each[name] for each in errors) for name in HELD_OUT}


def _from(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _pick(spread: Spread | None) -> dict[str, float] | None:
    return None if spread is None else {"mean": spread.mean, "max": spread.max}


def _total(programs: Sequence[dict[str, Any]], name: str) -> int:
    return sum(each[name] for each in programs)


def _mean_and_max(programs: Sequence[dict[str, Any]], name: str) -> dict[str, float] | None:
    """Over all corrected targets of all programs."""
    known = [each for each in programs if each[name] is not None and each["corrected_targets"]]
    targets = _total(known, "corrected_targets")
    if not targets:
        return None
    mean = sum(each[name]["mean"] * each["corrected_targets"] for each in known) / targets
    return {"mean": mean, "max": max(each[name]["max"] for each in known)}
