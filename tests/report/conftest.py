"""Reports of diagnoses that were made up, and a browser to open them in."""

import made_up
import pytest
from chromium import headless
from truepath.report import write_report


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
    with headless() as chromium:
        yield chromium
