"""Joint errors that are smooth but no waves: Chebyshev polynomials of the joint angle, truth by numpy and Drake."""

import re

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from truepath.calibrate import calibrate
from truepath.context import Context
from truepath.effects import EFFECTS, is_understood, joint_errors
from truepath.effects.base import EffectParameter, FittedTerm, Term, basis
from truepath.measurements import Measurements
from truepath.model import CalibratedModel
from truepath.motions import Moves
from truepath.search import FEW_FORMS
from truepath.summaries import summary
from truepath.virtual.real_robot import Imperfection, RealRobot

CENTRE = np.radians([0, -90, 90, -90, -90, 0])
EFFECT = EFFECTS["transmission_error"]
WAVES, ORDER = 1.5e-4, 6  # rad; degree


def polynomials_of(joint, robot, context):
    """The term of the polynomial form for a joint (from 1)."""
    (term,) = (
        term
        for form in EFFECT.alternatives(robot, context)
        for term in form
        if term.joint == joint and term.parameters[0].name.startswith("chebyshev")
    )
    return term


def term_from(lower, upper, *names):
    constants = (("lower_rad", lower), ("upper_rad", upper))
    return Term(
        EFFECT.name, Moves.JOINT, 2, ("theta",), constants, tuple(EffectParameter(n, "rad", 0, "") for n in names)
    )


class SmoothRobot:
    """A UR5 by Drake whose joints stray by polynomials over half_range_rad to either side of the centre."""

    def __init__(self, seed, half_range_rad, order=ORDER, joints=range(6), size_rad=8e-4):
        self.real = RealRobot("ur5_cell", seed, Imperfection(0.12, 0.2, 0.0, 0.0, 0.0))
        self.rng, self.half = np.random.default_rng(seed), half_range_rad
        self.coefficients = np.zeros((6, order + 1))
        self.coefficients[list(joints), 1:] = self.rng.normal(scale=size_rad, size=(len(joints), order))

    def joint_error(self, q):
        columns = [chebyshev.chebval((q[:, j] - CENTRE[j]) / self.half, self.coefficients[j]) for j in range(6)]
        return np.stack(columns, axis=1)

    def measured(self, poses, noise_m, more=lambda q: 0.0):
        """Data, with noise."""
        q = CENTRE + self.rng.uniform(-self.half, self.half, (poses, 6))
        p = self.real.reflector_poses(q + self.joint_error(q) + more(q))[:, :3, 3]
        return Measurements(q_rad=q, p_ME=p + self.rng.normal(scale=noise_m, size=p.shape))

    def mean_error_mm(self, model: CalibratedModel, more=lambda q: 0.0):
        """Against true positions in fresh poses."""
        fresh = self.measured(100, 0.0, more)
        return 1e3 * np.linalg.norm(model.predict(fresh.q_rad)[:, :3, 3] - fresh.p_ME, axis=1).mean()


# The form


@pytest.mark.parametrize("half_range_deg", [30, 90, 170, 400])
def test_each_is_the_chebyshev_polynomial_of_its_degree_over_the_measured_angles(ur5, half_range_deg):
    """Also where a joint was measured over more than a full turn."""
    h = np.radians(half_range_deg)
    q = np.random.default_rng(1).uniform(-h, h, (200, 6))
    theta = q[:, 2]
    term = polynomials_of(3, ur5, Context(q))
    lower, upper = term.constant("lower_rad"), term.constant("upper_rad")
    x = (2 * theta - lower - upper) / (upper - lower)
    columns = basis(EFFECT, term, ur5, Context(q))[:, 0]
    assert [p.name for p in term.parameters] == [f"chebyshev {d}" for d in range(1, 25)]
    for d in range(1, 25):
        np.testing.assert_allclose(columns[:, d - 1], chebyshev.chebval(x, np.eye(25)[d]), atol=1e-10)


def test_they_reach_a_little_beyond_the_measured_angles_the_less_the_more_poses_there_are(ur5):
    """Three mean gaps: a fresh pose may lie just outside, where the slope of a polynomial is steepest."""
    for poses in (100, 1000):
        q = np.random.default_rng(1).uniform(-1, 1, (poses, 6))
        term = polynomials_of(3, ur5, Context(q))
        beyond = [q[:, 2].min() - term.constant("lower_rad"), term.constant("upper_rad") - q[:, 2].max()]
        np.testing.assert_allclose(beyond, 3 * np.ptp(q[:, 2]) / poses, rtol=0.02)


def test_beyond_the_measured_angles_they_never_exceed_their_value_at_the_end_and_fade(ur5):
    q = np.random.default_rng(1).uniform(-1, 1, (200, 6))
    term = polynomials_of(3, ur5, Context(q))
    for beyond in np.radians([0.0, 1.0, 5.0, 9.0]):
        column = basis(EFFECT, term, ur5, Context(np.full((1, 6), term.constant("upper_rad") + beyond)))[0, 0]
        np.testing.assert_allclose(column, column[0], atol=1e-9)  # all are 1 at the end
        assert column[0] == pytest.approx(1.0) if beyond == 0 else 0 < column[0] < 1
    assert not basis(EFFECT, term, ur5, Context(np.full((1, 6), term.constant("upper_rad") + np.radians(10.1)))).any()


