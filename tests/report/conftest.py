"""Reports of diagnoses that were made up, and a browser to open them in."""

import os
import shutil

import made_up
import pytest
from truepath.report import write_report

CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@pytest.fixture(scope="session")
def rich():
    return made_up.rich(200)


@pytest.fixture(scope="session")
def written(tmp_path_factory):
    """Function: writes the report of a diagnosis and returns its file."""

    def write(diagnosis):
        file = tmp_path_factory.mktemp("report") / "report.html"
        write_report(file, diagnosis)
        return file

    return write


@pytest.fixture(scope="session")
def rich_file(written, rich):
    return written(rich)


@pytest.fixture(scope="session")
def rich_page(rich_file):
    return rich_file.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def empty_page(written):
    return written(made_up.empty()).read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def unkind_file(written):
    return written(made_up.unkind())


@pytest.fixture(scope="module")
def browser():
    """A headless Chromium. Without one there is nothing to test, except where CI promises one."""
    executable = next(filter(None, map(shutil.which, CHROMIUM_NAMES)), None)
    if executable is None:
        reason = "no Chromium on this machine: looked for " + ", ".join(CHROMIUM_NAMES)
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=executable, args=["--no-sandbox"])
        yield chromium
        chromium.close()
