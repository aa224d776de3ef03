"""Models judged on poses that were kept away: errors are those of these poses and of no others."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from truepath.context import Context
from truepath.kept_away import KeptAway
from truepath.measurements import Measurements
from truepath.model import nominal_model

UNSEEN = np.arange(60) % 4 == 0
NOISE = 1e-4


@pytest.fixture(scope="module")
def model(ur5):
    """A perfect robot."""
    return nominal_model(ur5)


@pytest.fixture(scope="module")
def off(model):
    """The same, seen 0.3 mm off."""
    X_MB = np.eye(4)
    X_MB[0, 3] = 3e-4
    return replace(model, X_MB=X_MB)


@pytest.fixture(scope="module")
def measurements(model):
    rng = np.random.default_rng(0)
    q = rng.uniform(-2, 2, (60, 6))
    return Measurements(q, model.predict(q)[:, :3, 3] + NOISE * rng.normal(size=(60, 3)))


@pytest.fixture(scope="module")
def trial(measurements):
    return KeptAway(measurements, Context.of(measurements), UNSEEN)


def errors(model, measurements):
    """``(k,)`` mm on the unseen poses."""
    miss = model.predict(measurements.q_rad[UNSEEN])[:, :3, 3] - measurements.p_ME[UNSEEN]
    return np.array([1e3 * np.sqrt(sum(part**2 for part in row)) for row in miss])


def test_what_is_not_unseen_is_seen(trial):
    assert np.array_equal(trial.seen, ~UNSEEN)


def test_poses_may_be_neither(measurements):
    wrong = np.arange(60) == 1
    trial = KeptAway(measurements, Context.of(measurements), UNSEEN, ~UNSEEN & ~wrong)
    assert not (trial.seen | trial.unseen)[1]


def test_errors_are_those_of_the_unseen_poses(trial, off, measurements):
    np.testing.assert_allclose(trial.errors_mm(off), errors(off, measurements))
    assert trial.mean(off) == pytest.approx(errors(off, measurements).mean())
    assert trial.accuracy(off).position_mm.mean == pytest.approx(errors(off, measurements).mean())
    assert trial.accuracy(off).position_mm.max == pytest.approx(errors(off, measurements).max())


def test_the_nominal_robot_is_judged_on_the_same_poses(trial, off, model, measurements):
    assert trial.nominal_accuracy(off).position_mm.mean == pytest.approx(errors(model, measurements).mean())


def test_a_gain_is_the_difference_of_means_with_student_s_interval(trial, off, model, measurements):
    gain, difference = trial.gain(off, model), errors(off, measurements) - errors(model, measurements)
    assert (gain.before_mm, gain.after_mm) == pytest.approx((trial.mean(off), trial.mean(model)))
    interval = stats.t.interval(0.95, len(difference) - 1, difference.mean(), stats.sem(difference))
    np.testing.assert_allclose(gain.ci95_mm, interval)


@pytest.fixture(scope="module")
def revisited(model):
    """15 unseen poses and 5 that were seen, visited four times each, one after the other."""
    rng = np.random.default_rng(1)
    pose = np.arange(80) // 4
    q = rng.uniform(-2, 2, (20, 6))[pose]
    p_ME = model.predict(q)[:, :3, 3] + NOISE * rng.normal(size=(80, 3))
    measurements = Measurements(q, p_ME, pose_id=pose)
    return KeptAway(measurements, Context.of(measurements), pose >= 5)


class TestRepeatedVisits:
    @staticmethod
    def by_hand(model, trial):
        """``(15,)`` mm."""
        miss = (model.predict(trial.measurements.q_rad)[:, :3, 3] - trial.measurements.p_ME)[20:]
        return np.array([1e3 * np.linalg.norm(miss[4 * k : 4 * k + 4].mean(axis=0)) for k in range(15)])

    def test_all_means_are_that_of_the_barycentres(self, revisited, model, off):
        gain = revisited.gain(off, model)
        for found, robot in ((gain.before_mm, off), (gain.after_mm, model)):
            mean = self.by_hand(robot, revisited).mean()
            assert (found, revisited.mean(robot)) == pytest.approx((mean, mean))
            assert revisited.accuracy(robot).position_mm.mean == pytest.approx(mean)

    def test_the_interval_is_that_of_so_many_poses(self, revisited, model, off):
        difference = self.by_hand(off, revisited) - self.by_hand(model, revisited)
        interval = stats.t.interval(0.95, 14, difference.mean(), stats.sem(difference))
        np.testing.assert_allclose(revisited.gain(off, model).ci95_mm, interval)


def test_of_a_model_over_itself_nothing_is_gained(trial, model):
    gain = trial.gain(model, model)
    assert gain.before_mm == gain.after_mm
    np.testing.assert_allclose(gain.ci95_mm, (0.0, 0.0))
