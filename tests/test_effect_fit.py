"""Effects that are asked for: found on the joints that have them, nowhere else, and worth what is claimed."""

import numpy as np
import pytest
from hidden import Hidden, none, soft, wavy
from scipy.spatial.transform import Rotation
from truepath.calibrate import calibrate
from truepath.context import Context
from truepath.correct import correct
from truepath.effects import EFFECTS, joint_errors
from truepath.errors import CorrectionError
from truepath.learn import learn
from truepath.measurements import Measurements
from truepath.model import nominal_flange_poses


@pytest.fixture(scope="module")
def real(real_ur5):
    return real_ur5


def named(fit_or_calibration):
    effects = getattr(fit_or_calibration, "effects", None)
    if effects is None:
        return {(part.term.effect, part.term.joint) for part in fit_or_calibration.model.effects}
    return {(effect.name, effect.joint) for effect in effects}


def test_a_wave_of_two_cycles_is_found_on_its_joint_alone(real):
    data = Hidden(real, wavy(2, 3e-4, 2)).measured(300, 1)
    assert named(calibrate(real.robot, data, ["transmission_error"])) == {("transmission_error", 2)}


def test_a_wave_of_tens_of_cycles_is_found_on_its_joint_alone(real):
    hidden = Hidden(real, wavy(3, 1.5e-4, 31))
    fit = calibrate(real.robot, hidden.measured(400, 2), ["transmission_error"])
    assert named(fit) == {("transmission_error", 3)}
    q = hidden.poses(300, 99)
    found, truth = joint_errors(real.robot, Context(q), fit.model.effects)[:, 2], hidden.joint_error(q)[:, 2]
    assert np.std(found - truth) < 0.2 * np.std(truth)


def test_the_size_of_a_wave_comes_with_an_honest_uncertainty(real):
    """Amplitude 200 urad at 3 cycles, phase 0.4: sin(3q + 0.4) = sin 0.4 cos 3q + cos 0.4 sin 3q."""
    data = Hidden(real, wavy(4, 2e-4, 3)).measured(400, 3)
    (found,) = calibrate(real.robot, data, ["transmission_error"]).model.effects
    value = dict(zip([p.name for p in found.term.parameters], found.values, strict=True))
    sigma = dict(zip([p.name for p in found.term.parameters], found.sigma, strict=True))
    for name, truth in (("cos 3", 2e-4 * np.sin(0.4)), ("sin 3", 2e-4 * np.cos(0.4))):
        assert abs(value[name] - truth) < 4 * sigma[name]
        assert sigma[name] < 2e-5


def test_a_soft_joint_is_found_with_its_compliance(real):
    data = Hidden(real, soft(real, 2, 1.2e-5)).measured(300, 4)
    fit = calibrate(real.robot, data, ["joint_compliance"])
    assert named(fit) == {("joint_compliance", 2)}
    (found,) = fit.model.effects
    assert abs(found.values[0] - 1.2e-5) < 4 * found.sigma[0]


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_nothing_is_named_where_nothing_is_hidden(real, seed):
    data = Hidden(real, none).measured(200, seed)
    assert named(calibrate(real.robot, data, list(EFFECTS))) == set()


def test_the_cause_is_told_from_one_that_looks_alike(real):
    both = ["joint_compliance", "transmission_error", "backlash", "encoder_scale"]
    soft_joint, uneven_gear = soft(real, 2, 1.2e-5), wavy(5, 3e-4, 4)
    fit = calibrate(real.robot, Hidden(real, soft_joint).measured(300, 8), both)
    assert named(fit) == {("joint_compliance", 2)}
    fit = calibrate(real.robot, Hidden(real, uneven_gear).measured(300, 9), both)
    assert named(fit) == {("transmission_error", 5)}


def test_the_gain_stated_on_held_out_poses_is_the_gain_on_fresh_ones(real):
    hidden = Hidden(real, wavy(2, 4e-4, 2))
    calibration, *_ = learn(real.robot, hidden.measured(400, 10), effects="auto")
    stated = calibration.heldout
    assert stated.kinematic.position_mm.mean > 3 * stated.calibrated.position_mm.mean
    fresh = hidden.measured(1000, 11)
    miss = 1e3 * np.linalg.norm(calibration.model.predict(fresh.q_rad)[:, :3, 3] - fresh.p_ME, axis=1)
    assert stated.calibrated.position_mm.mean == pytest.approx(miss.mean(), rel=0.15)


def test_a_path_corrected_with_an_effect_takes_the_real_robot_where_it_should_go(real):
    hidden = Hidden(real, wavy(2, 4e-4, 2))
    calibration, *_ = learn(real.robot, hidden.measured(400, 12), effects=["transmission_error"])
    model, q = calibration.model, hidden.poses(200, 13)
    q = q[np.abs(np.sin(q[:, 4])) > 0.3]  # keep away from the wrist singularity
    q = np.stack([row for row in q if _can_be_corrected(model, row)])
    corrected = np.concatenate([correct(model, row, max_correction_mm=20).q_rad for row in q])
    wanted = (model.X_MB @ nominal_flange_poses(model.robot, q) @ model.X_FE)[:, :3, 3]
    before = 1e3 * np.linalg.norm(hidden.true_positions(q) - wanted, axis=1)
    after = 1e3 * np.linalg.norm(hidden.true_positions(corrected) - wanted, axis=1)
    assert before.mean() > 0.5
    assert after.mean() < 0.02


def _can_be_corrected(model, q):
    try:
        correct(model, q, max_correction_mm=20)
    except CorrectionError:
        return False
    return True


def test_gross_errors_do_not_become_effects(real):
    data = Hidden(real, none).measured(200, 14)
    data.p_ME[::20] += np.random.default_rng(0).normal(scale=3e-3, size=(10, 3))
    fit = calibrate(real.robot, data, list(EFFECTS))
    assert named(fit) == set()
    assert fit.outlier[::20].sum() >= 9


def test_six_dimensional_data_find_the_wave_of_the_last_joint(real):
    hidden = Hidden(real, wavy(6, 5e-4, 2))
    q = hidden.poses(200, 15)
    X = real.reflector_poses(q + hidden.joint_error(q))
    rng = np.random.default_rng(15)
    turn = Rotation.from_rotvec(rng.normal(scale=5e-5, size=(200, 3))).as_matrix()
    data = Measurements(q, X[:, :3, 3] + rng.normal(scale=2e-5, size=(200, 3)), turn @ X[:, :3, :3])
    fit = calibrate(real.robot, data, ["transmission_error"])
    assert named(fit) == {("transmission_error", 6)}
    assert fit.sigma_orientation_rad == pytest.approx(5e-5, rel=0.1)
