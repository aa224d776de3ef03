"""What is to be written for corrected joints."""

import numpy as np
import pytest
from drake_arm import DrakeArm
from hand_made import JOINT, LINEAR, at, motions
from scipy.spatial.transform import Rotation
from truepath.controller import controller_of
from truepath.model import nominal_model
from truepath.rewriting.express import express
from truepath.rewriting.plan import plan_targets
from truepath.rewriting.sampled import SampledTrajectory
from truepath.rewriting.vias import Vias
from truepath.rewriting.ways import sample_ways

READY = np.array([0.3, -1.6, -1.8, -1.2, 1.5, 0.2])
TOOL = at(0.03, -0.05, 0.14, (0.2, -0.4, 0.1))
NOTHING_ADDED = Vias([], {}, np.zeros(0), np.zeros(0))


def expressed(made, robot, change_rad, form):
    controller = controller_of(robot)
    plan = plan_targets(made, robot, controller, "x", None)
    ways, _ = sample_ways(plan, nominal_model(robot), controller, 5.0, "x")
    return plan, express(plan, plan.q_rad + change_rad, ways, NOTHING_ADDED, controller, form).targets


@pytest.fixture
def made():
    X = np.full((2, 4, 4), np.nan)
    X[1] = DrakeArm("ur5").flange_poses(READY + 0.05)[0] @ TOOL
    return motions([JOINT, LINEAR], X, [READY, np.full(6, np.nan)], tools=[TOOL])


def test_a_target_stays_what_it_was_unless_a_form_is_asked_for(ur5, made):
    for form, is_pose in ((None, [False, True]), ("joints", [False, False]), ("poses", [True, True])):
        plan, targets = expressed(made, ur5, 1e-3, form)
        assert targets.is_pose.tolist() == is_pose
        X = DrakeArm("ur5").flange_poses(plan.q_rad + 1e-3) @ TOOL
        vectors = np.hstack([X[:, :3, 3], Rotation.from_matrix(X[:, :3, :3]).as_rotvec()])
        expected = np.where(targets.is_pose[:, None], vectors, plan.q_rad + 1e-3)
        assert targets.values == pytest.approx(expected, abs=1e-8)
        assert targets.q_near_rad == pytest.approx(plan.q_rad + 1e-3, abs=1e-12)


def test_a_target_that_does_not_change_is_not_named_unless_its_form_does(ur5, made):
    assert expressed(made, ur5, 0.0, None)[1].index.tolist() == []
    assert expressed(made, ur5, 0.0, "joints")[1].index.tolist() == [1]
    assert expressed(made, ur5, 0.0, "poses")[1].index.tolist() == [0]
    change = np.array([[0, 0, 0, 0, 0, 1e-4], [0, 0, 0, 0, 0, 0]])
    assert expressed(made, ur5, change, None)[1].index.tolist() == [0]


@pytest.mark.parametrize("form", [None, "joints"])
def test_an_arm_of_seven_joints(seven, form):
    q = np.random.default_rng(0).uniform(-0.5, 0.5, (4, 7))
    _, targets = expressed(SampledTrajectory("x", np.arange(4.0), q).motions, seven, 1e-3, form)
    assert targets.values == pytest.approx(q + 1e-3)
    assert not targets.is_pose.any()
