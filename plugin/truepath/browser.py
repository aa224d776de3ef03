"""Opening a page in the browser of whoever sits in front of the screen."""

from __future__ import annotations

import os
import sys
from pathlib import Path

SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
REMOTE = ("CI", "SSH_CONNECTION", "SSH_TTY")


def somebody_looks_on() -> bool:
    """Whether output goes to a terminal, on a machine with a screen that is here, and no robot runs the command."""
    if not sys.stdout.isatty() or any(os.environ.get(name) for name in REMOTE):
        return False
    return sys.platform in ("win32", "darwin") or any(os.environ.get(name) for name in SCREENS)


def open_page(page: Path) -> bool:
    """Opens a page in the browser that the system has for that, or that ``BROWSER`` names.

    Returns:
        Whether one was started.
    """
    import webbrowser

    try:
        return webbrowser.open(page.resolve().as_uri())
    except (webbrowser.Error, OSError):
        return False
