"""How lengths are said to people, on the page and in a host alike."""

from __future__ import annotations


def in_mm(value: float) -> str:
    """Micrometres are the last that matter; what is smaller but not zero is said to be so."""
    return "< 0.001" if 0 < value < 0.0005 else f"{value:.3f}"