def test_few_distinct_angles_carry_no_high_degree(ur5):
    q = np.tile(np.linspace(-1, 1, 6)[:, None], (50, 6))
    assert len(polynomials_of(1, ur5, Context(q)).parameters) <= 10


def test_a_straight_line_is_offered_only_together_with_higher_degrees(ur5):
    """Alone it is the effect encoder_scale."""
    q = np.random.default_rng(1).uniform(-1, 1, (200, 6))
    groups = {p.name: p.group for p in polynomials_of(4, ur5, Context(q)).parameters}
    assert list(groups.values()).count(groups["chebyshev 1"]) > 3


def test_every_form_is_weighed_by_its_evidence_not_only_the_one_that_looks_best_at_first_sight(ur5):
    q = np.random.default_rng(1).uniform(-1, 1, (100, 6))
    assert len(EFFECT.alternatives(ur5, Context(q))) <= FEW_FORMS


@pytest.mark.parametrize("name", ["chebyshev", "chebyshev 0", "chebyshev 25", "chebyshev 2.5", "chebyshev -3"])
def test_a_polynomial_that_makes_no_sense_is_not_understood(name):
    assert not is_understood(term_from(0.0, 1.0, name))
    assert is_understood(term_from(0.0, 1.0, "chebyshev 1", "chebyshev 24", "half-wave 3"))


# The fit


@pytest.mark.parametrize(("half_range_deg", "order"), [(30, 10), (170, 6)])
def test_a_smooth_error_of_all_joints_is_learnt_to_a_third_of_the_noise(half_range_deg, order):
    """102 parameters from 3000 readings with 0.03 mm noise leave 0.03 mm sqrt(3 102 / 3000) = 0.0096 mm or so."""
    robot = SmoothRobot(1, np.radians(half_range_deg), order)
    fit = calibrate(robot.real.robot, robot.measured(1000, 3e-5), ["transmission_error"])
    assert robot.mean_error_mm(fit.model) < 0.015


def test_without_noise_a_smooth_error_is_learnt_to_micrometres():
    robot = SmoothRobot(3, np.radians(90), 10)
    fit = calibrate(robot.real.robot, robot.measured(1000, 0.0), ["transmission_error"])
    assert robot.mean_error_mm(fit.model) < 0.010


def test_a_smooth_error_and_a_wave_of_eight_cycles_are_both_learnt():
    def wave(q):
        return WAVES * np.sin(8 * q + np.arange(6))

    robot = SmoothRobot(2, np.radians(90))
    fit = calibrate(robot.real.robot, robot.measured(1000, 3e-5, wave), ["transmission_error"])
    assert robot.mean_error_mm(fit.model, wave) < 0.015


def test_the_error_of_one_joint_is_found_there_and_is_the_true_one():
    """But for a constant and a slope: an offset of the joint, and what the kinematics may imitate."""
    robot = SmoothRobot(4, np.radians(60), joints=[2])
    data = robot.measured(400, 3e-5)
    fit = calibrate(robot.real.robot, data, ["transmission_error"])
    assert {part.term.joint for part in fit.model.effects} == {3}
    theta = data.q_rad[:, 2]
    found, truth = joint_errors(robot.real.robot, Context(data.q_rad), fit.model.effects), robot.joint_error(data.q_rad)
    wrong = (found - truth)[:, 2]
    wrong -= np.polyval(np.polyfit(theta, wrong, 1), theta)
    assert wrong.std() < 0.05 * truth[:, 2].std()


# In words


def test_it_is_said_to_be_smooth_and_how_large_it_is(ur5):
    """T2 over uniform angles has a mean square of 7/15 and a mean of -1/3."""
    q = np.linspace(0, 1, 5001)[:, None] * np.ones(6)
    text = summary(
        FittedTerm(term_from(0.0, 1.0, "chebyshev 2", "chebyshev 3"), np.array([1e-4, 0.0]), np.zeros(2)),
        Context(q),
        ur5,
    )
    size = re.fullmatch(r"joint 2: ([\d.]+) µrad rms, smooth over the measured range", text)
    assert size
    assert float(size[1]) == pytest.approx(100 * np.sqrt(7 / 15 - 1 / 9), rel=0.01)


def test_waves_on_top_of_a_smooth_error_are_said_too(ur5):
    """Half-wave 8 over half a turn is 8 cycles a turn."""
    q = np.random.default_rng(0).uniform(0, np.pi, (500, 6))
    fitted = FittedTerm(term_from(0.0, np.pi, "chebyshev 2", "half-wave 8"), np.array([1e-4, 1e-4]), np.zeros(2))
    assert summary(fitted, Context(q), ur5).endswith("rms, smooth over the measured range, and 8 cycles per turn")


def test_what_was_learnt_is_the_turn_of_the_joint(ur5):
    q = np.random.default_rng(0).uniform(0, 1, (50, 6))
    fitted = FittedTerm(term_from(0.0, 1.0, "chebyshev 3"), np.array([2e-4]))
    expected = 2e-4 * chebyshev.chebval(2 * q[:, 1] - 1, [0, 0, 0, 1])
    np.testing.assert_allclose(joint_errors(ur5, Context(q), [fitted])[:, 1], expected, atol=1e-15)
