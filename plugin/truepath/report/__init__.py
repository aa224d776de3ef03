"""``report.html``: a diagnosis as one self-contained page that a metrology engineer can hand on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from truepath.files import write_atomically

if TYPE_CHECKING:
    from truepath.diagnosis import Diagnosis


def write_report(path: str | Path, diagnosis: Diagnosis) -> None:
    """Writes the page as a whole or not at all.

    It needs no network, loads nothing and can be printed: ``measure_next`` files are the only thing it links to,
    and they are expected beside it.

    Raises:
        InputError: the folder does not exist or cannot be written to.
    """
    from truepath.report.page import render  # matplotlib and jinja2 take a while to import

    write_atomically(path, render(diagnosis))
