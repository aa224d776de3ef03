"""The parameters of several terms in a row: which column is whose, and what goes when some are left out."""

import numpy as np
import pytest
from truepath.context import Context
from truepath.effects import EFFECTS
from truepath.effects.base import basis
from truepath.evidence import LinearProblem, infer
from truepath.motions import ChainPoses, Moves
from truepath.term_set import TermSet

POSES = 80


@pytest.fixture(scope="module")
def context():
    rng = np.random.default_rng(0)
    return Context(rng.uniform(-3, 3, (POSES, 6)), time_s=np.arange(POSES) * 10.0)


@pytest.fixture(scope="module")
def chain(ur5, context):
    return ChainPoses.of(ur5, np.zeros(36), context.q_rad, np.eye(4), np.eye(4))


@pytest.fixture(scope="module")
def terms(ur5, context):
    """A joint with waves, another with its scale, an axis that wobbles, a base that drifts."""

    def of(name, joint):
        (term,) = (term for term in EFFECTS[name].terms(ur5, context) if term.joint == joint)
        return term

    return (of("transmission_error", 3), of("encoder_scale", 5), of("axis_wobble", 2), of("frame_drift", None))


@pytest.fixture(scope="module")
def whole(ur5, context, terms):
    return TermSet.of(ur5, context, terms)


def test_parameters_stand_in_a_row_term_by_term(whole, terms):
    counts = [len(term.parameters) for term in terms]
    assert len(whole) == sum(counts)
    np.testing.assert_array_equal(whole.term, np.repeat(np.arange(4), counts))
    assert whole.effects == ("transmission_error", "encoder_scale", "axis_wobble", "frame_drift")
    assert whole.of_effect("encoder_scale").sum() == 1


def test_parameters_share_a_group_where_term_and_label_are_the_same_and_nowhere_else(whole, terms):
    labels = [(t, p.group) for t, term in enumerate(terms) for p in term.parameters]
    for number in range(len(whole.plausible)):
        assert len({label for label, group in zip(labels, whole.group, strict=True) if group == number}) == 1
    assert len(whole.plausible) == len(set(labels))


def test_a_group_is_as_large_as_its_parameters_usually_are(whole, terms):
    scales = [p.prior_scale for term in terms for p in term.parameters]
    np.testing.assert_array_equal(whole.plausible[whole.group], scales)


def test_columns_are_what_each_parameter_does_to_the_probe(whole, terms, ur5, context, chain):
    columns = whole.columns(chain, 6)
    assert columns.shape == (POSES, 6, len(whole))
    for t, term in enumerate(terms):
        motion = basis(EFFECTS[term.effect], term, ur5, context)
        moved = np.einsum("kic,kcj->kij", chain.displacement(term.moves, term.joint), motion)
        np.testing.assert_allclose(columns[:, :, whole.term == t], moved, atol=1e-12)
    np.testing.assert_array_equal(whole.columns(chain, 3), columns[:, :3])


def test_joints_stand_off_by_the_terms_that_turn_them_alone(whole, terms, ur5, context):
    values = np.random.default_rng(1).normal(scale=1e-4, size=len(whole))
    error = whole.joint_error(values, POSES, 6)
    for t, joint in ((0, 3), (1, 5)):
        motion = basis(EFFECTS[terms[t].effect], terms[t], ur5, context)[:, 0]
        np.testing.assert_allclose(error[:, joint - 1], motion @ values[whole.term == t], atol=1e-15)
    assert not error[:, [0, 1, 3, 5]].any()
    expected = [terms[t].moves is not Moves.JOINT for t in whole.term]
    np.testing.assert_array_equal(whole.moves_no_joint(), expected)


def test_left_out_parameters_take_their_terms_along_when_none_is_left(whole, chain):
    keep = np.random.default_rng(2).random(len(whole)) < 0.5
    keep[whole.term == 1] = False
    fewer = whole.only(keep)
    assert fewer.effects == ("transmission_error", "axis_wobble", "frame_drift")
    assert len(fewer) == keep.sum()
    np.testing.assert_array_equal(fewer.columns(chain, 3), whole.columns(chain, 3)[:, :, keep])
    assert [p.name for term in fewer.terms for p in term.parameters] == [
        p.name for p, kept in zip((p for term in whole.terms for p in term.parameters), keep, strict=True) if kept
    ]


def test_nothing_is_left_of_nothing(whole, chain, ur5, context):
    for empty in (whole.only(np.zeros(len(whole), bool)), TermSet.of(ur5, context, ())):
        assert len(empty) == 0
        assert empty.terms == ()
        assert empty.columns(chain, 3).shape == (POSES, 3, 0)
        assert empty.joint_error(np.zeros(0), POSES, 6).shape == (POSES, 6)
        assert empty.fitted(np.zeros(0), np.zeros(0)) == ()


def test_some_of_the_poses_have_their_own_rows(whole, chain):
    rows = np.array([5, 2, 60])
    own = whole.rows(rows).columns(chain.subset(rows), 3)
    np.testing.assert_array_equal(own, whole.columns(chain, 3)[rows])


def test_every_term_gets_its_own_values_and_deviations_back(whole):
    values, sigma = np.arange(len(whole)) * 1.0, np.arange(len(whole)) * 0.1
    fitted = whole.fitted(values, sigma)
    assert [part.term for part in fitted] == list(whole.terms)
    np.testing.assert_array_equal(np.concatenate([part.values for part in fitted]), values)
    np.testing.assert_array_equal(np.concatenate([part.sigma for part in fitted]), sigma)


def test_what_the_data_speaks_for_stays_and_the_rest_goes_in_the_end(whole, chain):
    """Readings made by one wave of joint 3, 300 times the noise, and nothing else."""
    columns, noise = whole.columns(chain, 3), 1e-6
    names = [p.name for p in whole.terms[0].parameters]
    wave = columns[:, :, names.index("cos 2")] * 3e-4
    y = wave + np.random.default_rng(3).normal(scale=noise, size=wave.shape)
    left = whole
    while True:
        problem = LinearProblem.of(left.columns(chain, 3), y)
        posterior = infer(problem, left.group, left.plausible, np.ones(len(left)), [1e-5])
        keep = left.spoken_for(posterior)
        if keep.all():
            break
        left = left.only(keep)
    assert [(term.effect, term.joint) for term in left.terms] == [("transmission_error", 3)]
    assert "cos 2" in {p.name for p in left.terms[0].parameters}
    assert posterior.sigma[0] == pytest.approx(noise, rel=0.15)


def test_only_one_group_of_a_term_goes_at_a_time_because_groups_stand_in_for_each_other(whole, chain):
    y = np.random.default_rng(4).normal(scale=1e-6, size=(POSES, 3))
    posterior = infer(
        LinearProblem.of(whole.columns(chain, 3), y), whole.group, whole.plausible, np.ones(len(whole)), [1e-6]
    )
    keep = whole.spoken_for(posterior)
    for t in range(len(whole.terms)):
        assert len(np.unique(whole.group[(whole.term == t) & ~keep])) == 1
