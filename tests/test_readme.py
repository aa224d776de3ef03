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
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]\d+)?")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


def steps(on_real_data: bool) -> list[tuple[str, str]]:
    """Commands to paste and what the README says that they print, if anything."""
    found = re.findall(r"^```bash\n(.*?)^```\n(?:\n```text\n(.*?)^```$)?", README, flags=re.MULTILINE | re.DOTALL)
    return [(pasted, promised) for pasted, promised in found if (DATA in pasted) == on_real_data]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """A folder with the models and the environment of the repository, and nothing of what the commands write."""
    folder = tmp_path_factory.mktemp("readme") / "main"
    folder.mkdir()
    (folder / "models").symlink_to(ROOT / "models")
    (folder / ".venv").symlink_to(sys.prefix)
    return folder


def paste(text: str, folder: Path) -> str:
    env = {**os.environ, "COLUMNS": "140"}  # tables as wide as they like
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
    for written in re.findall(r"(?:-o|>) (out/\S+)", text):
        assert (folder / written).stat().st_size > 0, f"{written} is empty"
    return done.stdout


def require_promised(promised: str, printed: str) -> None:
    """Every line with a number in the README was printed, with nearly these numbers."""

    def words(line: str) -> str:
        return " ".join(NUMBER.sub("#", line).split())

    for line in promised.splitlines():
        if not NUMBER.search(line):
            continue
        alike = [other for other in printed.splitlines() if words(other) == words(line)]
        assert alike, f"the README promises\n{line}\nbut this was printed\n{printed}"
        expected = [float(number) for number in NUMBER.findall(line)]
        close = [pytest.approx(expected, rel=0.1, abs=0.003) == list(map(float, NUMBER.findall(k))) for k in alike]
        assert any(close), f"the README promises\n{line}\nbut this was printed\n" + "\n".join(alike)


def test_every_block_is_one_that_these_tests_know():
    for block in blocks("bash"):
        for line in block.splitlines():
            assert line.startswith((".venv/bin/truepath ", "awk ", "mkdir -p out")), line
    assert len(steps(on_real_data=False)) >= 5
    assert len(steps(on_real_data=True)) >= 2
    assert sum(bool(promised) for real in (False, True) for _, promised in steps(real)) == len(blocks("text"))
    assert README.count("```") == 2 * len(re.findall(r"^```\w+$", README, flags=re.MULTILINE))


def test_the_tour_on_the_virtual_cell_and_the_python_example(checkout):
    for pasted, promised in steps(on_real_data=False):
        require_promised(promised, paste(pasted, checkout))
    (example,) = blocks("python")
    assert len([line for line in example.splitlines() if line]) <= 12
    (checkout / "example.py").write_text(example, encoding="utf-8")
    paste(".venv/bin/python example.py", checkout)


def test_the_tour_on_real_robots(checkout, data_dir):
    shared = checkout.parent / "shared"
    shared.mkdir()
    (shared / "data").symlink_to(data_dir.resolve())
    for pasted, promised in steps(on_real_data=True):
        require_promised(promised, paste(pasted, checkout))


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
