"""What truepath raises: every failure that a user can cause says where, what was expected and what was found."""

from __future__ import annotations

from pathlib import Path


class TruepathError(Exception):
    """Base of all errors that truepath raises on purpose. The command line turns it into exit code 2."""


class InputError(TruepathError):
    """Something that came from outside is wrong.

    Attributes:
        file, line, column: where (line counted from 1 as an editor does, the header being line 1;
            column by its name); None where it does not apply.
        expected, found: the two halves of the story.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        line: int | None = None,
        column: str | None = None,
        expected: str | None = None,
        found: str | None = None,
    ) -> None:
        self.problem, self.file, self.line, self.column = problem, file, line, column
        self.expected, self.found = expected, found
        place = ", ".join(
            part
            for part in (
                str(file) if file is not None else "",
                f"line {line}" if line is not None else "",
                f"column {column!r}" if column is not None else "",
            )
            if part
        )
        text = f"{place}: {problem}" if place else problem
        if expected is not None:
            text += f"\n  expected: {expected}"
        if found is not None:
            text += f"\n  found:    {found}"
        super().__init__(text)


class CalibrationError(TruepathError):
    """The data cannot carry the calibration that was asked for (too few poses, no convergence)."""


class CorrectionError(InputError):
    """A waypoint that cannot be corrected within the stated bounds; nothing is written."""
