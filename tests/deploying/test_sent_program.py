"""The program that is sent: what is refused before anybody asks the robot."""

import re

import pytest
from truepath.deploying.sent_program import read_program, require_correction, robot_remarks
from truepath.errors import InputError
from truepath.virtual.controller.script_syntax import read_syntax

MOVE = "movej([0, -1.57, 1.57, -1.57, -1.57, 0])"


@pytest.fixture
def script(tmp_path):
    """Function: a program in a file."""

    def script(text, name="program.script"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return script


def test_a_program_is_sent_as_it_is(script):
    text = f"# a comment\ndef program():\n  {MOVE}\nend\n"
    assert read_program(script(text)).sent == text


def test_bare_statements_become_one_program(script):
    program = read_program(script(f"def there():\n{MOVE}\nend\nthere()\n"))
    assert program.sent == f"def truepath_program():\n  def there():\n  {MOVE}\n  end\n  there()\nend\n"
    assert len(read_syntax(program.sent).programs) == 1


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (f"sec program():\n{MOVE}\nend\n", "secondary"),
        (f"def a():\n{MOVE}\nend\ndef b():\n{MOVE}\nend\n", "one program only"),
        ("# nothing\n", "one program only"),
        (f"def a():\n{MOVE}\n", "end is missing"),
        (b"def a():\n  textmsg(\"\xff\")\nend\n", "UTF-8"),
    ],
)  # fmt: skip
def test_what_a_controller_would_not_start_is_refused(script, text, problem):
    with pytest.raises(InputError, match=problem):
        read_program(script(text))


def test_only_scripts_are_sent(script):
    with pytest.raises(InputError, match="only a script"):
        read_program(script("q1_rad\n", "path.csv"))


def test_a_program_that_was_corrected_with_this_calibration_passes(weld, calibration):
    require_correction(read_program(weld), calibration)


def test_a_program_that_was_not_corrected_is_refused(script, calibration):
    with pytest.raises(InputError, match="not corrected") as error:
        require_correction(read_program(script(f"def a():\n{MOVE}\nend\n")), calibration)
    assert "--uncorrected" in error.value.expected


def test_one_that_was_corrected_with_another_calibration_is_refused(weld, calibration):
    with pytest.raises(InputError, match="another calibration"):
        require_correction(read_program(weld), calibration.carrying(2.5))


def test_one_that_was_changed_after_its_correction_is_refused(weld, script, calibration):
    written = weld.read_bytes()
    for changed in (
        written.replace(b"v=0.25", b"v=2.25", 1),
        written.replace(b"\n", b"\r\n"),
        written.splitlines(keepends=True)[0] + f"def a():\n{MOVE}\nend\n".encode(),
    ):
        assert changed != written
        with pytest.raises(InputError, match="changed after it was corrected"):
            require_correction(read_program(script(changed)), calibration)


def test_one_whose_stamp_does_not_tell_whether_it_was_changed_is_refused(weld, script, calibration):
    earlier = re.sub(rb"body-sha256=[0-9a-f]{64} ", b"", weld.read_bytes())
    with pytest.raises(InputError, match="by an earlier version") as error:
        require_correction(read_program(script(earlier)), calibration)
    assert "corrected again" in error.value.expected


def test_one_for_another_robot_is_refused(script, calibration):
    with pytest.raises(InputError, match="UR10"):
        robot_remarks(read_program(script(f"# robot: UR10\ndef a():\n{MOVE}\nend\n")), calibration)
