"""What another effect would add to a model: much if it is there, nothing if it is not, nothing twice."""

import numpy as np
import pytest
from hidden import Hidden, soft
from truepath.calibrate import fit_kinematics
from truepath.contest import LEAST_LOG_ODDS
from truepath.effect_fit import fit_effects
from truepath.effects import EFFECTS
from truepath.search import Search
from truepath.term_set import TermSet


@pytest.fixture(scope="module")
def search(real_ur5, clean_kinematic):
    """Of a robot that has nothing but wrong geometry."""
    fit = clean_kinematic.fit
    return Search(fit, clean_kinematic.context, fit_effects(fit, clean_kinematic.context, ()))


@pytest.fixture(scope="module")
def softened(real_ur5):
    """Of a robot whose joint 2 is soft."""
    kinematic = fit_kinematics(real_ur5.robot, Hidden(real_ur5, soft(real_ur5, 2, 1.2e-5)).measured(200, 14))
    return Search(kinematic.fit, kinematic.context, fit_effects(kinematic.fit, kinematic.context, ()))


def test_an_effect_that_is_not_there_is_not_worth_its_parameters(search):
    for effect in EFFECTS.values():
        assert search.trial(effect).gain < LEAST_LOG_ODDS


def test_an_effect_that_is_there_is_worth_more_than_any_other(softened):
    gains = {name: softened.trial(each).gain for name, each in EFFECTS.items() if not each.missing(softened.seen)}
    assert max(gains, key=gains.get) == "joint_compliance"
    assert gains["joint_compliance"] > LEAST_LOG_ODDS


def test_a_trial_names_the_joint_that_has_it_and_not_all_six(softened):
    trial = softened.trial(EFFECTS["joint_compliance"])
    assert [(term.effect, term.joint) for term in trial.terms] == [("joint_compliance", 2)]


def of_joint(name, joint, search):
    (term,) = (t for t in EFFECTS[name].terms(search.kinematic.problem.robot, search.seen) if t.joint == joint)
    return term


def test_what_a_term_explains_is_the_drop_of_chi_square_of_a_fit_with_it(softened):
    """Two least-squares fits, kinematics with and without the term, written out."""
    term = of_joint("joint_compliance", 2, softened)
    robot, sigma = softened.kinematic.problem.robot, softened.fit.sigma
    residual, J = softened.kinematic.problem.evaluate(softened.fit.p)
    rows = softened.fit.inlier
    y = (-residual[rows] / sigma).ravel()
    J = (J[rows][:, :, softened.kinematic.free] / sigma[:, None]).reshape(len(y), -1)
    A = TermSet.of(robot, softened.seen, [term]).columns(softened.chain, 3) / sigma[:, None]

    def chi2(X):
        scaled = X / np.linalg.norm(X, axis=0)
        return np.sum((y - scaled @ np.linalg.lstsq(scaled, y, rcond=None)[0]) ** 2)

    drop = chi2(J) - chi2(np.concatenate([J, A.reshape(len(y), -1)], axis=1))
    assert drop > 100
    assert softened.explained([term]) == pytest.approx(drop - 1, rel=1e-3)


def test_a_term_in_the_model_can_be_left_to_be_found_anew(softened):
    term = of_joint("joint_compliance", 2, softened)
    full = Search(softened.kinematic, softened.context, fit_effects(softened.kinematic, softened.context, [term]))
    assert full.trial(EFFECTS["joint_compliance"]).gain < LEAST_LOG_ODDS
    full.look(without=[term])
    found_anew = full.gain_of([term])
    full.look()
    assert found_anew > LEAST_LOG_ODDS
    assert full.explained([of_joint("joint_compliance", 3, full)]) < 20


def test_parameters_that_are_in_the_model_already_are_not_offered_again(search, real_ur5):
    terms = EFFECTS["transmission_error"].terms(real_ur5.robot, search.seen)

    def offered(model, *some):
        return model.offered(model.of_all(some))

    assert {term.joint for term in offered(search, *terms).terms} == {1, 2, 3, 4, 5, 6}
    few = terms[0].with_parameters(terms[0].parameters[:4])
    fit = fit_effects(search.kinematic, search.context, [few], prune=False)
    later = Search(search.kinematic, search.context, fit)
    assert offered(later, terms[0]).terms[0].parameters == terms[0].parameters[4:]
    assert len(offered(later, few)) == 0
