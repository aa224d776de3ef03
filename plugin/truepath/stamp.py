"""The stamp: a comment in a corrected program by which truepath knows its own work, and refuses to repeat it.

One line of the program, nothing but a comment; for formats without comments see ``rewriting.note``. Behind the comment
sign, which is the format's own:

    truepath-corrected version=0.6.0 program-sha256=<64 hex> calibration-sha256=<64 hex> body-sha256=<64 hex>
    date=2026-11-22

(one line). ``body-sha256`` is that of the corrected program without its stamp: who runs it sees whether it was changed
since. Earlier versions wrote none. It guards against mistakes, not against somebody who computes it anew.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import truepath
from truepath.errors import InputError

MARK = "truepath-corrected"
FORM = f"{MARK} version=... program-sha256=<64 hex> calibration-sha256=<64 hex> body-sha256=<64 hex> date=YYYY-MM-DD"
_CONTENT = re.compile(
    rf"{MARK} version=([0-9A-Za-z.+-]{{1,40}}) program-sha256=([0-9a-f]{{64}}) calibration-sha256=([0-9a-f]{{64}}) "
    r"(?:body-sha256=([0-9a-f]{64}) )?date=([0-9]{4}-[0-9]{2}-[0-9]{2})"
)
_LINE_END = re.compile(r"\r\n|\r|\n")  # not those of splitlines(): a form feed or U+2028 may stand in a string
_LINE_END_BYTES = re.compile(b"(%b)" % _LINE_END.pattern.encode())


@dataclass(frozen=True)
class Stamp:
    """Which program was corrected with which calibration.

    Attributes:
        version: of truepath.
        program_sha256: of the program before it was corrected, as bytes.
        calibration_sha256: of the calibration file, as bytes.
        day: of the correction.
        body_sha256: of the corrected program without the line of the stamp, as bytes; None from earlier versions.
    """

    version: str
    program_sha256: str
    calibration_sha256: str
    day: date
    body_sha256: str | None = None

    @classmethod
    def of(cls, program: bytes, calibration: bytes, day: date) -> Stamp:
        """For the content of both files."""
        program_sha256, calibration_sha256 = (hashlib.sha256(content).hexdigest() for content in (program, calibration))
        return cls(truepath.__version__, program_sha256, calibration_sha256, day)

    def line(self, comment: str) -> str:
        """The line, without its end, behind a format's comment sign ("#" in URScript)."""
        body = "" if self.body_sha256 is None else f"body-sha256={self.body_sha256} "
        return (
            f"{comment} {MARK} version={self.version} program-sha256={self.program_sha256} "
            f"calibration-sha256={self.calibration_sha256} {body}date={self.day.isoformat()}"
        )


def sealed(content: bytes, stamp: Stamp, comment: str) -> bytes:
    """A corrected program that bears this stamp, now with the hash of its body in it.

    A format that did not write the stamp as it was given gets its content back.
    """
    plain = stamp.line(comment).encode()
    before, found, after = content.partition(plain)
    if not found:
        return content
    line = 1 + len(_LINE_END_BYTES.findall(before))
    return before + replace(stamp, body_sha256=body_sha256(content, line)).line(comment).encode() + after


def body_sha256(content: bytes, line: int) -> str:
    """Hash of a program without one line, from 1, and its end; all other bytes count, line ends as they are."""
    pieces = _LINE_END_BYTES.split(content)  # lines and their ends in turns
    del pieces[2 * line - 2 : 2 * line]
    return hashlib.sha256(b"".join(pieces)).hexdigest()


def find_stamp(text: str, file: str | Path, comment: str) -> tuple[Stamp, int] | None:
    """The first stamp in a program and its line, from 1; None if there is none.

    It may stand anywhere in the program, indented and with spaces behind it, but alone on its line. A line that
    lies within a string which was opened by a double quote further up is no comment.

    Args:
        text: the program, with line ends of any kind.
        file: name for messages.
        comment: the format's comment sign.

    Raises:
        InputError: a stamp that was changed.
    """
    if MARK not in text:  # nearly always
        return None
    lines = _LINE_END.split(text.removeprefix("\ufeff"))
    start = re.compile(rf"[ \t]*{re.escape(comment)}[ \t]*(?={MARK}(?![\w-]))")
    in_string = False
    for number, line in enumerate(lines, start=1):
        found = None if in_string else start.match(line)
        if found:
            return _parse(line[found.end() :].rstrip(), file, number), number
        in_string = _ends_in_string(line, in_string, comment)
    return None


def refuse_if_stamped(text: str, file: str | Path, comment: str) -> None:
    """Refuses a program that truepath has corrected: a second correction would be added to the first.

    Raises:
        InputError: it bears a stamp, whole or changed.
    """
    found = find_stamp(text, file, comment)
    if found is None:
        return
    raise already_corrected(found[0], file, found[1])


def already_corrected(stamp: Stamp, file: str | Path, line: int | None = None) -> InputError:
    """The refusal of a program that was corrected, whatever says so."""
    return InputError(
        "truepath has corrected this program already",
        file=file,
        line=line,
        expected="the program as it was before",
        found=f"corrected on {stamp.day} by truepath {stamp.version} from a program with SHA-256 "
        f"{stamp.program_sha256[:12]}..., with the calibration {stamp.calibration_sha256[:12]}...",
    )


def _parse(content: str, file: str | Path, line: int) -> Stamp:
    match = _CONTENT.fullmatch(content)
    try:
        if match:
            return Stamp(match[1], match[2], match[3], date.fromisoformat(match[5]), match[4])
    except ValueError:  # a day that no calendar has
        pass
    raise InputError(
        "truepath has corrected this program already, and its stamp was changed since",
        file=file,
        line=line,
        expected=FORM,
        found=content[:200],
    )


def _ends_in_string(line: str, in_string: bool, comment: str) -> bool:
    """Whether a string is open at the end of a line; quotes behind a comment sign open none."""
    if '"' not in line:
        return in_string
    for token in re.finditer(rf'"|{re.escape(comment)}', line):
        if token[0] == '"':
            in_string = not in_string
        elif not in_string:
            return False
    return in_string
