"""Corrects a folder or a manifest of programs, on all cores or on a Dask cluster.

    python workflows/batch_correct.py programs/ --calibration calibration.json --output corrected/
    python workflows/batch_correct.py manifest.csv --output corrected/ --scheduler tcp://host:8786

Every corrected program lies in the output folder where the original lies in its own; beside weld.script lies
weld.script.json, which says how it came about. batch.json and batch.html sum up. What is done already, by the hashes of
program, calibration and options, is not done again: the same command goes on after an interruption.

A manifest is a CSV with the columns program, calibration and output, or JSON lines (.jsonl) with these names; further
columns: as, controller_kinematics, path_tolerance_mm, max_correction_mm, cell, start_deg, tcp, payload_kg, with the
meaning of the options of the same name, which count where a cell is empty. Programs and calibrations are named from
the manifest's folder, outputs from the output folder.

More than one worker needs Dask: pip install 'truepath[batch]'. Workers of a cluster get programs and calibrations from
here and need nothing but truepath itself; only a cell or a robot that is a file must lie where they find it too.

Exit codes: 0 all corrected; 1 some are partial (unless --allow-partial), refused or failed; 2 bad input, nothing was
started; 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from truepath.batch.hands import Hands
    from truepath.batch.results import Result
    from truepath.batch.run import Batch
    from truepath.batch.settings import Settings
    from truepath.batch.tasks import Task

JSON, PAGE = "batch.json", "batch.html"
SHOWN = 20


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns the exit code."""
    stated = parser().parse_args(arguments)
    from truepath.console import complain
    from truepath.errors import InputError, TruepathError

    try:
        if stated.dry_run:
            with tempfile.TemporaryDirectory(prefix="truepath-batch-") as folder:
                stated.output = Path(folder)
                return _correct(stated)
        if stated.output is None:
            raise InputError("nowhere to write to", expected="--output FOLDER, or --dry-run")
        return _correct(stated)
    except TruepathError as error:
        complain(f"error: {error}")
        return 2
    except KeyboardInterrupt:
        complain("interrupted before anything was done")
        return 130


