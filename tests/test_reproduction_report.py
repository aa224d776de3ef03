"""The reproduction says the same numbers in its tables, its remarks and its figures."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from truepath.iso9283 import accuracy

# At the end: a test package and a workflow have the same name.
sys.path.append(str(Path(__file__).parents[1] / "workflows"))

from reproduction import cases, summary, text
from reproduction.cases import Case, Outcome
from reproduction.figures import draw_figures
from reproduction.published import ROWS
from reproduction.simulated import Design


def made_up(protocol, seed, design, means_mm):
    """The outcome of a case in which every row misses all poses by its mean, alternately to and fro."""
    outcome = Outcome(Case(protocol, seed, tuple(means_mm), design))
    p_true = np.random.default_rng(seed).uniform(-1, 1, (100, 3))
    for row, mean_mm in means_mm.items():
        X = np.tile(np.eye(4), (100, 1, 1))
        X[:, :3, 3] = p_true + 1e-3 * mean_mm * np.where(np.arange(100) % 2, 1.0, -1.0)[:, None] * [1.0, 0.0, 0.0]
        outcome.accuracy[row] = accuracy(X, p_true, None, np.arange(100))
        outcome.position_mm[row], outcome.distance_mm[row] = cases.pose_errors_mm(X[:, :3, 3], p_true)
        outcome.seconds[row] = 0.0
    return outcome


@pytest.fixture
def outcomes():
    """Three robots, twice with noise, and two splits."""
    found = []
    for noise_mm, factor in ((0.0, 1.0), (0.03, 2.0)):
        for seed, more in enumerate((1.0, 1.1, 3.0)):
            means = {
                row: factor * more * size for row, size in zip(ROWS, (0.7, 0.36, 0.1, 0.08, 0.006, 0.005), strict=True)
            }
            found.append(made_up("simulation", seed, Design(noise_mm=noise_mm), means))
    found += [made_up("ranges", 0, Design(half_range_deg=h), {"direct": m}) for h, m in ((60.0, 2.0), (10.0, 0.01))]
    return found + [made_up("experiment", k, None, dict.fromkeys(ROWS, 0.05)) for k in range(2)]


@pytest.fixture
def report(outcomes):
    settings = {"seeds": 3, "splits": 2, "half_range_deg": 60.0, "order": 6}
    return summary.summarise(outcomes, settings, ["something"])


class TestReport:
    def test_holds_the_papers_four_tables(self, report):
        said = {
            (table["number"], row["row"]): (row["mean"]["paper"], row["max"]["paper"])
            for table in report["tables"]
            for row in table["rows"]
        }
        assert [said[k, row] for k in (1, 2, 3, 4) for row in ("before", "kinematic", "direct")] == [
            *((0.7411, 2.9500), (0.3611, 1.1379), (0.1007, 0.6803)),
            *((1.1180, 3.1760), (0.4461, 1.3360), (0.1564, 0.7743)),
            *((1.7730, 3.9930), (0.2595, 0.9877), (0.1041, 0.6559)),
            *((0.8497, 2.0140), (0.1915, 0.4113), (0.0493, 0.2392)),
        ]
        assert said[1, "all"] == (None, None)

    def test_gives_median_and_range(self, report):
        rows = {(row["noise_mm"], row["row"]): row for row in report["tables"][0]["rows"]}
        ours = rows[0.0, "direct"]["mean"]["truepath"]
        assert [ours[name] for name in ("median", "least", "most")] == pytest.approx([0.11, 0.1, 0.3])
        assert rows[0.03, "direct"]["mean"]["truepath"]["median"] == pytest.approx(0.22)

    def test_says_what_is_met_and_what_is_missed(self, report):
        met = {
            (line["protocol"], line["noise_mm"], line["row"], line["statistic"], line["quantity"]): line["met"]
            for line in report["required"]
        }
        assert met == {
            ("simulation", 0.0, "direct", "mean", "position_mm"): False,  # 0.11
            ("simulation", 0.03, "direct", "mean", "position_mm"): False,
            ("simulation", 0.0, "direct", "max", "position_mm"): True,
            ("simulation", 0.03, "direct", "max", "position_mm"): True,
            ("simulation", 0.0, "all", "mean", "position_mm"): True,
            ("simulation", 0.03, "all", "mean", "position_mm"): True,
            ("experiment", None, "all", "mean", "position_mm"): True,
            ("experiment", None, "all", "max", "position_mm"): True,
            ("experiment", None, "all", "mean", "distance_mm"): True,
        }
        assert "missed: simulation, noise-free, the paper's network alone: position mean" in text.remarks(report)

    def test_says_for_which_joint_ranges_the_papers_table_is_reached(self, report):
        reached = {line["half_range_deg"]: line["mean"]["reached"] for line in report["ranges"]}
        assert reached == {10.0: True, 60.0: False}

    def test_says_the_same_in_markdown_as_in_json(self, report):
        lines = text.markdown(report).splitlines()
        for table in json.loads(json.dumps(report))["tables"]:
            start = next(k for k, line in enumerate(lines) if line.startswith(f"## Table {table['number']}:"))
            written = [line.strip("| ").split(" | ") for line in lines[start + 4 : start + 4 + len(table["rows"])]]
            for cells, row in zip(written, table["rows"], strict=True):
                assert cells[0] == row["name"]
                for ours, statistic in ((cells[-3], "mean"), (cells[-1], "max")):
                    numbers = [float(word) for word in ours.replace("(", "").replace(")", "").split() if word != "-"]
                    values = row[statistic]["truepath"]
                    expected = [values["median"], values["least"], values["most"]]
                    assert numbers == pytest.approx(expected, abs=0.51e-4)

    def test_a_case_that_broke_is_told_and_not_counted(self, outcomes):
        outcomes[0].trouble = "Traceback ...\nValueError: no good\n"
        report = summary.summarise(outcomes, {"seeds": 3, "splits": 2, "half_range_deg": 60.0, "order": 6}, [])
        assert "failed: simulation 0: ValueError: no good" in text.remarks(report)
        assert report["tables"][0]["rows"][2]["mean"]["truepath"]["least"] == pytest.approx(0.11)


class TestFigures:
    def test_one_for_each_of_the_papers_and_each_noise(self, outcomes, tmp_path):
        files = draw_figures(outcomes, tmp_path / "new")
        assert [path.name for path in files] == [
            "figure08_simulation_position_noise0mm.png",
            "figure08_simulation_position_noise0.03mm.png",
            "figure09_simulation_distance_noise0mm.png",
            "figure09_simulation_distance_noise0.03mm.png",
            "figure13_experiment_position.png",
            "figure14_experiment_distance.png",
        ]
        assert all(path.read_bytes().startswith(b"\x89PNG") for path in files)

    def test_an_exact_prediction_can_be_drawn(self, tmp_path):
        assert draw_figures([made_up("experiment", 0, None, {"all": 0.0})], tmp_path)
