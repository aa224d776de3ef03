"""One cell and one small campaign for all tests of planning."""

from dataclasses import replace

import pytest
from seen_from import CONE_DEG, FARTHEST_M, NEAREST_M, TRACKER
from truepath.planning.campaign import plan_campaign
from truepath.planning.design import Wish
from truepath.planning.setup import feasible_poses, robot_in_cell, stated_noise
from truepath.planning.sight import stated_sight
from truepath.plants import load_robot


@pytest.fixture(scope="session")
def anywhere():
    """The test of poses in the UR5's cell without a tracker."""
    robot, cell = robot_in_cell("ur5", None)
    return feasible_poses(robot, cell, "model", None)


@pytest.fixture(scope="session")
def in_sight(anywhere):
    """The same with a tracker."""
    sight = stated_sight(",".join(map(str, TRACKER)), f"{NEAREST_M},{FARTHEST_M}", CONE_DEG, "z")
    return replace(anywhere, sight=sight)


@pytest.fixture(scope="session")
def small_plan(in_sight):
    """26 measurements, 2 of them repeats."""
    return plan_campaign(in_sight, Wish(26, 2), stated_noise(0.02, None), candidates=250)


@pytest.fixture(scope="session")
def without_a_cell():
    """The joint limits alone: quick."""
    return feasible_poses(load_robot("ur5_cell"), None, "model", None)
