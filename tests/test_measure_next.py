"""Poses to measure next are written beside what is in the folder, over nothing but those of an earlier diagnosis."""

import json
from dataclasses import dataclass, field

import pytest
from truepath.diagnosis import Ambiguity
from truepath.measure_next import beside


@dataclass(frozen=True)
class Doubtful:
    """As much of a diagnosis as has doubts."""

    ambiguous: tuple = field(
        default_factory=lambda: (
            Ambiguity(("backlash", "kinematic"), "why", None, "poses.csv"),
            Ambiguity(("encoder_scale", "kinematic"), "why"),
            Ambiguity(("frame_drift", "kinematic"), "why", None, "poses3.csv"),
        )
    )


def names(folder, data="data.csv"):
    return [item.measure_next for item in beside(Doubtful(), folder, folder / data).ambiguous]


def wrote_before(folder, *files):
    doubts = [{"measure_next": file} for file in files]
    (folder / "diagnosis.json").write_text(json.dumps({"ambiguous": doubts}))
    for file in files:
        if file:
            (folder / file).write_text("of the last time")


def test_in_an_empty_folder_and_in_one_to_be_made_the_names_stay(tmp_path):
    assert names(tmp_path) == names(tmp_path / "new") == ["poses.csv", None, "poses3.csv"]


def test_a_file_of_somebody_else_keeps_its_name(tmp_path):
    (tmp_path / "poses.csv").write_text("a plan")
    assert names(tmp_path) == ["measure_next.csv", None, "poses3.csv"]


def test_two_files_of_somebody_else_give_two_other_names(tmp_path):
    for name in ("poses.csv", "poses3.csv", "measure_next.csv"):
        (tmp_path / name).write_text("a plan")
    assert names(tmp_path) == ["measure_next2.csv", None, "measure_next3.csv"]


def test_what_an_earlier_diagnosis_wrote_is_replaced(tmp_path):
    wrote_before(tmp_path, None, "poses.csv")
    assert names(tmp_path) == ["poses.csv", None, "poses3.csv"]


def test_so_is_what_it_wrote_beside_a_plan(tmp_path):
    (tmp_path / "poses.csv").write_text("a plan")
    wrote_before(tmp_path, "measure_next.csv")
    assert names(tmp_path) == ["measure_next.csv", None, "poses3.csv"]


def test_poses_of_an_earlier_diagnosis_that_were_filled_with_readings_are_data_and_stay(tmp_path):
    wrote_before(tmp_path, "poses.csv")
    assert names(tmp_path, data="poses.csv") == ["measure_next.csv", None, "poses3.csv"]


@pytest.mark.parametrize(
    "text", ["old", "[]", "{}", '{"ambiguous": [3]}', '{"ambiguous": null}', "\udcff", "[" * 10**5]
)
def test_what_is_no_diagnosis_names_nothing(tmp_path, text):
    (tmp_path / "poses.csv").write_text("a plan")
    (tmp_path / "diagnosis.json").write_bytes(text.encode(errors="surrogateescape"))
    assert names(tmp_path)[0] == "measure_next.csv"


def test_a_link_that_leads_nowhere_is_somebody_elses(tmp_path):
    (tmp_path / "poses.csv").symlink_to("gone.csv")
    assert names(tmp_path)[0] == "measure_next.csv"
