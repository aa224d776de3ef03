"""Rows cut into pieces for linear algebra."""

from __future__ import annotations

BLOCK = 512


def blocks(N: int) -> list[slice]:
    """Columns, so many at a time that linear algebra uses one thread for them, and does the same for each."""
    return [slice(first, first + BLOCK) for first in range(0, N, BLOCK)]
