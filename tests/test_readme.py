"""What the README tells people to paste works, in that order, from a folder that looks like a checkout."""

import re
from pathlib import Path

import pytest
from pasted import ROOT, blocks_of, make_checkout, paste, require_promised

README = (ROOT / "README.md").read_text(encoding="utf-8")
DATA = "../shared/data"


def blocks(language: str) -> list[str]:
    return [block.text for block in blocks_of(README) if block.language == language]


def steps(on_real_data: bool) -> list[tuple[str, str]]:
    """Commands to paste and what the README says that they print, if anything."""
    found, every = [], blocks_of(README)
    for block, then in zip(every, [*every[1:], None], strict=True):
        if block.language == "bash" and (DATA in block.text) == on_real_data:
            promised = then.text if then is not None and then.language == "text" and then.follows else ""
            found.append((block.text, promised))
    return found


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    return make_checkout(tmp_path_factory.mktemp("readme") / "main")


def test_every_block_is_one_that_these_tests_know():
    assert {block.language for block in blocks_of(README)} <= {"bash", "text", "python"}
    for block in blocks("bash"):
        for line in block.splitlines():
            assert line.startswith((".venv/bin/truepath ", "awk ", "mkdir -p out")), line
    assert len(steps(on_real_data=False)) >= 5
    assert len(steps(on_real_data=True)) >= 2
    assert sum(bool(promised) for real in (False, True) for _, promised in steps(real)) == len(blocks("text"))


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
