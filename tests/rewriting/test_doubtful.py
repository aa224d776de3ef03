"""Lines of which nobody knows whether the robot takes them: first in a loop, behind a branch."""

import numpy as np
import pytest
from hand_made import JOINT, LINEAR, at, motions
from truepath.controller import controller_of
from truepath.correct import correct
from truepath.model import CalibratedModel
from truepath.rewriting.doubtful import doubtful_findings
from truepath.rewriting.plan import plan_targets
from truepath.rewriting.vias import choose_vias
from truepath.rewriting.ways import sample_ways

READY = [0.3, -1.6, -1.8, -1.2, 1.5, 0.2]
DOWN = (2.2, 2.2, 0.0)
CORNERS = [at(0.25, -0.4, 0.2, DOWN), at(0.55, -0.25, 0.2, DOWN), at(0.5, -0.25, 0.45, (2.0, 2.1, 0.5))]


@pytest.fixture(scope="module")
def bent(ur5):
    p = np.concatenate([np.random.default_rng(4).normal(scale=1e-3, size=24), np.zeros(12)])
    return CalibratedModel(ur5, p, np.eye(4), np.eye(4), np.eye(4), np.eye(4))


def around(previous):
    """Joints in line 10, then lines to three corners (11, 12, 13)."""
    X = np.full((4, 4, 4), np.nan)
    X[1:] = CORNERS
    q = np.full((4, 6), np.nan)
    q[0] = READY
    made = motions([JOINT, LINEAR, LINEAR, LINEAR], X, q, previous=previous)
    made.origin[:] = [-1, 0, 1, 2]
    return made


def look(ur5, bent, possible, tolerance_mm, max_correction_mm=20.0, previous=(-1, -1, 1, 2)):
    controller = controller_of(ur5)
    plan = plan_targets(around(list(previous)), ur5, controller, "x", None)
    corrected = correct(bent, plan.q_rad, max_correction_mm=20.0, previous=plan.motions.previous)
    X_end = controller.tool_poses(corrected.q_rad, np.eye(4))
    pairs = np.array(possible, int).reshape(-1, 2)
    return plan, X_end, doubtful_findings(plan, pairs, X_end, bent, controller, tolerance_mm, max_correction_mm, "x")


def test_the_line_back_to_the_start_of_a_loop_is_told_by_how_much_it_is_off(ur5, bent):
    _, _, (finding,) = look(ur5, bent, [(0, 1), (3, 1)], 0.01)
    assert (finding.level, finding.guard, finding.line, finding.limit) == ("warning", "path", 11, 0.01)
    # The same lines, were it known that the robot comes along them.
    controller = controller_of(ur5)
    off = []
    for start in (0, 3):
        plan = plan_targets(around([-1, start, -1, -1]), ur5, controller, "x", None)
        _, X_end, _ = look(ur5, bent, [], 0.01)
        ways, _ = sample_ways(plan, bent, controller, 20.0, "x")
        off.append(choose_vias(plan, ways, X_end, None, lambda at: True).before_mm[0])
    assert finding.value == pytest.approx(max(off), abs=1e-9)
    assert f"line {10 + (0, 3)[int(np.argmax(off))]} " in finding.message


def test_within_the_tolerance_there_is_nothing_to_tell(ur5, bent):
    _, _, (finding,) = look(ur5, bent, [(3, 1)], 0.01)
    assert look(ur5, bent, [(3, 1)], 1.001 * finding.value)[2] == []
    assert look(ur5, bent, [(3, 1)], None)[2] == []
    assert look(ur5, bent, [], 0.01)[2] == []


def test_targets_that_are_not_in_the_plan_and_motions_of_the_joints_are_left_out(ur5, bent):
    assert look(ur5, bent, [(7, 1), (3, 9), (-1, 1), (3, 0)], 0.01)[2] == []


def test_a_correction_beyond_the_limit_on_such_a_line_is_a_warning(ur5, bent):
    _, _, (finding,) = look(ur5, bent, [(3, 1)], 0.01, max_correction_mm=0.01)
    assert (finding.level, finding.line) == ("warning", 11)
    assert "larger than allowed" in finding.message
