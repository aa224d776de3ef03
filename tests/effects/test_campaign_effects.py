"""Effects of time and temperature: creep, drift, slips and growth, each against its formula written here again."""

import numpy as np
import pytest
from numpy.polynomial import legendre
from truepath.context import Context
from truepath.effects import EFFECTS
from truepath.effects.base import basis
from truepath.motions import Moves

POSES = 120
START, END = 50.0, 3650.0
SIX = ("x", "y", "z", "rx", "ry", "rz")


@pytest.fixture(scope="module")
def campaign():
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(START, END, POSES))
    time[[0, -1]] = START, END
    return Context(
        q_rad=rng.uniform(-3, 3, (POSES, 6)),
        time_s=time,
        row=np.arange(POSES) + 2.0,
        temperature_c=20.0 + 4.0 * rng.random(POSES),
    )


@pytest.fixture(scope="module")
def later():
    """Ten poses of tomorrow, of which nothing is known but the joints."""
    return Context(np.random.default_rng(1).uniform(-3, 3, (10, 6)))


def forms(name, robot, context):
    return EFFECTS[name].alternatives(robot, context)


def columns(term, robot, context):
    return basis(EFFECTS[term.effect], term, robot, context)


def steps(robot, context, name="frame_drift"):
    """The forms with one moment."""
    return [form[0] for form in forms(name, robot, context) if "moment" in dict(form[0].constants)]


def at(context, **changes):
    """Two poses, at other moments or temperatures."""
    return Context(context.q_rad[:2], **{name: np.array(values) for name, values in changes.items()})


# warmup_drift


def test_joints_and_lengths_creep_exponentially_towards_where_they_stay(ur5, campaign):
    time = campaign.time_s
    for form in forms("warmup_drift", ur5, campaign):
        tau = form[0].constant("tau_s")
        expected = 1.0 - np.exp(-(time - START) / tau)
        assert [(term.moves, term.joint) for term in form] == [
            *((Moves.JOINT, joint) for joint in range(1, 7)),
            (Moves.ROBOT_LENGTHS, None),
        ]
        for term in form:
            np.testing.assert_allclose(columns(term, ur5, campaign)[:, 0, 0], expected, rtol=1e-12)


def test_time_constants_from_minutes_to_longer_than_the_campaign_are_tried_then_finer_ones_about_the_best(
    ur5, campaign
):
    taus = [form[0].constant("tau_s") for form in forms("warmup_drift", ur5, campaign)]
    assert min(taus) < 0.05 * (END - START)
    assert max(taus) > 1.4 * (END - START)
    best = forms("warmup_drift", ur5, campaign)[3]
    finer = [form[0].constant("tau_s") for form in EFFECTS["warmup_drift"].refined(best, ur5, campaign)]
    assert taus[2] < min(finer) < taus[3] < max(finer) < taus[4]


def test_a_program_of_today_finds_the_robot_as_warm_as_it_was_last(ur5, campaign, later):
    for term in forms("warmup_drift", ur5, campaign)[0]:
        last = columns(term, ur5, campaign)[-1, 0, 0]
        np.testing.assert_allclose(columns(term, ur5, later)[:, 0, 0], last)


def test_nobody_extrapolates_a_creep_beyond_the_campaign(ur5, campaign):
    term = forms("warmup_drift", ur5, campaign)[-1][0]
    before, after = columns(term, ur5, at(campaign, time_s=[START - 1e4, END + 1e6]))[:, 0, 0]
    assert before == 0.0
    assert after == columns(term, ur5, campaign)[-1, 0, 0]


# frame_drift


def test_the_base_drifts_slowly_by_legendre_polynomials_of_time(ur5, campaign):
    (slow,) = forms("frame_drift", ur5, campaign)[0]
    u = 2.0 * (campaign.time_s - START) / (END - START) - 1.0
    names = [parameter.name for parameter in slow.parameters]
    found = columns(slow, ur5, campaign)
    assert slow.moves is Moves.BASE
    assert names == [f"{component} order {k}" for k in range(1, 7) for component in SIX]
    for j, name in enumerate(names):
        component, order = name.split(" order ")
        expected = np.zeros((POSES, 6))
        expected[:, SIX.index(component)] = legendre.legval(u, np.eye(7)[int(order)])
        np.testing.assert_allclose(found[:, :, j], expected, atol=1e-12)


def test_a_drift_does_not_move_the_mean_place_of_the_base(ur5):
    even = Context(np.zeros((2001, 6)), time_s=np.linspace(START, END, 2001))
    for term in (forms("frame_drift", ur5, even)[0][0], *steps(ur5, even)):
        assert np.abs(columns(term, ur5, even).mean(axis=0)).max() < 2e-3


