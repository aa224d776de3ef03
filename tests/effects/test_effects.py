"""The interface of an effect, and the vocabulary."""

import numpy as np
import pytest
from truepath.context import Context
from truepath.effects import CAUSES, EFFECTS, effect_named, effect_of, is_understood, joint_errors, motions, probe_shift
from truepath.effects.base import EffectParameter, FittedTerm, Term, basis, probe_columns
from truepath.effects.readings import is_reading
from truepath.errors import InputError
from truepath.motions import COMPONENTS, OF_ONE_JOINT, ChainPoses, Moves
from truepath.nameless import NAMELESS
from truepath.region import FADE_RAD, fade

VOCABULARY = {
    "transmission_error", "joint_compliance", "backlash", "encoder_scale", "thermal_expansion", "warmup_drift",
    "frame_drift", "tool_shift", "measurement_scale", "axis_wobble", "outlier",
}  # fmt: skip
POSES = 200


@pytest.fixture(scope="module")
def context():
    """A campaign of which everything was recorded."""
    rng = np.random.default_rng(0)
    return Context(
        q_rad=rng.uniform(-3, 3, (POSES, 6)),
        payload_kg=rng.uniform(0, 2, POSES),
        time_s=np.sort(rng.uniform(100.0, 4000.0, POSES)),
        row=np.arange(POSES) + 2.0,
        temperature_c=20.0 + 5.0 * rng.random(POSES),
        approach=rng.choice([-1.0, 1.0], (POSES, 6)),
    )


@pytest.fixture(scope="module")
def chain(ur5, context):
    return ChainPoses.of(ur5, np.zeros(36), context.q_rad, np.eye(4), np.eye(4))


def every_form(effect, robot, context):
    """All terms of all its forms."""
    return [term for form in effect.alternatives(robot, context) for term in form]


# The vocabulary


def test_there_is_a_cause_for_every_name_of_the_vocabulary_and_no_other():
    assert set(CAUSES) == VOCABULARY
    assert set(EFFECTS) == VOCABULARY - {"outlier"}


@pytest.mark.parametrize("name", sorted(VOCABULARY))
def test_every_cause_says_in_plain_words_why_it_happens_and_what_to_do(name):
    cause = CAUSES[name]
    assert cause.name == name
    for sentence in (cause.cause, cause.remedy):
        assert len(sentence) > 20
        assert "_" not in sentence


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_every_effect_says_how_large_it_usually_is_and_which_columns_it_needs(name):
    effect = EFFECTS[name]
    assert any(digit in effect.plausible for digit in "0123456789")
    assert set(effect.needs) <= {"t_s", "temperature_c"}
    assert effect.driver in ("pose", "time", "temperature")


def test_an_unknown_effect_is_refused_with_the_list_of_those_there_are():
    with pytest.raises(InputError, match="transmission_error") as caught:
        effect_named("gremlins")
    assert all(name in caught.value.expected for name in EFFECTS)


def test_nobody_can_ask_for_outliers_to_be_fitted():
    with pytest.raises(InputError, match="unknown effect 'outlier'"):
        effect_named("outlier")


def test_a_term_knows_whose_it_is_be_it_named_or_nameless(ur5, context):
    for known in (EFFECTS, NAMELESS):
        for effect in known.values():
            assert all(effect_of(term) is effect for term in effect.terms(ur5, context))


@pytest.mark.parametrize(("name", "column"), [("thermal_expansion", "temperature_c"), ("warmup_drift", "t_s")])
def test_an_effect_names_the_column_that_nobody_recorded(name, column, ur5, context):
    bare = Context(context.q_rad)
    assert EFFECTS[name].missing(bare) == (column,)
    assert EFFECTS[name].terms(ur5, bare) == []
    assert EFFECTS[name].missing(context) == ()


