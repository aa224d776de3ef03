"""Validation on poses that the fit has not seen, against errors computed by hand from Drake's truth."""

import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from truepath.calibrate import calibrate
from truepath.errors import CalibrationError
from truepath.validate import refit_frames, validate
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure

STATISTICS = {"mean", "rms", "p95", "max"}
MOVED = Campaign(tracker=True, seed=8)


@pytest.fixture(scope="module")
def real():
    return RealRobot("ur5", 2)


@pytest.fixture(scope="module")
def joints(real):
    """200 poses to fit, 100 to validate, 20 to find the frames again."""
    return free_poses(real, 320, np.random.default_rng(2))


@pytest.fixture(scope="module")
def model(real, joints):
    return calibrate(real.robot, measure(real, joints[:200], Campaign())).model


@pytest.fixture(scope="module")
def fresh(real, joints):
    return measure(real, joints[200:300], Campaign(seed=1))


def seen_from_elsewhere(real, joints, rows, **options):
    """The same robot, measured after the tracker was moved."""
    return measure(real, joints, replace(MOVED, **options)).subset(rows)


def test_errors_are_those_between_the_models_and_what_was_measured(model, fresh):
    result = validate(model, fresh)
    for accuracy, X in (
        (result.nominal, model.predict_nominal(fresh.q_rad)),
        (result.calibrated, model.predict(fresh.q_rad)),
    ):
        error = 1e3 * np.linalg.norm(X[:, :3, 3] - fresh.p_ME, axis=1)
        assert accuracy.position_mm.mean == pytest.approx(error.mean())
        assert accuracy.position_mm.rms == pytest.approx(np.sqrt(np.mean(error**2)))
        assert accuracy.position_mm.p95 == pytest.approx(np.quantile(error, 0.95))
        assert accuracy.position_mm.max == pytest.approx(error.max())
        assert accuracy.orientation_mrad is None


def test_distance_errors_are_those_of_all_pairs_of_poses(model, fresh):
    few = fresh.subset(np.arange(12))
    p = model.predict(few.q_rad)[:, :3, 3]
    errors = [
        1e3 * abs(np.linalg.norm(p[i] - p[k]) - np.linalg.norm(few.p_ME[i] - few.p_ME[k]))
        for i, k in combinations(range(12), 2)
    ]
    assert validate(model, few).calibrated.distance_mm.mean == pytest.approx(np.mean(errors))


def test_the_calibrated_robot_is_as_good_as_the_noise_and_the_nominal_one_is_not(model, fresh):
    result = validate(model, fresh)
    assert result.nominal.position_mm.mean > 0.5
    # Mean length of a vector of three noises of 0.02 mm: 1.596 times one of them; the model adds its own 3 %.
    assert result.calibrated.position_mm.mean == pytest.approx(1.596 * 0.02, rel=0.1)


def test_repeated_visits_count_once_at_their_barycentre(real, model, joints):
    repeated = measure(real, joints[200:300], Campaign(repeats=10, seed=1))
    result = validate(model, repeated)
    assert result.poses == 100
    single = validate(model, replace(repeated, pose_id=None))
    assert single.poses == 1000
    assert result.calibrated.position_mm.mean < 0.5 * single.calibrated.position_mm.mean


def test_orientation_is_judged_where_it_was_measured(real, joints):
    campaign = Campaign(orientation_noise_mrad=0.05)
    model = calibrate(real.robot, measure(real, joints[:200], campaign)).model
    result = validate(model, measure(real, joints[200:300], replace(campaign, seed=1)))
    assert result.nominal.orientation_mrad.mean > 0.3
    assert result.calibrated.orientation_mrad.mean == pytest.approx(1.596 * 0.05, rel=0.1)


