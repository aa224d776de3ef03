"""The program as it is sent: whether it is one, who corrected it, and what a controller must get."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from datetime import date, datetime, timezone
from pathlib import Path

from truepath.calibration import Calibration
from truepath.errors import InputError
from truepath.guards import calibration_findings
from truepath.programs.urscript.script import read_bytes
from truepath.rewriting.named_robot import robot_named_in
from truepath.rewriting.open import SCRIPTS
from truepath.stamp import Stamp, body_sha256, find_stamp
from truepath.virtual.controller.script_instructions import ScriptError
from truepath.virtual.controller.script_syntax import read_syntax

WRAPPED_IN = "truepath_program"


@dataclass(frozen=True)
class SentProgram:
    """A program.

    Attributes:
        file: name for messages.
        text: as in the file; its lines are those of all messages.
        sent: what the controller gets: the same, as one function.
        stamp: of its correction; None if it was not corrected.
        body_sha256: of the file without the line of its stamp; None without one.
    """

    file: str
    text: str
    sent: str
    stamp: Stamp | None
    body_sha256: str | None


def read_program(path: str | Path) -> SentProgram:
    """Reads a script and looks whether a controller would start it.

    Raises:
        InputError: no script, none that can be sent, or a stamp that was changed.
    """
    path = Path(path)
    if path.suffix.lower() not in SCRIPTS:
        raise InputError(
            "only a script can be sent to a robot",
            file=path,
            expected=f"a name ending in {', '.join(SCRIPTS)}",
            found=path.suffix or "no ending",
        )
    try:
        raw = read_bytes(path)
        text = raw.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        raise InputError("the program is not UTF-8 text", file=path, found=f"byte {error.start}") from None
    try:
        syntax = read_syntax(text)
    except ScriptError as error:
        raise InputError(error.reason, file=path, line=error.line) from None
    if syntax.secondary:
        raise InputError(
            "a secondary program (sec) cannot move the robot", file=path, expected="a program: def ...(): ... end"
        )
    if not syntax.bare and len(syntax.programs) != 1:
        raise InputError(
            "the controller would start one program only", file=path, expected="1", found=str(len(syntax.programs))
        )
    sent = _as_function(text) if syntax.bare else text
    found = find_stamp(text, path, "#")
    if found is None:
        return SentProgram(str(path), text, sent, None, None)
    stamp, line = found
    return SentProgram(str(path), text, sent, stamp, body_sha256(raw, line))


def require_correction(program: SentProgram, calibration: Calibration) -> None:
    """Refuses a program that was not corrected with this calibration.

    Raises:
        InputError: no stamp, that of another calibration or of an earlier version, or another program below it.
    """
    wanted = hashlib.sha256(calibration.to_json().encode()).hexdigest()
    if program.stamp is None:
        raise InputError(
            "truepath has not corrected this program",
            file=program.file,
            expected="a program written by truepath correct, or --uncorrected to send it all the same",
            found="no stamp",
        )
    if program.stamp.body_sha256 is None:
        raise InputError(
            "the program was corrected by an earlier version, whose stamp does not tell whether it was changed since",
            file=program.file,
            expected="a program that is corrected again, or --uncorrected",
            found=f"truepath {program.stamp.version}",
        )
    if program.stamp.body_sha256 != program.body_sha256:
        raise InputError(
            "the program was changed after it was corrected",
            file=program.file,
            expected=f"what truepath correct wrote on {program.stamp.day}, or --uncorrected",
            found="other content below the same stamp",
        )
    if program.stamp.calibration_sha256 != wanted:
        raise InputError(
            "the program was corrected with another calibration",
            file=program.file,
            expected=f"calibration {wanted[:12]}... (with the --payload-kg of the correction), or --uncorrected",
            found=f"calibration {program.stamp.calibration_sha256[:12]}..., on {program.stamp.day}",
        )


def robot_remarks(program: SentProgram, calibration: Calibration, today: date | None = None) -> list[str]:
    """What a person should know about the calibration.

    Raises:
        InputError: the program names another robot.
    """
    today = today or datetime.now(timezone.utc).date()
    findings = calibration_findings(calibration, robot_named_in(program.text), today)
    for finding in findings:
        if finding.level == "error":
            raise InputError(finding.message, file=program.file)
    return [finding.message for finding in findings]


def _as_function(text: str) -> str:
    """Statements without a function around them; indented, because an end in the first column ends the program."""
    body = "\n".join(f"  {line}" for line in text.splitlines())
    return f"def {WRAPPED_IN}():\n{body}\nend\n"