# What every effect has in common


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_every_term_makes_sense_for_its_robot(name, ur5, context):
    terms = every_form(EFFECTS[name], ur5, context)
    assert terms
    for term in terms:
        assert term.effect == name
        assert term.fits(6)
        assert is_understood(term)
        assert (term.joint is not None) == (term.moves in OF_ONE_JOINT)
        assert all(is_reading(reading, 6) for reading in term.inputs)


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_parameters_bear_names_of_their_own_units_and_sizes_that_a_robot_may_have(name, ur5, context):
    for term in EFFECTS[name].terms(ur5, context):
        names = [parameter.name for parameter in term.parameters]
        assert len(set(names)) == len(names)
        for parameter in term.parameters:
            assert parameter.unit in ("rad", "m", "rad/(N m)", "rad/rad", "m/m", "1/K")
            assert 1e-7 < parameter.prior_scale < 1e-2
            assert parameter.group


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_the_basis_is_the_derivative_of_the_motion(name, ur5, context, chain):
    """What a fitted term does is its basis times its values: to the joint that it turns, or to the probe."""
    for term in EFFECTS[name].terms(ur5, context):
        columns = basis(EFFECTS[name], term, ur5, context)
        assert columns.shape == (POSES, len(COMPONENTS[term.moves]), len(term.parameters))
        values = np.random.default_rng(1).normal(scale=1e-5, size=len(term.parameters))
        fitted = FittedTerm(term, values)
        np.testing.assert_allclose(motions(ur5, context, fitted), columns @ values, atol=1e-18)
        errors = joint_errors(ur5, context, [fitted])
        if term.moves is Moves.JOINT:
            np.testing.assert_allclose(errors[:, term.joint - 1], columns[:, 0] @ values, atol=1e-18)
            errors = np.delete(errors, term.joint - 1, axis=1)
        assert not errors.any()
        expected = probe_columns(term, columns, chain) @ values
        np.testing.assert_allclose(probe_shift(ur5, context, [fitted], chain, [term.moves]), expected, atol=1e-18)


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_only_the_kinds_of_motion_that_are_asked_for_move_the_probe(name, ur5, context, chain):
    for term in EFFECTS[name].terms(ur5, context):
        others = [kind for kind in Moves if kind is not term.moves]
        fitted = FittedTerm(term, np.ones(len(term.parameters)))
        assert not probe_shift(ur5, context, [fitted], chain, others).any()


@pytest.mark.parametrize("name", sorted(set(EFFECTS) - {"measurement_scale"}))
def test_a_robot_that_was_never_moved_tells_nothing(name, ur5):
    still = Context(
        np.full((POSES, 6), 0.3),
        time_s=np.zeros(POSES),
        temperature_c=np.full(POSES, 20.0),
        approach=np.ones((POSES, 6)),
    )
    assert every_form(EFFECTS[name], ur5, still) == []


def test_each_term_of_a_joint_effect_stands_for_a_joint_of_its_own(ur5, context):
    for effect in EFFECTS.values():
        places = [(term.moves, term.joint) for term in effect.terms(ur5, context)]
        assert len(set(places)) == len(places)


# Where the data ends


def test_beyond_the_data_an_effect_fades_to_nothing_without_a_kink():
    theta = np.linspace(-1.0, 2.0, 3001)
    weight = fade(theta, 0.0, 1.0)
    assert np.all(weight[(theta >= 0) & (theta <= 1)] == 1.0)
    assert np.all(weight[(theta < -FADE_RAD) | (theta > 1 + FADE_RAD)] == 0.0)
    assert np.abs(np.diff(weight, 2)).max() < 1e-3


@pytest.mark.parametrize("name", ["transmission_error", "joint_compliance", "encoder_scale", "axis_wobble", "backlash"])
def test_an_effect_of_a_joint_is_silent_at_angles_that_nobody_measured(name, ur5):
    q = np.random.default_rng(2).uniform(-1, 1, (POSES, 6))
    beyond = Context(np.full((3, 6), 1.0 + FADE_RAD + 0.01))
    terms = EFFECTS[name].terms(ur5, Context(q))
    assert terms
    for term in terms:
        assert not basis(EFFECTS[name], term, ur5, beyond).any()
        assert basis(EFFECTS[name], term, ur5, Context(q)).any()


# Terms that come from a file


@pytest.mark.parametrize("name", ["cos", "tan 3", "cos 3.5", "__import__ 1", "", "half-wave x"])
def test_a_wave_that_makes_no_sense_is_not_understood(name):
    constants = (("lower_rad", 0.0), ("upper_rad", 1.0))
    term = Term("transmission_error", Moves.JOINT, 1, ("theta",), constants, (EffectParameter(name, "rad", 0.0, ""),))
    assert not is_understood(term)
    assert is_understood(term.with_parameters((EffectParameter("cos 3", "rad", 0.0, ""),)))


@pytest.mark.parametrize(
    ("moves", "joint", "inputs"),
    [
        (Moves.JOINT, None, ("theta",)),
        (Moves.JOINT, 0, ("theta",)),
        (Moves.JOINT, 7, ("theta",)),
        (Moves.AXIS, None, ("theta",)),
        (Moves.BASE, 1, ("time_s",)),
        (Moves.PROBE, 1, ()),
        (Moves.BASE, None, ("theta",)),
        (Moves.MEASURED_LENGTHS, None, ("approach",)),
        (Moves.JOINT, 1, ("q7",)),
        (Moves.JOINT, 1, ("phase_of_the_moon",)),
    ],
    ids=str,
)
def test_a_term_at_a_place_or_of_a_reading_that_there_is_not_does_not_fit(moves, joint, inputs):
    assert not Term("any", moves, joint, inputs, (), ()).fits(6)