def test_the_base_jumps_by_one_at_the_moment_and_never_else(ur5, campaign):
    for term in steps(ur5, campaign):
        found = columns(term, ur5, campaign)
        after = campaign.time_s > term.constant("moment")
        for k in range(6):
            assert np.ptp(found[after][:, k, k]) == np.ptp(found[~after][:, k, k]) == 0.0
            assert found[after][0, k, k] - found[~after][0, k, k] == pytest.approx(1.0)
        off_diagonal = found[:, ~np.eye(6, dtype=bool)]
        assert not off_diagonal.any()


def test_without_a_clock_the_base_stands_where_it_was_on_average(ur5, campaign, later):
    for term in (forms("frame_drift", ur5, campaign)[0][0], *steps(ur5, campaign)):
        assert not columns(term, ur5, later).any()


def test_after_the_campaign_a_slow_drift_has_come_to_rest(ur5, campaign):
    (slow,) = forms("frame_drift", ur5, campaign)[0]
    found = columns(slow, ur5, at(campaign, time_s=[END, END + 1e6]))
    np.testing.assert_allclose(found[1], found[0])


@pytest.mark.parametrize("name", ["frame_drift", "tool_shift"])
def test_where_no_time_was_recorded_the_order_of_measurement_is_the_clock(name, ur5, campaign):
    untimed = Context(campaign.q_rad, row=campaign.row)
    for (term,) in forms(name, ur5, untimed):
        assert term.inputs == ("row",)
        assert columns(term, ur5, untimed).any()


@pytest.mark.parametrize("name", ["frame_drift", "tool_shift"])
def test_every_moment_between_two_poses_can_be_found_and_both_sides_keep_some_poses(name, ur5, campaign):
    effect, time = EFFECTS[name], campaign.time_s
    reached = set()
    for term in steps(ur5, campaign, name):
        reached |= {fine[0].constant("moment") for fine in effect.refined([term], ur5, campaign)}
    every = 0.5 * (time[1:] + time[:-1])
    assert min(np.sum(time < min(reached)), np.sum(time > max(reached))) >= 3
    inner = every[(every > min(reached)) & (every < max(reached))]
    assert set(np.round(inner, 9)) <= set(np.round(sorted(reached), 9))


def test_a_campaign_in_which_the_clock_stood_still_knows_of_no_drift(ur5, campaign):
    stopped = Context(campaign.q_rad, time_s=np.full(POSES, 7.0), row=campaign.row)
    for name in ("frame_drift", "tool_shift", "warmup_drift"):
        for form in forms(name, ur5, stopped):
            assert all(np.isfinite(columns(term, ur5, stopped)).all() for term in form)


# tool_shift


def test_the_probe_sits_elsewhere_after_the_moment_and_where_it_was_before(ur5, campaign):
    for term in steps(ur5, campaign, "tool_shift"):
        found = columns(term, ur5, campaign)
        after = campaign.time_s > term.constant("moment")
        assert term.moves is Moves.PROBE
        np.testing.assert_array_equal(found[after], np.broadcast_to(np.eye(6), (after.sum(), 6, 6)))
        assert not found[~after].any()


def test_a_program_of_today_is_run_with_the_probe_where_it_slipped_to(ur5, campaign, later):
    for context in (campaign, Context(campaign.q_rad, row=campaign.row)):
        for term in steps(ur5, context, "tool_shift"):
            np.testing.assert_array_equal(columns(term, ur5, later), np.broadcast_to(np.eye(6), (10, 6, 6)))


# thermal_expansion


def test_lengths_grow_in_proportion_to_the_difference_from_the_mean_temperature(ur5, campaign):
    (term,) = EFFECTS["thermal_expansion"].terms(ur5, campaign)
    expected = campaign.temperature_c - campaign.temperature_c.mean()
    assert term.moves is Moves.ROBOT_LENGTHS
    np.testing.assert_allclose(columns(term, ur5, campaign)[:, 0, 0], expected, atol=1e-12)
    np.testing.assert_allclose(columns(term, ur5, at(campaign, temperature_c=[30.0, 31.0]))[1] - 1.0,
                               columns(term, ur5, at(campaign, temperature_c=[30.0, 31.0]))[0])  # fmt: skip


def test_where_nobody_knows_the_temperature_it_is_the_mean_of_the_campaign(ur5, campaign, later):
    (term,) = EFFECTS["thermal_expansion"].terms(ur5, campaign)
    np.testing.assert_allclose(columns(term, ur5, later), 0.0, atol=1e-12)


def test_at_a_constant_temperature_there_is_nothing_to_learn_of_growth(ur5, campaign):
    constant = Context(campaign.q_rad, temperature_c=np.full(POSES, 23.4))
    assert EFFECTS["thermal_expansion"].terms(ur5, constant) == []


# measurement_scale


def test_a_wrong_metre_stretches_all_readings_alike(ur5, campaign):
    (term,) = EFFECTS["measurement_scale"].terms(ur5, campaign)
    assert (term.moves, term.joint, term.inputs) == (Moves.MEASURED_LENGTHS, None, ())
    np.testing.assert_array_equal(columns(term, ur5, campaign), np.ones((POSES, 1, 1)))
