"""What the README tells people to paste works, in that order, from a folder that looks like a checkout."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DATA = "../shared/data"
STEP_TIMEOUT_S = 240


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


def commands(on_real_data: bool) -> list[str]:
    return [block for block in blocks("bash") if (DATA in block) == on_real_data]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """A folder with the models and the environment of the repository, and nothing of what the commands write."""
    folder = tmp_path_factory.mktemp("readme") / "main"
    folder.mkdir()
    (folder / "models").symlink_to(ROOT / "models")
    (folder / ".venv").symlink_to(sys.prefix)
    return folder


def paste(text: str, folder: Path) -> None:
    env = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", text],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        timeout=STEP_TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, f"{text}\nexit code {done.returncode}\n{done.stdout}\n{done.stderr}"
    for written in re.findall(r"(?:-o|>) (\S+)", text):
        assert (folder / written).stat().st_size > 0, f"{written} is empty"


def test_every_block_is_one_that_these_tests_know():
    for block in blocks("bash"):
        for line in block.splitlines():
            assert line.startswith((".venv/bin/truepath ", "awk ", "mkdir -p out")), line
    assert len(commands(on_real_data=False)) >= 5
    assert len(commands(on_real_data=True)) >= 2
    assert README.count("```") == 2 * len(re.findall(r"^```\w+$", README, flags=re.MULTILINE))


def test_the_tour_on_the_virtual_cell_and_the_python_example(checkout):
    for block in commands(on_real_data=False):
        paste(block, checkout)
    (example,) = blocks("python")
    assert len([line for line in example.splitlines() if line]) <= 12
    (checkout / "example.py").write_text(example, encoding="utf-8")
    paste(".venv/bin/python example.py", checkout)


def test_the_tour_on_real_robots(checkout, data_dir):
    shared = checkout.parent / "shared"
    shared.mkdir()
    (shared / "data").symlink_to(data_dir.resolve())
    for block in commands(on_real_data=True):
        paste(block, checkout)


def test_every_target_and_path_that_it_names_exists():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"\bmake ([a-z]+)\b(?= )", README))
    assert {"demo", "test", "lint", "slow", "bench"} <= named
    for target in named:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), f"make {target}"
    for path in (
        "plugin/truepath",
        "models",
        "workflows",
        "tests",
        "CHANGELOG.md",
        *re.findall(r"models/\S+\.csv", README),
    ):
        assert (ROOT / path).exists(), path
