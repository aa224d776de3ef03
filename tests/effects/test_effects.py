"""The interface of an effect, and the vocabulary."""

import numpy as np
import pytest
from truepath.effects import EFFECTS, context_of, effect_named, is_understood, joint_errors
from truepath.effects.base import FADE_RAD, EffectParameter, FittedTerm, Term, basis, fade
from truepath.errors import InputError

VOCABULARY = {
    "transmission_error", "joint_compliance", "backlash", "encoder_scale", "thermal_expansion", "warmup_drift",
    "frame_drift", "tool_shift", "measurement_scale", "axis_wobble",
}  # fmt: skip


@pytest.fixture(scope="module")
def joints():
    return np.random.default_rng(0).uniform(-3, 3, (200, 6))


def test_every_effect_bears_a_name_of_the_vocabulary_and_says_cause_and_remedy():
    assert EFFECTS.keys() <= VOCABULARY
    for name, effect in EFFECTS.items():
        assert effect.name == name
        assert len(effect.cause) > 20
        assert len(effect.remedy) > 20


def test_an_unknown_effect_is_refused_with_the_list_of_those_there_are():
    with pytest.raises(InputError, match="transmission_error"):
        effect_named("gremlins")


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_the_basis_is_the_derivative_of_the_joint_error(name, ur5, joints):
    for term in EFFECTS[name].terms(ur5, joints):
        columns = basis(EFFECTS[name], term, joints, context_of(ur5, joints, [term], 0.0))
        values = np.random.default_rng(1).normal(scale=1e-5, size=len(term.parameters))
        errors = joint_errors(ur5, joints, [FittedTerm(term, values)])
        assert np.allclose(errors[:, term.joint - 1], columns @ values)
        assert not np.delete(errors, term.joint - 1, axis=1).any()


def test_waves_over_a_full_turn_are_sines_and_cosines(ur5, joints):
    (term,) = (t for t in EFFECTS["transmission_error"].terms(ur5, joints) if t.joint == 3)
    columns = basis(EFFECTS["transmission_error"], term, joints, {})
    names = [parameter.name for parameter in term.parameters]
    assert np.allclose(columns[:, names.index("cos 7")], np.cos(7 * joints[:, 2]))
    assert np.allclose(columns[:, names.index("sin 2")], np.sin(2 * joints[:, 2]))


def test_waves_over_part_of_a_turn_are_half_waves_that_fit_it(ur5):
    q = np.tile(np.linspace(0.2, 1.4, 100)[:, None], (1, 6))
    term = EFFECTS["transmission_error"].terms(ur5, q)[0]
    columns = basis(EFFECTS["transmission_error"], term, q, {})
    assert np.allclose(columns[:, 0], np.cos(np.pi * (q[:, 0] - 0.2) / 1.2))
    assert len(term.parameters) < 100 / 2


def test_a_joint_that_hardly_moved_tells_nothing_of_its_transmission(ur5, joints):
    still = joints.copy()
    still[:, 4] = 0.3
    assert {term.joint for term in EFFECTS["transmission_error"].terms(ur5, still)} == {1, 2, 3, 4, 6}


def test_a_vertical_joint_axis_tells_nothing_of_its_compliance(ur5, joints):
    assert 1 not in {term.joint for term in EFFECTS["joint_compliance"].terms(ur5, joints)}


def test_compliance_follows_the_payload(ur5, joints):
    (term,) = (t for t in EFFECTS["joint_compliance"].terms(ur5, joints) if t.joint == 2)
    soft = [FittedTerm(term, np.array([1e-5]))]
    heavier = joint_errors(ur5, joints, soft, payload_kg=5.0) - joint_errors(ur5, joints, soft)
    assert np.allclose(heavier[:, 1], 1e-5 * (ur5.gravity_torque(joints, 5.0) - ur5.gravity_torque(joints))[:, 1])


def test_beyond_the_data_an_effect_fades_to_nothing_without_a_kink():
    theta = np.linspace(-1.0, 2.0, 3001)
    weight = fade(theta, 0.0, 1.0)
    assert np.all(weight[(theta >= 0) & (theta <= 1)] == 1.0)
    assert np.all(weight[(theta < -FADE_RAD) | (theta > 1 + FADE_RAD)] == 0.0)
    assert np.abs(np.diff(weight, 2)).max() < 1e-3


def test_parameters_from_a_file_that_make_no_sense_are_not_understood():
    for name in ("cos", "tan 3", "cos 3.5", "__import__ 1", "", "half-wave x"):
        term = Term("transmission_error", 1, 0.0, 1.0, (EffectParameter(name, "rad", 0.0, ""),))
        assert not is_understood(term)
    term = Term("transmission_error", 1, 0.0, 1.0, (EffectParameter("cos 3", "rad", 0.0, ""),))
    assert is_understood(term)
