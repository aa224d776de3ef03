"""A diagnosis from data to verdict: what Drake hides is found, proved on unseen poses, and worth what is said."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hidden import Hidden, none, soft
from truepath.diagnose import diagnose
from truepath.learn import learn

POSES, WRONG = 200, [7, 60, 133]
COMPLIANCE = 2e-5
MEAN_OF_NOISE_MM = 0.02 * np.sqrt(8 / np.pi)  # of a vector with 0.02 mm on each axis


def joint_by_joint(q):
    """Joint 2 goes astray with the angle of joint 4: nothing in the library."""
    return np.outer(3e-4 * np.sin(2 * q[:, 3] + 0.3), [0, 1, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def softened(real_ur5):
    return Hidden(real_ur5, soft(real_ur5, 2, COMPLIANCE))


@pytest.fixture(scope="module")
def measured(softened):
    """Joint 2 is soft; three readings are 4 mm off."""
    data = softened.measured(POSES, 30)
    p_ME = data.p_ME.copy()
    p_ME[WRONG] += 0.004
    return replace(data, p_ME=p_ME, source="soft.csv")


@pytest.fixture(scope="module")
def diagnosis(real_ur5, measured):
    return diagnose(real_ur5.robot, measured, spec="ur5", source="ur5")


@pytest.fixture(scope="module")
def nothing(real_ur5):
    """Of a robot that has nothing but wrong geometry."""
    return diagnose(real_ur5.robot, Hidden(real_ur5, none).measured(POSES, 31), spec="ur5", plan=False)


@pytest.fixture(scope="module")
def strange(real_ur5):
    """Of a robot with a cause that the library does not know."""
    return diagnose(real_ur5.robot, Hidden(real_ur5, joint_by_joint).measured(POSES, 32), plan=False)


# What is found


def test_the_hidden_cause_is_named_with_its_joint_and_nothing_else_is(diagnosis):
    (finding,) = diagnosis.findings
    assert (finding.effect, finding.joints) == ("joint_compliance", (2,))
    assert finding.p_value < 0.01
    assert finding.log_odds > 10


def test_the_size_of_the_cause_is_the_true_one_within_its_deviation(diagnosis):
    (parameter,) = diagnosis.findings[0].parameters
    assert (parameter.joint, parameter.unit) == (2, "rad/(N m)")
    assert abs(parameter.value - COMPLIANCE) < 3 * parameter.sigma
    assert parameter.sigma < 0.1 * COMPLIANCE


def test_the_stated_gain_is_the_gain_on_a_thousand_fresh_poses(diagnosis, softened):
    q = softened.poses(1000, 99)
    truth = softened.true_positions(q)

    def mean_mm(name):
        fresh = truth + np.random.default_rng(1).normal(scale=2e-5, size=truth.shape)
        return 1e3 * np.linalg.norm(diagnosis.seen_models[name].predict(q)[:, :3, 3] - fresh, axis=1).mean()

    gain = diagnosis.findings[0].gain
    low, high = gain.ci95_mm
    assert low < mean_mm("kinematic") - mean_mm("final") < high
    assert gain.before_mm - gain.after_mm == pytest.approx((low + high) / 2)
    assert low > 0


def test_the_wrong_readings_are_named_by_row_and_left_out(diagnosis):
    assert diagnosis.to_dict()["data"]["outliers"] == [row + 1 for row in WRONG]
    assert diagnosis.calibration.data.outlier_lines == [row + 2 for row in WRONG]  # the header is line 1


def test_stages_go_from_the_drawing_to_the_final_model_each_better_than_the_one_before(diagnosis):
    assert [stage.model for stage in diagnosis.stages] == ["nominal", "kinematic", "kinematic+joint_compliance"]
    means = [stage.accuracy.position_mm.mean for stage in diagnosis.stages]
    assert means == sorted(means, reverse=True)
    assert means[-1] == pytest.approx(MEAN_OF_NOISE_MM, rel=0.2)
    assert diagnosis.unexplained.heldout_mm == pytest.approx(means[-1])


def test_the_noise_floor_is_that_of_the_noise_and_what_is_left_has_no_pattern(diagnosis):
    assert diagnosis.unexplained.noise_floor_mm == pytest.approx(MEAN_OF_NOISE_MM, rel=0.2)
    assert not diagnosis.unexplained.structured
    assert diagnosis.unexplained.hints == ()


# What is not


def test_where_nothing_is_hidden_nothing_is_named(nothing):
    assert nothing.findings == ()
    assert not nothing.unexplained.structured
    assert [stage.model for stage in nothing.stages] == ["nominal", "kinematic"]
    assert nothing.calibration.effects == []


def test_a_cause_outside_the_library_is_not_named_but_said_to_be_there(strange):
    assert strange.findings == ()
    assert strange.unexplained.structured
    assert strange.unexplained.p_value < 0.001
    assert "no known cause" in strange.verdict
    assert strange.unexplained.heldout_mm > 2 * MEAN_OF_NOISE_MM


def test_a_wrong_metre_is_no_finding_but_a_doubt_with_the_sentence_that_a_reader_needs(real_ur5):
    data = Hidden(real_ur5, none).measured(POSES, 31)
    long = diagnose(real_ur5.robot, replace(data, p_ME=data.p_ME * 1.01), plan=False)
    assert long.findings == ()
    (doubt,) = (item for item in long.ambiguous if "measurement_scale" in item.effects)
    assert "thermal_expansion" in doubt.effects
    assert "% long" in doubt.why
    assert float(doubt.why.split("all lengths are ")[1].split(" %")[0]) == pytest.approx(1.0, abs=0.3)
    assert "check the tracker's scale or the temperature" in doubt.why


# Unseen poses


def test_a_fifth_of_the_poses_is_kept_away(diagnosis):
    assert diagnosis.unseen.sum() == pytest.approx(POSES / 5, abs=len(WRONG))
    assert diagnosis.to_dict()["data"]["unseen_poses"] == diagnosis.unseen.sum()


def test_what_the_unseen_poses_say_has_no_influence_on_fit_and_choice(real_ur5, measured, diagnosis):
    """Other noise on them alone: the models that were fitted without them are the same to the last bit."""
    p_ME = measured.p_ME.copy()
    p_ME[diagnosis.unseen] += np.random.default_rng(3).normal(scale=3e-5, size=(diagnosis.unseen.sum(), 3))
    other = diagnose(real_ur5.robot, replace(measured, p_ME=p_ME), plan=False)
    for name in ("kinematic", "final"):
        np.testing.assert_array_equal(other.seen_models[name].p, diagnosis.seen_models[name].p)
    for mine, theirs in zip(other.findings, diagnosis.findings, strict=True):
        assert (mine.p_value, mine.log_odds, mine.parameters) == (theirs.p_value, theirs.log_odds, theirs.parameters)
    assert other.findings[0].gain != diagnosis.findings[0].gain


def test_visits_of_one_pose_are_all_seen_or_all_unseen(real_ur5, softened):
    once = softened.measured(60, 33)
    visits = np.tile(np.arange(60), 3)
    again = once.subset(visits)
    noise = np.random.default_rng(4).normal(scale=2e-5, size=(180, 3))
    found = diagnose(
        real_ur5.robot, replace(again, p_ME=again.p_ME + noise, pose_id=visits, line=np.arange(180) + 2), plan=False
    )
    for pose in range(60):
        assert len(set(found.unseen[visits == pose])) == 1
    assert found.unexplained.floor_from == "repeats"
    assert found.unexplained.noise_floor_mm == pytest.approx(MEAN_OF_NOISE_MM / np.sqrt(3), rel=0.1)  # at barycentres


# What the report draws


def test_residuals_of_every_stage_are_those_of_every_pose(diagnosis, measured):
    for stage in ("nominal", "kinematic", "final"):
        assert diagnosis.residuals[stage].shape == (POSES, 3)
    predicted = diagnosis.seen_models["final"].predict(measured.q_rad)[:, :3, 3]
    np.testing.assert_allclose(diagnosis.residuals["final"], predicted - measured.p_ME, atol=1e-12)


def test_the_view_of_a_joint_shows_by_how_much_the_real_joint_turned_too_far(real_ur5, softened, measured, diagnosis):
    """What the soft joint 2 does and the kinematic model does not know, but for what geometry makes up for."""
    view = diagnosis.joint_view["kinematic"][:, 1]
    truth = softened.joint_error(measured.q_rad)[:, 1]
    good = np.isfinite(view) & ~diagnosis.outlier
    assert np.corrcoef(view[good], truth[good])[0, 1] > 0.5
    left = diagnosis.joint_view["final"][:, 1]
    assert np.nanstd(left[good]) < 0.5 * np.nanstd(view[good])


# What comes of it


def test_the_calibration_holds_the_findings_and_their_worth(diagnosis):
    assert [(effect.name, effect.joint) for effect in diagnosis.calibration.effects] == [("joint_compliance", 2)]
    stated = diagnosis.calibration.heldout
    assert stated.poses == diagnosis.unseen.sum()
    assert stated.kinematic.position_mm.mean == diagnosis.stages[1].accuracy.position_mm.mean
    assert stated.calibrated.position_mm.mean == diagnosis.stages[2].accuracy.position_mm.mean


def test_calibrating_automatically_is_the_same_without_the_report(real_ur5, measured, diagnosis):
    calibration, *_ = learn(real_ur5.robot, measured, effects="auto", source="ur5")
    other = diagnosis.calibration.model_dump(exclude={"created_utc"})
    assert calibration.model_dump(exclude={"created_utc"}) == other


def test_a_diagnosis_is_the_same_every_time(real_ur5, measured, diagnosis):
    again = diagnose(real_ur5.robot, measured, spec="ur5", source="ur5")
    assert again.to_dict() == diagnosis.to_dict()


def test_with_too_few_poses_the_kinematics_is_fitted_and_nobody_claims_more(real_ur5):
    found = diagnose(real_ur5.robot, Hidden(real_ur5, none).measured(13, 34))
    assert (found.findings, found.stages) == ((), ())
    assert "Too few poses" in found.verdict
    assert found.calibration.heldout is None
    text = json.dumps(found.to_dict(), allow_nan=False)
    assert json.loads(text)["unexplained"]["heldout_mm"] is None


def test_it_says_what_it_is_doing(real_ur5):
    told = []
    diagnose(real_ur5.robot, Hidden(real_ur5, none).measured(60, 35), plan=False, progress=told.append)
    assert any("kinematics" in text for text in told)
    assert any("is there" in text for text in told)
    assert any("60 poses" in text for text in told)
