"""The look that all pages of truepath share."""

from __future__ import annotations

from importlib.resources import files


def stylesheet() -> str:
    """CSS that goes before a page's own."""
    return files("truepath.look").joinpath("look.css").read_text(encoding="utf-8").replace("\r\n", "\n")