def parser() -> argparse.ArgumentParser:
    """The options."""
    lines = (__doc__ or "").split("\n\n")
    made = argparse.ArgumentParser(
        prog="batch_correct.py",
        description=lines[0],
        epilog="\n\n".join(lines[1:]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("programs", type=Path, help="folder of programs (.script, .csv), or a manifest (.csv, .jsonl)")
    made.add_argument("--calibration", "-c", type=Path, help="calibration.json; in a manifest each line may name one")
    made.add_argument("--output", "-o", type=Path, help="folder for the results; needed unless --dry-run")
    made.add_argument("--robot", help="refuse a calibration of any other robot")
    work = made.add_argument_group("work")
    work.add_argument("--workers", type=int, help="processes; default: all cores; 1 needs no Dask")
    work.add_argument("--scheduler", help="tcp://HOST:PORT of a Dask cluster that is there already")
    work.add_argument("--force", action="store_true", help="do again what is done already")
    work.add_argument("--dry-run", action="store_true", help="correct everything, print the summary, keep nothing")
    work.add_argument("--json", action="store_true", help="print batch.json instead of text")
    how = made.add_argument_group("correction, as of truepath correct")
    how.add_argument("--as", choices=("joints", "poses"), help="default: as the line held them")
    how.add_argument("--controller-kinematics", metavar="nominal|FILE")
    how.add_argument("--path-tolerance-mm", type=float)
    how.add_argument("--max-correction-mm", type=float, help="refuse a program of which a target would move further")
    how.add_argument("--cell", help="look for collisions in this cell; none: nowhere")
    how.add_argument("--start-deg", help="joints from which programs start, with commas")
    how.add_argument("--tcp", help="tool before a program sets one: x,y,z in mm, rx,ry,rz rotation vector in rad")
    how.add_argument("--payload-kg", type=float)
    how.add_argument("--allow-partial", action="store_true", help="targets that cannot be resolved are no fault")
    return made


def _correct(stated: argparse.Namespace) -> int:
    from truepath.batch.page import render
    from truepath.batch.run import Batch
    from truepath.batch.summary import exit_code, summarise
    from truepath.console import complain, out, print_json
    from truepath.files import write_atomically

    tasks = _tasks(stated)
    hands = _hands(stated)
    _make_folder(stated.output)
    batch = Batch(tasks)
    if not stated.force:
        batch.look_for_finished()
    stopped = _work(batch, hands)
    summary = summarise(batch, stated.output)
    if not stated.dry_run:
        write_atomically(stated.output / JSON, json.dumps(summary, indent=1, allow_nan=False) + "\n")
        write_atomically(stated.output / PAGE, render(summary))
    if stated.json:
        print_json(summary)
    else:
        _print(summary)
        kept = f"{stated.output / JSON} lists all; open {stated.output / PAGE} in a browser"
        out.print("nothing is kept (--dry-run)" if stated.dry_run else kept)
    if stopped is not None:
        why, code = stopped
        complain(f"{why}: {len(batch.open)} programs are not done; what is done is kept, the same command goes on")
        return code
    return exit_code(summary, stated.allow_partial)


def _tasks(stated: argparse.Namespace) -> list[Task]:
    """Everything that could be wrong is looked at before anything is started."""
    from truepath.batch.manifest import read_manifest
    from truepath.batch.tasks import make_tasks, wishes_in_folder
    from truepath.errors import InputError
    from truepath.plants import load_robot

    programs, output = stated.programs, stated.output
    if not programs.exists():
        raise InputError("no such folder or manifest", file=programs)
    settings = _settings(stated)
    if programs.is_dir():
        if stated.calibration is None:
            raise InputError("no calibration", expected="--calibration FILE")
        if output.resolve().is_relative_to(programs.resolve()):
            raise InputError("the output lies among the programs", file=output, expected="a folder outside of theirs")
        wishes = wishes_in_folder(programs, stated.calibration, settings)
    else:
        wishes = read_manifest(programs, stated.calibration, settings)
    robot = None if stated.robot is None else load_robot(stated.robot)
    reserved = [output / JSON, output / PAGE]
    tasks = make_tasks(wishes, output, robot, reserved)
    for path in reserved:
        if path.is_dir() or path.resolve() in {wish.resolve() for wish in (programs, stated.calibration) if wish}:
            raise InputError("the summary cannot be written", file=path, expected="no folder and no input")
    return tasks


def _make_folder(folder: Path) -> None:
    from truepath.errors import InputError

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("the folder cannot be made", file=folder, found=error.strerror) from None


def _settings(stated: argparse.Namespace) -> Settings:
    from pydantic import ValidationError
    from truepath.batch.settings import Settings
    from truepath.errors import InputError

    names = (field.alias or name for name, field in Settings.model_fields.items())
    words = {name: getattr(stated, name) for name in names}
    try:
        settings = Settings.model_validate({name: value for name, value in words.items() if value is not None})
    except ValidationError as error:
        first = error.errors()[0]
        option = "--" + str(first["loc"][0]).replace("_", "-")
        raise InputError(f"cannot read {option}", expected=first["msg"], found=repr(first["input"])) from None
    return settings.placed(Path.cwd())


def _hands(stated: argparse.Namespace) -> AbstractContextManager[Hands]:
    from truepath.batch.hands import local_hands, remote_hands, require_dask
    from truepath.errors import InputError

    if stated.scheduler is not None:
        if stated.workers is not None:
            raise InputError("--workers and --scheduler exclude each other", expected="one of them")
        require_dask()
        return remote_hands(stated.scheduler)
    workers = _cores() if stated.workers is None else stated.workers
    if workers < 1:
        raise InputError("cannot read --workers", expected="1 or more", found=str(workers))
    if workers > 1:
        require_dask()
    return local_hands(workers)


def _cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _work(batch: Batch, hands: AbstractContextManager[Hands]) -> tuple[str, int] | None:
    """Does what is open; None, or why it stopped and the exit code for that."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
    from truepath.batch.hands import LostClusterError
    from truepath.console import err

    if not batch.open:
        return None
    columns = (
        TextColumn("correcting"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    try:
        with Progress(*columns, console=err) as progress:
            bar = progress.add_task("", total=len(batch.tasks), completed=len(batch.results))
            count: Counter[str] = Counter()

            def say(result: Result) -> None:
                count[result.status] += 1
                told = ", ".join(f"{number} {status}" for status, number in count.items() if status != "corrected")
                progress.update(bar, completed=len(batch.results), description=told)

            with hands as workers:
                batch.run(workers, say)
    except KeyboardInterrupt:
        return "interrupted", 130
    except LostClusterError as error:
        return str(error), 1
    return None


def _print(summary: dict[str, Any]) -> None:
    from truepath.batch.summary import GOOD, STATUSES
    from truepath.console import out, warn

    totals = summary["totals"]
    counts = ", ".join(f"{totals[status]} {status}" for status in STATUSES if totals[status])
    before = f" ({totals['resumed']} of them done before)" if totals["resumed"] else ""
    out.print(f"{totals['programs']} programs{before}: {counts}")
    if totals["displacement_mm"] is not None:
        moved, was, left = (
            totals[name] for name in ("displacement_mm", "predicted_error_before_mm", "predicted_error_after_mm")
        )
        out.print(
            f"{totals['targets']} targets, corrected by {moved['mean']:.3f} mm on average, {moved['max']:.3f} mm at "
            f"most; {totals['added_targets']} added, {totals['unresolved']} left as they are"
        )
        out.print(
            f"predicted error of the tool: mean {was['mean']:.3f} mm, max {was['max']:.3f} mm before; "
            f"{left['max']:.1e} mm after, on top of what the calibration leaves unexplained"
        )
    doubtful = [each for each in summary["programs"] if each["status"] not in (*GOOD, "pending")]
    for each in doubtful[:SHOWN]:
        why = each["message"] or f"targets that cannot be corrected: {each['unresolved']}"
        warn(f"{each['status']}: {each['program']}")
        out.print("  " + why.replace("\n", "\n  "))
    if len(doubtful) > SHOWN:
        out.print(f"... and {len(doubtful) - SHOWN} more")
    if summary["left_over"]:
        warn(f"of other programs, from an earlier batch: {', '.join(summary['left_over'][:SHOWN])}")


if __name__ == "__main__":
    sys.exit(main())
