"""The reference host as an operator has it: started by one command, worked in a real browser, ended by Ctrl-C."""

import importlib.util
import re
import socket
from pathlib import Path

import numpy as np
import pytest
from running_cell import CORNERS_ON_SCREEN, SCREEN, WORKFLOW, Running, Tab

SCRIPT = """def p():
  movej([0, -1.5708, 1.5708, -1.5708, -1.5708, 0])
  movel(get_target_from_plc())
  movej([0.3, -1.4, 1.5, -1.6, -1.5708, 0])
end
"""


@pytest.fixture(scope="module")
def cell():
    """The workflow as a module."""
    spec = importlib.util.spec_from_file_location("cell_workflow", WORKFLOW)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def refused(cell, capsys):
    """Function: runs it in this process until it ends with exit code 2; gives standard error."""

    def refused(*arguments):
        try:
            code = cell.main(arguments)
        except SystemExit as stop:  # argparse
            code = stop.code
        assert code == 2
        return capsys.readouterr().err

    return refused


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """A program with a move that cannot be resolved."""
    file = tmp_path_factory.mktemp("cell") / "plc.script"
    file.write_text(SCRIPT)
    return file


@pytest.fixture(scope="module")
def running(script):
    host = Running(str(script)).read_until("ready")
    yield host
    if host.process.poll() is None:
        host.process.kill()


@pytest.fixture(scope="module")
def tab(browser, running):
    return Tab(browser, running.address)


def test_it_prints_its_address_first_and_what_it_found(running):
    assert running.lines[0].startswith("open http://localhost:")
    assert "for this machine only" in running.lines[0]
    assert any(line.startswith("warning: line 3 stays as it is") for line in running.lines)
    numbers = re.search(
        r"predicted error of the tool ([\d.]+) mm mean.*corrected (.*) mm mean", "\n".join(running.lines)
    )
    assert float(numbers[1]) > 0.5
    assert numbers[2] == "< 0.001"
    assert "looked for collisions in the host's plant" in running.lines
    known = re.search(r"the calibration was off by ([\d.]+) mm mean", "\n".join(running.lines))
    assert 0.005 < float(known[1]) < 0.1


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="only Linux tells who listens where")
def test_it_listens_on_this_machine_only(running):
    port = int(running.address.rsplit(":", 1)[1])
    rows = [
        line.split()
        for table in ("/proc/net/tcp", "/proc/net/tcp6")
        if Path(table).exists()
        for line in Path(table).read_text().splitlines()[1:]
    ]
    listening = [row[1].split(":")[0] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port]
    assert listening
    assert set(listening) <= {"0100007F", "00000000000000000000000001000000"}  # 127.0.0.1 and ::1


def test_there_is_something_to_see_in_every_part_of_the_scene(tab):
    tab.page.wait_for_timeout(2000)
    picture = tab.picture()
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500
    place, legend, middle = picture[-50:, 250:600], picture[-105:-60, 250:600], picture[50:380, 200:700]
    for part in (legend, place, middle):
        assert part.max(axis=2).min() < 110 < 200 < part.max()


@pytest.mark.parametrize(("width", "height"), [(600, 600), (640, 400)])
def test_the_text_is_seen_whole_in_narrow_windows_and_beside_open_controls(tab, width, height):
    """As wide as high, and the shape of a laptop's screen; smaller, for everything grows with the height."""
    tab.page.set_viewport_size(dict(width=width, height=height))
    tab.page.wait_for_timeout(1500)
    corners = tab.page.evaluate(CORNERS_ON_SCREEN)
    assert len(corners) >= 8  # two panes at least: a picture that is being replaced is there still
    x, y = np.array(corners).T
    assert np.abs(y).max() <= 1.0
    controls_px = 245 * height / 800  # of a screen 800 high
    assert np.abs(x).max() <= 1.0 - (2 * controls_px / width if width > height else 0.0)
    assert np.ptp(x) > 0.75
    tab.page.set_viewport_size(SCREEN)


def test_it_asks_nobody_else(tab, running):
    assert all(url.startswith((running.address, "data:", "blob:")) for url in tab.requests)


def test_scrubbing_by_key_and_by_slider_moves_both_arms(tab):
    for move in (
        lambda: tab.page.keyboard.press("ArrowRight"),
        lambda: tab.page.evaluate("() => viewer.gui_controllers['Path, %'].setValue(60)"),
    ):
        before = {arm: tab.wrist(arm) for arm in ("arm_corrected", "arm_uncorrected")}
        move()
        for arm, position in before.items():
            tab.wait_until_moved(arm, position)


