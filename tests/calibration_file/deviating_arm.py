"""Poses of a robot that deviates, and what a fit to them makes of it."""

import numpy as np
from scipy.spatial.transform import Rotation
from truepath.calibrate import calibrate
from truepath.describe import describe, held_out
from truepath.iso9283 import accuracy
from truepath.measurements import Measurements
from truepath.poe import flange_poses

EFFECTS = ("transmission_error", "joint_compliance")


def measured(robot, has_orientation):
    """75 noisy poses with two gross errors, of a robot that deviates, is soft and has uneven gears."""
    rng = np.random.default_rng(11)
    q = rng.uniform(-2, 2, (75, robot.num_joints))
    phi = q + 3e-5 * robot.gravity_torque(q) + 5e-4 * np.cos(2 * q)
    X_MB, X_FE = np.eye(4), np.eye(4)
    X_MB[:3, :3], X_MB[:3, 3] = Rotation.from_rotvec([0.1, 2, -0.5]).as_matrix(), [2.0, -1.0, 0.3]
    X_FE[:3, :3], X_FE[:3, 3] = Rotation.from_rotvec([0.3, 0, 1]).as_matrix(), [0.05, -0.02, 0.1]
    X = X_MB @ flange_poses(robot, 1e-3 * rng.normal(size=4 * robot.num_joints + 12), phi) @ X_FE
    p_ME = X[:, :3, 3] + 2e-5 * rng.normal(size=(75, 3))
    p_ME[[7, 30]] += 0.2
    turn = Rotation.from_rotvec(1e-4 * rng.normal(size=(75, 3))).as_matrix()
    return Measurements(q_rad=q, p_ME=p_ME, R_ME=turn @ X[:, :3, :3] if has_orientation else None)


def described(robot, has_orientation=False):
    """A fit to these and its calibration, quicker than ``learn``: the poses of the fit stand for held-out ones."""
    data = measured(robot, has_orientation)
    fit = calibrate(robot, data, EFFECTS)
    nominal, calibrated = (
        accuracy(predict(data.q_rad), data.p_ME, data.R_ME, data.groups())
        for predict in (fit.model.predict_nominal, fit.model.predict)
    )
    heldout = held_out("no pose is held out", len(data), nominal, nominal, calibrated)
    return fit, describe(robot, data, fit, "a test", heldout)
