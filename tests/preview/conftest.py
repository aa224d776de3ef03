"""A calibration, a path and a browser that the tests of the preview share."""

import csv
from pathlib import Path

import numpy as np
import pytest
from opened_page import UNKIND, OpenPage
from truepath import lie, poe
from truepath.calibration import Calibration
from truepath.learn import learn
from truepath.measurements import Measurements
from truepath.model import no_deviation, nominal_flange_poses
from truepath.plants import load_robot, models_dir
from truepath.preview import write_preview


@pytest.fixture(scope="session")
def calibration() -> Calibration:
    """A UR5 that is a millimetre or two off, learnt from 60 noisy poses of a reflector."""
    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    truth = no_deviation(robot)
    truth[: 4 * robot.num_joints] = rng.normal(scale=4e-4, size=4 * robot.num_joints)
    X_MB = lie.make_pose(lie.from_rotation_vector(np.array([0.0, 0.0, 0.3])), np.array([2.0, 1.0, 0.2]))
    X_FE = lie.make_pose(translation=np.array([0.05, 0.0, 0.12]))
    q = rng.uniform([-1.5, -2.2, 0.6, -2.6, -2.4, -1.5], [1.5, -0.6, 2.2, -0.6, -0.8, 1.5], (60, 6))
    p_ME = (X_MB @ poe.flange_poses(robot, truth, q) @ X_FE)[:, :3, 3]
    return learn(robot, Measurements(q_rad=q, p_ME=p_ME + rng.normal(scale=3e-5, size=p_ME.shape)))[0]


@pytest.fixture(scope="session")
def q_programmed() -> np.ndarray:
    with (models_dir() / "ur5" / "weld_path.csv").open() as file:
        return np.array([[float(row[f"q{i}_rad"]) for i in range(1, 7)] for row in csv.DictReader(file)])


@pytest.fixture(scope="session")
def q_corrected(calibration: Calibration, q_programmed: np.ndarray) -> np.ndarray:
    """Two Newton steps towards where the program wants the flange."""
    model, q = calibration.model, q_programmed.copy()
    goal = model.goal_flange_poses(nominal_flange_poses(model.robot, q_programmed))
    for _ in range(2):
        X_BF, J = model.flange_poses_and_jacobian(q)
        q += np.linalg.solve(J, lie.pose_error(goal, X_BF)[..., None])[..., 0]
    return q


@pytest.fixture(scope="session")
def page_file(tmp_path_factory, calibration, q_programmed, q_corrected) -> Path:
    file = tmp_path_factory.mktemp("preview") / "preview.html"
    labels = [f"point <{k}>" for k in range(len(q_programmed))]
    write_preview(file, calibration, q_programmed, q_corrected, robot_source="ur5", title=UNKIND, labels=labels)
    return file


@pytest.fixture(scope="module")
def opened(browser, page_file):
    page = OpenPage(browser, page_file)
    yield page
    page.tab.close()
    assert page.complaints == [], "something that a test did made the page complain"
