"""The next campaign: what the data knows already is not asked again, what it does not know is."""

import numpy as np
import pytest
from truepath.calibrate import calibrate, fit_kinematics
from truepath.choose import choose
from truepath.measurements import Measurements
from truepath.planning.design import Wish
from truepath.planning.improve import plan_improvement
from truepath.planning.knowledge import Knowledge
from truepath.virtual.simulate import Campaign, measure


@pytest.fixture(scope="module")
def stiff_wrist(real_ur5, without_a_cell):
    """40 poses in which joints 5 and 6 hardly turned."""
    q = without_a_cell.draw(40, np.random.default_rng(0))
    q[:, 4:] = 0.15 * q[:, 4:] + 0.4
    return measure(real_ur5, q, Campaign(40, 0.02, seed=5))


@pytest.fixture(scope="module")
def improvement(stiff_wrist, without_a_cell):
    return plan_improvement(without_a_cell, stiff_wrist, [], Wish(12, 1), candidates=200)


def test_the_knowledge_of_a_data_set_is_the_covariance_of_its_calibration(stiff_wrist, real_ur5):
    kinematic = fit_kinematics(real_ur5.robot, stiff_wrist)
    knowledge = Knowledge.of(kinematic, choose(kinematic.fit, kinematic.context, [], nameless=False).fit, ())
    widths = knowledge.model.widths
    covariance = np.linalg.inv(knowledge.information + np.eye(len(widths))) * np.outer(widths, widths)
    fit = calibrate(real_ur5.robot, stiff_wrist)
    free = [k for k in range(len(fit.names)) if k not in fit.held]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), fit.sigma[free], rtol=0.02)


def test_the_joints_that_hardly_turned_are_turned(improvement, stiff_wrist):
    q = improvement.plan.poses.q_rad[improvement.plan.poses.measure]
    assert len(q) == 12
    assert (np.ptp(q[:, 4:], axis=0) > 2.0 * np.ptp(stiff_wrist.q_rad[:, 4:], axis=0)).all()


def test_a_second_calibration_with_the_new_poses_is_as_certain_as_was_promised(improvement, stiff_wrist, real_ur5):
    q = improvement.plan.poses.q_rad[improvement.plan.poses.measure]
    more = measure(real_ur5, q, Campaign(12, 0.02, seed=6))
    both = Measurements(*(np.concatenate([getattr(d, k) for d in (stiff_wrist, more)]) for k in ("q_rad", "p_ME")))
    first, second = calibrate(real_ur5.robot, stiff_wrist), calibrate(real_ur5.robot, both)
    wrist = [k for k, name in enumerate(second.names) if name.group == "axis" and name.joint in (5, 6)]
    assert (second.sigma[wrist] < 0.8 * first.sigma[wrist]).all()
    plan = improvement.plan
    promised = dict(
        zip(map(str, plan.model.kinematic), np.sqrt(np.diag(plan.design.covariance)) * plan.model.widths, strict=False)
    )
    for k in wrist:
        assert second.sigma[k] / second.sigma_position_m == pytest.approx(
            promised[str(second.names[k])] / plan.model.sigma[0], rel=0.35
        )


def test_the_new_poses_are_better_than_random_ones(improvement):
    design = improvement.plan.design
    assert design.tool_sigma_m.mean() < design.random_sigma_m.min()
