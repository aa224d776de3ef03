"""The reproduction draws the paper's robots, keeps its poses apart, and says the same numbers everywhere."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from truepath.calibrate import calibrate
from truepath.iso9283 import accuracy
from truepath.residual.limits import Limits, Settings
from truepath.residual.options import Options
from truepath.virtual.real_robot import Imperfection, RealRobot

# At the end: a test package and a workflow have the same name.
sys.path.append(str(Path(__file__).parents[1] / "workflows"))

import reproduce_paper
from reproduction import cases, simulated, summary, text
from reproduction.cases import Case, Outcome
from reproduction.figures import draw_figures
from reproduction.published import ROWS
from reproduction.simulated import Design, joint_errors, scale_to, simulate

QUICK = ("--jobs", "1", "--rows", "before", "kinematic")


@pytest.fixture(scope="module")
def robot_3():
    return simulate(3, Design())


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


class TestSimulatedRobot:
    def test_its_mean_error_before_is_the_papers_by_drake(self, robot_3):
        nominal = RealRobot(simulated.CELL, 0, Imperfection(0, 0, 0, 0, 0))
        p_nominal = nominal.reflector_poses(robot_3.fresh.q_rad)[:, :3, 3]
        assert 1e3 * np.linalg.norm(robot_3.fresh.p_ME - p_nominal, axis=1).mean() == pytest.approx(0.7411, abs=1e-5)

    def test_the_row_before_says_so_too(self, robot_3):
        (before,) = cases.learn_rows(["before"], robot_3.robot, robot_3.known, 3)
        errors = before.predict(robot_3.fresh.q_rad)[:, :3, 3] - robot_3.fresh.p_ME
        assert 1e3 * np.linalg.norm(errors, axis=1).mean() == pytest.approx(0.7411, abs=1e-5)

    def test_has_as_many_poses_as_in_the_paper_and_none_twice(self, robot_3):
        assert (len(robot_3.known), len(robot_3.fresh)) == (1000, 100)
        together = np.vstack([robot_3.known.q_rad, robot_3.fresh.q_rad])
        assert len(np.unique(together, axis=0)) == 1100

    @pytest.mark.parametrize("half_range_deg", [10.0, 60.0])
    def test_moves_within_the_stated_range(self, half_range_deg):
        q = simulate(0, Design(half_range_deg)).known.q_rad
        beyond = np.abs(np.degrees(q - simulated.CENTRE_RAD)).max(axis=0)
        assert np.all(beyond <= half_range_deg)
        assert np.all(beyond > 0.98 * half_range_deg)

    def test_noise_is_in_the_poses_to_fit_only(self, robot_3):
        noisy = simulate(3, Design(noise_mm=0.03))
        np.testing.assert_array_equal(noisy.known.q_rad, robot_3.known.q_rad)
        np.testing.assert_array_equal(noisy.fresh.p_ME, robot_3.fresh.p_ME)
        assert 1e3 * (noisy.known.p_ME - robot_3.known.p_ME).std() == pytest.approx(0.03, rel=0.05)

    def test_states_where_base_and_reflector_are_meant_to_be(self, robot_3):
        np.testing.assert_array_equal(robot_3.known.X_MB_nominal, robot_3.robot.X_WB)
        np.testing.assert_array_equal(robot_3.known.X_FE_nominal, robot_3.robot.X_FR)


class TestJointErrors:
    @pytest.mark.parametrize("order", [0, 1, 2, 6, 11])
    def test_are_chebyshev_series(self, order):
        rng = np.random.default_rng(order)
        u, a = rng.uniform(-1, 1, (40, 6)), rng.normal(size=(6, order + 1))
        expected = np.stack([chebyshev.chebval(u[:, i], a[i]) for i in range(6)], axis=1)
        np.testing.assert_allclose(joint_errors(u, a), expected, atol=1e-12)


class TestScale:
    def test_is_found_where_the_size_is_nearly_in_proportion(self):
        scale = scale_to(0.7, lambda f: 2.0 * f + 0.01 * f**2)
        assert 2.0 * scale + 0.01 * scale**2 == pytest.approx(0.7, abs=1e-5)

    def test_nothing_cannot_be_scaled(self):
        with pytest.raises(RuntimeError, match="no factor found"):
            scale_to(0.7, lambda f: 0.0)


class TestSplit:
    def test_poses_to_fit_and_to_verify_do_not_overlap(self):
        for number in range(10):
            known, fresh = cases.split(800, number)
            assert (len(known), len(fresh)) == (600, 100)
            assert len(np.union1d(known, fresh)) == 700

    def test_splits_differ_and_come_out_the_same_again(self):
        first, again, other = (cases.split(800, number)[1] for number in (0, 0, 1))
        np.testing.assert_array_equal(first, again)
        assert len(np.intersect1d(first, other)) < 50

    def test_too_few_rows_are_said(self):
        with pytest.raises(ValueError, match="699 rows, but 600 are to be fitted and 100 to be verified"):
            cases.split(699, 0)


class TestErrorsPoseByPose:
    def test_have_the_means_of_the_tables(self):
        rng = np.random.default_rng(0)
        p_true = rng.uniform(-1, 1, (100, 3))
        X = np.tile(np.eye(4), (100, 1, 1))
        X[:, :3, 3] = p_true + rng.normal(scale=1e-3, size=(100, 3))
        whole = accuracy(X, p_true, None, np.arange(100))
        position, distance = cases.pose_errors_mm(X[:, :3, 3], p_true)
        assert position.mean() == pytest.approx(whole.position_mm.mean)
        assert distance.mean() == pytest.approx(whole.distance_mm.mean)


class TestRows:
    @pytest.fixture
    def asked(self, robot_3, monkeypatch):
        """What was asked of ``learn``, which here only fits the kinematics."""
        calls = []

        def learn(robot, measurements, *, effects, network):
            calls.append((effects, None if network is None else network.seed))
            model = calibrate(robot, measurements).model
            return SimpleNamespace(calibration=SimpleNamespace(model=model), network="left out")

        monkeypatch.setattr(cases, "learn", learn)
        return calls

    def test_two_rows_come_from_one_calibration(self, robot_3, asked):
        wanted = [row for row in ROWS if row != "direct"]
        rows = [learnt.row for learnt in cases.learn_rows(wanted, robot_3.robot, robot_3.known, 7)]
        assert sorted(rows) == sorted(wanted)
        assert asked == [((), 7), ("auto", 7)]

    def test_no_network_is_learnt_that_nobody_wants(self, robot_3, asked):
        rows = [learnt.row for learnt in cases.learn_rows(["kinematic", "named"], robot_3.robot, robot_3.known, 7)]
        assert rows == ["kinematic", "named"]
        assert asked == [("auto", None)]

    def test_without_its_network_a_calibration_is_the_plain_one(self, robot_3, monkeypatch):
        small = Options(Settings(10, 6, 6, generations=3), Limits(60, 15), members=2)
        monkeypatch.setattr(cases, "Options", lambda seed: small)
        known = robot_3.known.subset(np.arange(700))
        learnt = {it.row: it for it in cases.learn_rows(["kinematic", "kinematic+network"], robot_3.robot, known, 0)}
        assert learnt["kinematic+network"].notes["network"].startswith("in the model")
        q = robot_3.fresh.q_rad
        expected = calibrate(robot_3.robot, known).model.predict(q)
        np.testing.assert_allclose(learnt["kinematic"].predict(q), expected, atol=1e-9)
        assert np.abs(learnt["kinematic+network"].predict(q) - expected).max() > 1e-5

    def test_the_papers_network_goes_from_joints_to_positions(self, robot_3, monkeypatch):
        network = SimpleNamespace(predict=lambda q_rad: 2.0 * q_rad[:, :3], hidden=9)
        seen = []
        monkeypatch.setattr(cases, "learn_direct", lambda q_rad, p_m, seed: seen.append((q_rad, p_m, seed)) or network)
        (learnt,) = cases.learn_rows(["direct"], robot_3.robot, robot_3.known, 5)
        np.testing.assert_array_equal(learnt.predict(robot_3.fresh.q_rad)[:, :3, 3], 2.0 * robot_3.fresh.q_rad[:, :3])
        assert seen[0][2] == 5
        assert seen[0][1] is robot_3.known.p_ME


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


class TestCommand:
    def test_writes_what_it_prints(self, tmp_path, capsys):
        files = {name: tmp_path / "new" / f"paper.{name}" for name in ("json", "md")}
        told = ["--json", str(files["json"]), "--markdown", str(files["md"]), "--figures", str(tmp_path / "figures")]
        only = ["--only", "simulation", "--seeds", "1", "--noise-mm", "0.03"]
        assert reproduce_paper.main([*QUICK, *only, *told]) == 0
        report = json.loads(files["json"].read_text())
        assert report["schema"] == "truepath.reproduction/1"
        assert report["cases"][0]["noise_mm"] == 0.03
        assert [row["row"] for row in report["tables"][0]["rows"]] == ["before", "kinematic"]
        assert "0.7411 (0.7411 - 0.7411)" in files["md"].read_text()
        assert "0.7411 (0.7411 - 0.7411)" in capsys.readouterr().out
        assert len(list((tmp_path / "figures").iterdir())) == 2

    def test_without_data_it_says_so(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setenv("TRUEPATH_DATA", str(tmp_path))
        assert reproduce_paper.main([*QUICK, "--only", "experiment", "--splits", "1"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "skipped: experiment: no " in said
        assert "set TRUEPATH_DATA to the folder of the published data sets" in said

    def test_the_real_robot(self, data_dir, capsys, monkeypatch):
        monkeypatch.setenv("TRUEPATH_DATA", str(data_dir))
        assert reproduce_paper.main([*QUICK, "--only", "experiment", "--splits", "1"]) == 0
        assert "Table 3: positioning accuracy, experiment (a real UR5), mm" in capsys.readouterr().out

    def test_what_breaks_is_told_and_ends_in_exit_code_1(self, capsys, monkeypatch):
        def breaks(*_):
            raise ValueError("this robot is no good")

        monkeypatch.setattr(cases, "calibrate", breaks)
        assert reproduce_paper.main([*QUICK, "--only", "simulation", "--seeds", "1", "--noise-mm", "0"]) == 1
        assert "this robot is no good" in capsys.readouterr().err

    @pytest.mark.parametrize(
        "wrong", [("--seeds", "0"), ("--jobs", "0"), ("--noise-mm", "-1"), ("--range-deg", "0"), ("--order", "-1")]
    )
    def test_numbers_that_make_no_sense_are_refused(self, wrong, capsys):
        with pytest.raises(SystemExit) as stopped:
            reproduce_paper.main(wrong)
        assert stopped.value.code == 2
        assert "must be larger than 0" in capsys.readouterr().err or wrong[1] == "-1"
