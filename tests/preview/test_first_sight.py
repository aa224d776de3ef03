"""First sight: from the command that ``make demo`` runs to a picture in a browser, with nothing done by hand."""

import os
import pty
import subprocess
import time
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from opened_page import BLUE, OpenPage, pixels_of

ROOT = Path(__file__).parents[2]
LIMIT_S = 60.0
NOT_INTERACTIVE = ("CI", "SSH_CONNECTION", "SSH_TTY")


def on_a_terminal(command, environment):
    """Runs a command whose output goes to a terminal; returns that output."""
    ours, theirs = pty.openpty()
    done = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, close_fds=True)
    os.close(theirs)
    said = b""
    try:
        while part := os.read(ours, 4096):
            said += part
    except OSError:  # the other end is closed
        pass
    os.close(ours)
    assert done.wait() == 0, said.decode()
    return said.decode()


@pytest.fixture(scope="module")
def first_sight(browser, tmp_path_factory):
    """The page that the command opened, what the command said, and seconds from its start to the first picture."""
    folder = tmp_path_factory.mktemp("first sight")
    asked, recorder = folder / "asked for", folder / "browser"
    recorder.write_text(f"#!/bin/sh\nprintf '%s\\n' \"$1\" >> '{asked}'\n")
    recorder.chmod(0o755)
    environment = {name: value for name, value in os.environ.items() if name not in NOT_INTERACTIVE}
    environment |= {"DISPLAY": ":0", "BROWSER": f"'{recorder}' %s", "COLUMNS": "120"}
    start = time.perf_counter()
    said = on_a_terminal([str(ROOT / ".venv/bin/truepath"), "demo", "--folder", str(folder / "demo")], environment)
    asked_after = time.perf_counter() - start
    (address,) = asked.read_text().splitlines()
    page = OpenPage(browser, Path(unquote(urlsplit(address).path)))
    yield page, said, asked_after + page.ready_after_s()
    page.tab.close()


def test_make_demo_is_that_command():
    plan = subprocess.run(
        ["make", "--no-print-directory", "-n", "demo"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert plan.stdout.strip().splitlines()[-1] == ".venv/bin/truepath demo"


def test_the_first_picture_is_there_within_a_minute_and_no_step_by_hand(first_sight):
    page, said, took = first_sight
    print(f"first sight after {took:.1f} s, {page.ready_after_s():.1f} s of them in the browser")
    assert took < LIMIT_S
    assert "the preview is open in a browser" in said
    assert pixels_of(BLUE, page.scene()) > 50  # the corrected path
    assert page.complaints == []


def test_the_one_page_leads_to_the_report(first_sight):
    page, _, _ = first_sight
    page.tab.get_by_role("link", name="the report").click()
    page.tab.wait_for_url("**/report.html")
    assert "joint compliance" in page.tab.inner_text("body").lower()
    assert page.complaints == []
