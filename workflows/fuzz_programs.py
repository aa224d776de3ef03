"""Corrects spoilt programs and toolpaths with the whole command: a clear error or a result, never anything else.

    .venv/bin/python workflows/fuzz_programs.py [--count 5000] [--seed 0] [--keep FOLDER]

Four in five are URScript: programs made at random and those of ``tests/programs/corpus``, cut, repeated, with odd
numbers, odd bytes, other lines, lines of a million characters, brackets and blocks ten thousand deep, or as they were
made. The others are the toolpaths of ``models/ur5``, spoilt likewise. Each goes through ``truepath correct`` with
``--output``, in this process, with a calibration that is made here.

It fails (exit code 1) if one of them takes more than five seconds of computing, ends in anything but exit code 0
(corrected), 1 (some targets cannot be resolved) or 2 (refused, with one message that names the file), or leaves
a file behind where it was refused, no file where it was not, or a file that does not belong there. ``--keep`` writes
the programs that fail to a folder.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).resolve().parents[1]
CORPUS = ROOT / "tests" / "programs" / "corpus"
LONGEST_S, PATIENCE_S = 5.0, 60.0
OUTCOMES = {0: "corrected", 1: "corrected in part", 2: "refused"}
POSES = 60


@dataclass(frozen=True)
class Case:
    """A spoilt program: its name, its ending, its bytes."""

    name: str
    ending: str
    content: bytes


@dataclass(frozen=True)
class Outcome:
    """What became of it; ``fault`` is what must not be."""

    case: Case
    words: str
    seconds: float
    fault: str | None


class Hangs(BaseException):
    """It does not come back."""


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=5000, help="how many")
    parser.add_argument("--seed", type=int, default=0, help="of the first; the same seeds make the same programs")
    parser.add_argument("--keep", type=Path, help="folder for programs that fail")
    options = parser.parse_args(arguments)
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        calibration = Path(folder) / "calibration.json"
        write_calibration(calibration)
        begun = time.monotonic()
        for number, case in enumerate(cases(options.count, options.seed), start=1):
            outcome = tried(case, calibration, Path(folder))
            outcomes.append(outcome)
            if outcome.fault is not None and options.keep is not None:
                options.keep.mkdir(parents=True, exist_ok=True)
                (options.keep / f"{case.name}{case.ending}").write_bytes(case.content)
            if number % 100 == 0 or number == options.count:
                rate = number / (time.monotonic() - begun)
                print(f"{number} of {options.count}, {rate:.0f} a second", file=sys.stderr, flush=True)
    print(table(outcomes))
    return int(any(outcome.fault is not None for outcome in outcomes))


def cases(count: int, seed: int) -> Iterator[Case]:
    """Spoilt programs and toolpaths; the same seed makes the same ones."""
    if str(CORPUS.parent) not in sys.path:
        sys.path.insert(0, str(CORPUS.parent))
    spoil, generate = import_module("spoil"), import_module("generate")
    scripts = sorted(CORPUS.glob("*.script"))
    toolpaths = sorted((ROOT / "models" / "ur5").glob("*.csv"))
    for number in range(seed, seed + count):
        rng = random.Random(number)
        if number % 5 == 4:
            source = rng.choice(toolpaths)
            yield Case(f"{number}_{source.stem}", ".csv", spoil.mutate_table(source.read_bytes(), rng))
            continue
        source = rng.choice(scripts)
        good, name = (source.read_bytes(), source.stem) if number % 2 else (generate.program(number).data, "generated")
        way = rng.choice((None, spoil.mutate, spoil.mutate, spoil.mutate, spoil.mutate_gently, spoil.mutate_gently))
        spoilt = good if way is None else way(good, rng)
        yield Case(f"{number}_{name}", ".script", spoilt)


def write_calibration(path: Path) -> None:
    """That of a simulated UR5 with errors of its geometry."""
    import numpy as np
    from truepath.learn import learn
    from truepath.virtual.real_robot import RealRobot
    from truepath.virtual.simulate import Campaign, free_poses, measure

    real = RealRobot("ur5", 0)
    data = measure(real, free_poses(real, POSES, np.random.default_rng(0)), Campaign())
    learn(real.robot, data, source="ur5")[0].save(path)


def tried(case: Case, calibration: Path, folder: Path) -> Outcome:
    """Corrects one."""
    program = folder / f"program{case.ending}"
    output = folder / f"corrected{case.ending}"
    program.write_bytes(case.content)
    before = set(folder.iterdir())
    arguments = ["correct", program, "--calibration", calibration, "--output", output]
    begun = time.process_time()
    try:
        code, said = run([str(each) for each in arguments])
    except Hangs:
        code, said = -1, "does not come back"
    seconds = time.process_time() - begun
    fault = fault_of(code, said, program, output, seconds, {each.name for each in set(folder.iterdir()) - before})
    for left in (output, note_beside(output)):
        left.unlink(missing_ok=True)
    words = OUTCOMES.get(code, "fails")
    if code == 2:
        words += ": " + said.partition("error: ")[2].partition("\n")[0].partition(": ")[2][:48]
    return Outcome(case, words, seconds, fault)


def run(arguments: list[str]) -> tuple[int, str]:
    """Exit code of the command, and what it says on standard error."""
    from truepath.cli import main as command

    out, err = io.StringIO(), io.StringIO()
    outer = sys.argv
    sys.argv = ["truepath", *arguments]
    signal.signal(signal.SIGALRM, _give_up)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            command()
        return 0, err.getvalue()
    except SystemExit as stop:
        return int(stop.code or 0), err.getvalue()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.argv = outer


def _give_up(number: int, frame: FrameType | None) -> None:
    raise Hangs


def fault_of(code: int, said: str, program: Path, output: Path, seconds: float, new: set[str]) -> str | None:
    """What must not be, if it is."""
    if code not in OUTCOMES:
        return said.strip().splitlines()[-1] if said.strip() else f"exit code {code}"
    if seconds > LONGEST_S:
        return f"takes {seconds:.1f} s"
    if code == 2:
        if new:
            return f"is refused and leaves {', '.join(sorted(new))}"
        if said.count("error: ") != 1 or "Traceback" in said or program.name not in said:
            return "no clear message: " + said.strip()[:200]
        return None
    with_note = {output.name, note_beside(output).name}  # of a toolpath that was changed
    if new != {output.name} and not (output.suffix == ".csv" and new == with_note):
        return f"leaves {', '.join(sorted(new)) or 'nothing'}"
    return None


def note_beside(output: Path) -> Path:
    """Where the note of a corrected toolpath lies."""
    return output.with_name(output.name + ".truepath.json")


def table(outcomes: Sequence[Outcome]) -> str:
    """For people: how often what happened, the slowest, and all faults."""
    lines = [f"{len(outcomes)} programs and toolpaths"]
    for kind in (".script", ".csv"):
        counts = Counter(outcome.words for outcome in outcomes if outcome.case.ending == kind)
        lines += ["", f"{kind}: {sum(counts.values())}"]
        lines += [f"  {count:6d}  {words}" for words, count in counts.most_common(15)]
        lines += [f"  {sum(sorted(counts.values())[:-15]):6d}  others"] if len(counts) > 15 else []
    slowest = sorted(outcomes, key=lambda outcome: -outcome.seconds)[:5]
    lines += ["", "slowest"] + [f"  {each.seconds:6.2f} s  {each.case.name}: {each.words}" for each in slowest]
    faults = [outcome for outcome in outcomes if outcome.fault is not None]
    lines += ["", f"faults: {len(faults)}"] + [f"  {each.case.name}: {each.fault}" for each in faults]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
