"""What docs/ tells people to paste works, page by page, each in a fresh folder that looks like a checkout.

A page is turned into one Python program: its Python blocks as they stand, one after the other in one namespace, its
shell blocks by bash between them, blocks below a line that names a file saved there. What it prints is held against
the text blocks.
"""

import re
import shutil
from pathlib import Path

import pytest
import yaml
from pasted import ROOT, Block, blocks_of, make_checkout, require_promised, require_written, run_in

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
TO_RUN = {"bash", "python"}
MARK = "=== end of block {} ==="
LINK = re.compile(r"\]\(([^)\s]+)\)")
MAX_PICTURE_BYTES = 300_000

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def as_program(blocks: list[Block]) -> str:
    """The page as a Python program that prints a mark behind each block."""
    parts = ["import pathlib as _pathlib, subprocess as _subprocess\n"]
    for number, block in enumerate(blocks):
        if block.file is not None:
            parts.append(f"_file = _pathlib.Path({block.file!r})\n_file.parent.mkdir(parents=True, exist_ok=True)\n")
            parts.append(f"_file.write_text({block.text!r}, encoding='utf-8')\n")
        elif block.language == "bash":
            parts.append(f"_subprocess.run(['bash', '-euo', 'pipefail', '-c', {block.text!r}], check=True)\n")
        elif block.language == "python":
            parts.append(block.text)
        parts.append(f"print({MARK.format(number)!r}, flush=True)\n")
    return "".join(parts)


def names_of_headings(page: Path) -> set[str]:
    """Anchors as GitHub makes them."""
    titles = re.findall(r"^#+ (.+)$", re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-") for title in titles}


def test_all_pages_are_there_and_the_index_leads_to_them():
    wanted = {"measure", "calibrate", "read-a-report", "correct-a-program", "deploy", "use-inside-drake"}
    wanted |= {"add-an-effect", "add-a-program-format", "explanation"}
    assert {page.stem for page in PAGES} == {"README", *wanted}
    assert {f"{name}.md" for name in wanted} <= set(LINK.findall(text_of(DOCS / "README.md")))


@pages
def test_every_block_is_run_saved_and_used_or_held_against_what_was_printed(page):
    blocks = blocks_of(text_of(page))
    for number, block in enumerate(blocks):
        where = f"{page.name}, line {block.line}"
        later = "".join(other.text for other in blocks[number + 1 :])
        if block.file is not None:
            assert Path(block.file).name in later or Path(block.file).stem in later, f"{where}: nobody uses the file"
            assert ".." not in Path(block.file).parts, where
            assert not Path(block.file).is_absolute(), where
        elif block.language == "text":
            assert block.follows, where
            assert blocks[number - 1].language in TO_RUN, where
            assert blocks[number - 1].file is None, where
            assert re.search(r"\w", block.text), where
        else:
            assert block.language in TO_RUN, f"{where}: {block.language} is neither run nor saved"


@pages
def test_the_page_works(page, tmp_path):
    blocks = blocks_of(text_of(page))
    if not blocks:
        assert page.stem == "README"
        return
    folder, env = make_checkout(tmp_path / "main"), {}
    if any((block.file or "").startswith("plugin/") for block in blocks):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "plugin", folder / "plugin", ignore=ignored)
        env["PYTHONPATH"] = str(folder / "plugin")  # before the installed one
    (folder / "page.py").write_text(as_program(blocks), encoding="utf-8")
    rest = run_in(folder, [".venv/bin/python", "page.py"], **env)
    for number, block in enumerate(blocks):
        printed, _, rest = rest.partition(MARK.format(number) + "\n")
        if block.language == "bash":
            require_written(block.text, folder)
        then = blocks[number + 1] if number + 1 < len(blocks) else None
        if then is not None and then.language == "text" and then.file is None:
            require_promised(then.text, printed, every_line=True)


@pages
def test_its_links_and_the_files_that_it_names_are_there(page):
    prose = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.DOTALL | re.MULTILINE)
    for link in LINK.findall(prose):
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), link
        assert not anchor or anchor in names_of_headings(target), link
    for name in re.findall(r"`((?:plugin|models|workflows|tests|docs)/[\w./-]+)`", prose):
        saved = {block.file for block in blocks_of(text_of(page))}
        assert name in saved or (ROOT / name).exists(), name


@pages
def test_the_options_that_it_names_exist(page):
    from truepath.cli import app
    from typer.main import get_command

    commands = get_command(app).commands
    known = {option for command in commands.values() for parameter in command.params for option in parameter.opts}
    own = "".join(block.text for block in blocks_of(text_of(page)) if block.file is None and block.language == "python")
    prose = text_of(page).replace(own, "")
    for option in set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", prose)):
        assert option in known, option


@pages
def test_its_formulas_are_closed(page):
    prose = re.sub(r"^```.*?^```$|`[^`\n]*`", "", text_of(page), flags=re.DOTALL | re.MULTILINE)
    assert prose.count("$$") % 2 == 0
    assert not re.search(r"^\$$", prose, flags=re.MULTILINE)
    # GitHub takes the backslash away before these, as in any text, and does not allow this macro.
    assert not re.search(r"\\([,;:!{}|]|operatorname)", prose)
    for paragraph in re.sub(r"\$\$.*?\$\$", "", prose, flags=re.DOTALL).split("\n\n"):
        assert paragraph.count("$") % 2 == 0, paragraph


def test_the_pictures_are_small_and_there():
    for name in ("preview.png", "report.png"):
        picture = DOCS / "images" / name
        assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert 10_000 < picture.stat().st_size < MAX_PICTURE_BYTES, name


def test_the_citation_file():
    content = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert content["cff-version"] == "1.2.0"
    assert content["type"] == "software"
    assert content["authors"] == [{"name": "The truepath authors"}]
    for key in ("message", "title", "abstract", "version"):
        assert isinstance(content[key], str), key
        assert content[key], key
    assert "doi" not in content
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE)
    assert content["version"] == version[1]