def test_the_json_has_the_schema_of_the_design_and_nothing_else(model, fresh):
    content = json.loads(json.dumps(validate(model, fresh).to_dict(), allow_nan=False))
    assert list(content) == ["schema", "poses", "nominal", "calibrated"]
    assert content["schema"] == "truepath.validation/1"
    assert content["poses"] == 100
    for side in ("nominal", "calibrated"):
        assert list(content[side]) == ["position_mm", "distance_mm", "orientation_mrad"]
        assert set(content[side]["position_mm"]) == STATISTICS
        assert set(content[side]["distance_mm"]) == STATISTICS
        assert content[side]["orientation_mrad"] is None


def test_the_json_of_a_single_pose_leaves_out_what_it_cannot_tell(model, fresh):
    content = validate(model, fresh.subset(np.arange(1))).to_dict()
    assert content["poses"] == 1
    assert content["calibrated"]["distance_mm"] is None


# The tracker was moved


def test_a_moved_tracker_spoils_the_result_until_the_frames_are_found_again(real, joints, model):
    moved = seen_from_elsewhere(real, joints, np.arange(200, 320))
    check, few = moved.subset(np.arange(100)), moved.subset(np.arange(100, 120))
    assert validate(model, check).calibrated.position_mm.mean > 100
    result = validate(refit_frames(model, few), check)
    assert result.calibrated.position_mm.mean < 0.045
    assert result.nominal.position_mm.mean > 0.3


def test_frames_are_found_again_with_orientations_too(real, joints):
    campaign = Campaign(orientation_noise_mrad=0.05)
    model = calibrate(real.robot, measure(real, joints[:200], campaign)).model
    moved = seen_from_elsewhere(real, joints, np.arange(200, 320), orientation_noise_mrad=0.05)
    result = validate(refit_frames(model, moved.subset(np.arange(100, 120))), moved.subset(np.arange(100)))
    assert result.calibrated.position_mm.mean < 0.045
    assert result.calibrated.orientation_mrad.mean < 0.12


def test_only_the_frames_change(real, joints, model):
    few = seen_from_elsewhere(real, joints, np.arange(300, 320))
    found = refit_frames(model, few)
    assert np.array_equal(found.p, model.p)
    assert found.robot is model.robot
    assert (found.base_is_given, found.tool_is_given) == (False, False)


def test_one_gross_error_among_the_few_poses_does_no_harm(real, joints, model):
    moved = seen_from_elsewhere(real, joints, np.arange(200, 320))
    few = moved.subset(np.arange(100, 120))
    few.p_ME[3] += 0.3
    result = validate(refit_frames(model, few), moved.subset(np.arange(100)))
    assert result.calibrated.position_mm.mean < 0.05


@pytest.mark.parametrize(("count", "orientation", "needed"), [(3, None, 4), (2, 0.05, 3)])
def test_too_few_poses_to_find_the_frames_are_refused(real, joints, model, count, orientation, needed):
    few = measure(real, joints[:count], Campaign(repeats=5, orientation_noise_mrad=orientation))
    with pytest.raises(CalibrationError, match=f"at least {needed} different poses") as caught:
        refit_frames(model, few)
    assert f"found:    {count}" in str(caught.value)


@pytest.mark.parametrize("moving", [0, 5], ids=["joint 1", "joint 6"])
@pytest.mark.parametrize("orientation", [None, 0.05], ids=["3d", "6d"])
def test_poses_that_cannot_tell_base_from_probe_are_refused(real, joints, model, moving, orientation):
    q = np.tile(joints[:1], (20, 1))
    q[:, moving] = np.linspace(-2, 2, 20)
    with pytest.raises(CalibrationError, match="too much alike"):
        refit_frames(model, measure(real, q, Campaign(orientation_noise_mrad=orientation)))


def test_poses_of_another_robot_are_refused(real, joints, model):
    few = measure(real, joints[300:], MOVED)
    with pytest.raises(CalibrationError, match="another robot"):
        refit_frames(model, replace(few, q_rad=few.q_rad[:, ::-1]))
