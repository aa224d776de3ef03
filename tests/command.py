"""Running the command as the entry point does, in this process."""

import json
import sys

from truepath.cli import main


class Outcome:
    """Exit code, and what stood on standard output and error."""

    def __init__(self, code, out, err):
        self.code, self.out, self.err = code, out, err

    def json(self):
        """Standard output as JSON."""
        return json.loads(self.out)


def run(monkeypatch, capsys, *arguments):
    """``truepath`` with some arguments."""
    monkeypatch.setattr(sys, "argv", ["truepath", *map(str, arguments)])
    try:
        main()
        code = 0
    except SystemExit as stop:
        code = stop.code or 0
    captured = capsys.readouterr()
    return Outcome(code, captured.out, captured.err)


def is_refused(outcome, *words):
    """Exit code 2 and one clear message on standard error, nothing else."""
    assert outcome.code == 2, outcome.err
    assert outcome.out == ""
    assert "Traceback" not in outcome.err
    assert outcome.err.count("error:") == 1
    for word in words:
        assert word in outcome.err
    return True
