"""The command: a file and a table, or one plain sentence and nothing written."""

import json

import numpy as np
import pytest
from truepath.planning.pose_list import read_pose_list

QUICK = ("--cell", "none", "--poses", "20")


@pytest.fixture
def output(tmp_path):
    return tmp_path / "poses.csv"


def test_a_plan_is_written_and_told(truepath, output):
    result = truepath("plan", "--robot", "ur5_cell", *QUICK, "-o", output)
    assert result.code == 0
    poses = read_pose_list(output)
    assert poses.measure.sum() == 20
    said = result.out
    for word in ("random feasible", "axis2.pos_x", "travel", "correlation", "no tracker", "no cell"):
        assert word in said


def test_for_machines_there_is_json_and_the_criterion_can_be_d(truepath, output):
    result = truepath("plan", "--robot", "ur5_cell", *QUICK, "--criterion", "d", "--repeats", 3, "--json", "-o", output)
    content = json.loads(result.out)
    assert content["measurements"] == 20
    assert content["repeats"] == 3
    assert content["poses"] == 17
    assert len(content["parameters"]) == 27
    assert 0 < content["tool_sigma_mm"]["mean"] < content["random_tool_sigma_mm"]["median"]
    assert read_pose_list(output).pose_id.max() == 16


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((*QUICK[:2], "--poses", "8"), "too few poses"),
        ((*QUICK, "--tracker", "100,0,0"), "range"),
        ((*QUICK, "--tracker", "2,0,1", "--acceptance-deg", "0.01"), "towards the tracker"),
        ((*QUICK, "--effects", "rust"), "rust"),
        ((*QUICK, "--probe", "unknown"), "unknown place"),
        ((*QUICK, "--noise-mm", "0"), "noise"),
        ((*QUICK, "--speed-deg-s", "0"), "speed"),
        ((*QUICK, "--clearance-mm", "-1"), "clearance"),
        (("--cell", "ur10_cell"), "another robot"),
        ((*QUICK, "--improve", "no.json", "no.csv"), "no.json"),
        ((*QUICK, "--improve", "no.json"), "needs two files"),  # it would take "-o" for the second
        (("--cell", "no_such_cell"), "no cell 'no_such_cell'"),
    ],
)
def test_what_cannot_be_done_is_said_in_plain_words_and_nothing_is_written(truepath, output, arguments, says):
    result = truepath("plan", "--robot", "ur5_cell", *arguments, "-o", output)
    assert result.code == 2
    assert says in result.err
    assert not output.exists()


def test_a_cell_in_which_nothing_is_free_is_refused(truepath, output, tmp_path):
    walls = "\n".join(
        f'<collision name="wall{k}"><origin xyz="0 0 {z}"/><geometry><box size="4 4 0.05"/></geometry></collision>'
        for k, z in enumerate(np.arange(0.05, 2.5, 0.12))
    )
    (tmp_path / "walls.urdf").write_text(f'<robot name="walls"><link name="walls">{walls}</link></robot>')
    cell = tmp_path / "full.dmd.yaml"
    cell.write_text(
        f"""directives:
- add_directives: {{file: "package://truepath_models/ur5/cell.dmd.yaml"}}
- add_model: {{name: walls, file: "file://{tmp_path}/walls.urdf"}}
- add_weld: {{parent: world, child: walls::walls}}
"""
    )
    result = truepath("plan", "--robot", "ur5_cell", "--cell", cell, "-o", output)
    assert result.code == 2
    assert "nothing is free" in result.err
    assert not output.exists()