def test_space_plays_and_stops(tab):
    before = tab.wrist("arm_corrected")
    tab.page.keyboard.press("Space")
    tab.wait_until_moved("arm_corrected", before)
    tab.page.keyboard.press("Space")
    tab.page.wait_for_function(
        "() => new Promise(done => { const c = viewer.gui_controllers['Path, %']; const v = c.getValue();"
        " setTimeout(() => done(c.getValue() === v), 700); })"
    )


def test_keys_hide_parts_and_colour_by_error(tab):
    for key, part in (("4", "arm_uncorrected"), ("8", "region")):
        before = tab.is_visible(part)
        for expected in (not before, before):
            tab.page.keyboard.press(key)
            tab.page.wait_for_function(
                f"() => viewer.scene_tree.find(['truepath', 'ur5', '{part}']).object.visible"
                f" === {str(expected).lower()}"
            )
    tab.page.keyboard.press("c")
    tab.page.wait_for_timeout(1500)
    assert len(np.unique(tab.picture().reshape(-1, 3), axis=0)) > 500


def test_magnifying_moves_the_ghost_only(tab):
    ghost, solid = tab.wrist("arm_uncorrected"), tab.wrist("arm_corrected")
    tab.page.evaluate("() => viewer.gui_controllers['Error, times'].setValue(120)")
    tab.wait_until_moved("arm_uncorrected", ghost)
    assert np.linalg.norm(tab.wrist("arm_corrected") - solid) < 2e-3
    assert np.linalg.norm(tab.wrist("arm_uncorrected") - ghost) > 0.02


def test_the_next_warning_is_gone_to_and_marked(tab):
    tab.page.click("text=Open Controls")
    tab.page.click("text=Next warning (N)")
    tab.page.wait_for_function(
        "() => viewer.scene_tree.find(['truepath', 'ur5', 'warning']).object.children.length > 0"
    )
    tab.page.click("text=Close Controls")


def test_nothing_was_complained_of_the_terminal_tells_the_warning_and_ctrl_c_ends_it(running, tab):
    """The last of those that need it."""
    tab.page.keyboard.press("b")  # of one warning the previous is the same
    running.read_until("line 3 stays as it is")
    assert tab.complaints == [], "something that a test did made the page complain"
    tab.page.close()
    code, said = running.interrupt()
    assert code == 0
    assert "Traceback" not in said


def test_a_calibration_is_saved_and_loaded_and_it_ends_by_itself(cell, tmp_path, capsys):
    file, said = str(tmp_path / "calibration.json"), []
    for arguments in (["--once", "--save-calibration", file], ["--seconds", "0.2", "--calibration", file]):
        assert cell.main(arguments) == 0
        said.append(capsys.readouterr().out)
    results = [re.search(r"weld\.script: .*", text)[0] for text in said]
    assert results[0] == results[1]
    assert "measuring" in said[0]
    assert "measuring" not in said[1]


def test_ctrl_c_ends_it_while_it_calibrates():
    code, said = Running().read_until("measuring").interrupt()
    assert code == 0
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no_such.script"], "no_such.script"),
        (["--calibration", str(WORKFLOW)], "cell.py"),
        (["--seed", "-1"], "seed"),
        (["--magnification", "0"], "magnification"),
        (["--seconds", "nan"], "time"),
        (["--port", "80"], "port"),
    ],
)
def test_bad_input_gives_one_message_and_exit_code_2(refused, arguments, message):
    said = refused("--once", *arguments)
    assert message in said
    assert "Traceback" not in said
    assert said.count("error: ") == 1


def test_a_port_that_is_taken_is_told(refused):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        assert "a port that is free" in refused("--once", "--port", str(taken.getsockname()[1]))


def test_the_plugin_is_found_by_its_entry_point(cell, monkeypatch, capsys):
    from truepath.host import CalibrationPlugin

    assert cell.load_plugin() is CalibrationPlugin
    asked = []
    monkeypatch.setattr(cell, "entry_points", lambda **which: asked.append(which) or [])
    assert cell.main(["--once"]) == 2
    assert asked == [{"group": "drake_olp.plugins"}]
    assert "no plugin 'truepath'" in capsys.readouterr().err
