"""The reproduction draws the paper's robots, keeps its poses apart, and learns its rows."""

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

from reproduction import cases, simulated
from reproduction.published import ROWS
from reproduction.simulated import Design, joint_errors, scale_to, simulate


@pytest.fixture(scope="module")
def robot_3():
    return simulate(3, Design())


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
