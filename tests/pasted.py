"""Pages that tell people what to paste: their blocks, and what was printed held against what the page promises."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
STEP_TIMEOUT_S = 240
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]\d+)?")
FENCED = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAVED_AS = re.compile(r"\bas `([^`\s]+)`:\n\n\Z")


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        language: as the fence has it.
        text: between the fences.
        file: name of the file that it is to be saved as, where the line above ends so: ``as `name`:``.
        follows: whether nothing but an empty line lies between it and the block before.
        line: of the fence, from 1.
    """

    language: str
    text: str
    file: str | None
    follows: bool
    line: int


def blocks_of(page: str) -> list[Block]:
    """All blocks of a page, in order; every fence must open or close one."""
    found, end = [], 0
    for match in FENCED.finditer(page):
        between = page[end : match.start()]
        name = SAVED_AS.search(between)
        end = match.end()
        line = page.count("\n", 0, match.start()) + 1
        follows = bool(found) and not between.strip()
        found.append(Block(match[1], match[2], name and name[1], follows, line))
    fences = len(re.findall(r"^ *```", page, flags=re.MULTILINE))
    assert fences == 2 * len(found), "a fence has no partner or no language"
    return found


def make_checkout(folder: Path) -> Path:
    """A folder with the models and the environment of the repository, and nothing of what the blocks write."""
    folder.mkdir()
    (folder / "models").symlink_to(ROOT / "models")
    (folder / ".venv").symlink_to(sys.prefix)
    return folder


def run_in(folder: Path, command: list[str], **more_env: str) -> str:
    """What a command prints there; it must end well."""
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, "COLUMNS": "140", **more_env},  # tables as wide as they like
        capture_output=True,
        text=True,
        timeout=STEP_TIMEOUT_S,
        check=False,
    )
    shown = command[-1]
    assert done.returncode == 0, f"{shown}\nexit code {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def paste(text: str, folder: Path) -> str:
    """What the shell prints; files that the text names as results are there."""
    printed = run_in(folder, ["bash", "-euo", "pipefail", "-c", text])
    require_written(text, folder)
    return printed


def require_written(text: str, folder: Path) -> None:
    """Files that commands write are there, and not empty."""
    for written in re.findall(r"(?:-o|>) (out/\S+)", text):
        assert (folder / written).stat().st_size > 0, f"{written} is empty"


def require_promised(promised: str, printed: str, *, every_line: bool = False) -> None:
    """Every line with a number in what a page promises was printed, with nearly these numbers.

    Args:
        promised: text of the page.
        printed: by what stands above it there.
        every_line: lines without a number count too, if there are letters in them.
    """

    def words(line: str) -> str:
        return " ".join(NUMBER.sub("#", line).split())

    for line in promised.splitlines():
        if not NUMBER.search(line) and (not every_line or not re.search(r"[^\W_]", line)):
            continue
        alike = [other for other in printed.splitlines() if words(other) == words(line)]
        assert alike, f"the page promises\n{line}\nbut this was printed\n{printed}"
        expected = [float(number) for number in NUMBER.findall(line)]
        close = [pytest.approx(expected, rel=0.1, abs=0.003) == list(map(float, NUMBER.findall(k))) for k in alike]
        assert any(close), f"the page promises\n{line}\nbut this was printed\n" + "\n".join(alike)
