"""Robots with a hidden cause: the diagnosis sees the CSV, then the truth is unsealed.

A quick set; workflows/hidden_effects.py runs hundreds of such cases.
"""

import numpy as np
import pytest
from hidden_effects import EFFECTS, draw_case
from hidden_effects.scene import Motion, Visible, field
from hidden_effects.verdict import (
    diagnose_csv,
    finds_the_outliers,
    is_resolved,
    named,
    names_the_truth,
    poses_to_measure,
    says_ambiguous,
    says_unexplained,
)
from truepath.plants import load_robot
from truepath.readers import read_measurements

POSES = 250


def judged(kind, seed, **choices):
    """The verdict, and what it should have been."""
    case = draw_case(kind, seed, **choices)
    _, verdict = diagnose_csv(case.spec, case.csv)
    return verdict, case.unseal()


class TestDiagnosis:
    @pytest.mark.parametrize("effect", [effect for effect in EFFECTS if effect != "outlier"])
    def test_names_the_one_effect_and_its_joints(self, effect):
        verdict, truth = judged(f"single:{effect}", 0, poses=POSES, outliers=False)
        assert named(verdict, truth) == truth.effects

    @pytest.mark.parametrize("seed", [1, 4])
    def test_names_both_of_two_effects(self, seed):
        verdict, truth = judged("pair", seed, poses=POSES, outliers=False)
        assert named(verdict, truth) == truth.effects

    @pytest.mark.parametrize("seed", [0, 1, 2])
    def test_names_nothing_where_there_is_nothing(self, seed):
        verdict, truth = judged("none", seed, poses=POSES)
        assert named(verdict, truth) == {}

    @pytest.mark.parametrize("seed", [2, 3])
    def test_says_that_it_does_not_know_a_cause_outside_the_library(self, seed):
        verdict, truth = judged("outside", seed, poses=300)
        assert says_unexplained(verdict, truth)

    def test_lists_the_outliers_by_row(self):
        verdict, truth = judged("single:outlier", 0, poses=POSES)
        assert finds_the_outliers(verdict, truth)
        assert named(verdict, truth) == {}

    def test_names_an_effect_among_outliers(self):
        verdict, truth = judged("single:encoder_scale", 1, poses=POSES, outliers=True)
        assert finds_the_outliers(verdict, truth)
        assert names_the_truth(verdict, truth)

    @pytest.mark.parametrize("effect", ["axis_wobble", "joint_compliance"])
    def test_names_an_effect_of_a_robot_measured_in_6d(self, effect):
        verdict, truth = judged(f"single:{effect}", 2, poses=POSES, six_d=True, outliers=False)
        assert named(verdict, truth) == truth.effects

    def test_takes_wrong_lengths_for_no_finding_but_says_so(self):
        verdict, truth = judged("confounded:scale", 0, poses=POSES)
        assert says_ambiguous(verdict, truth)

    @pytest.mark.parametrize(
        ("design", "seed"),
        [
            pytest.param("small_workspace", 2, marks=pytest.mark.slow),
            ("sweep", 0),
            pytest.param("sweep", 1, marks=pytest.mark.slow),
            pytest.param("sweep", 2, marks=pytest.mark.slow),
        ],
        ids=str,
    )
    def test_admits_a_doubt_and_settles_it_with_the_poses_that_it_asked_for(self, design, seed):
        case = draw_case(f"confounded:{design}", seed, outliers=False)
        diagnosis, verdict = diagnose_csv(case.spec, case.csv, plan=True)
        truth = case.unseal()
        assert says_ambiguous(verdict, truth)
        further = poses_to_measure(diagnosis, truth)
        _, verdict = diagnose_csv(case.spec, case.measure_more(further))
        assert is_resolved(verdict, truth)


@pytest.fixture(scope="module")
def case():
    return draw_case("single:axis_wobble", 4, poses=150, six_d=True, outliers=False)


class TestTheGenerator:
    def test_draws_the_same_case_from_the_same_seed(self, case):
        again = draw_case("single:axis_wobble", 4, poses=150, six_d=True, outliers=False)
        assert again.csv == case.csv
        assert draw_case("single:axis_wobble", 5, poses=150).csv != case.csv

    @pytest.mark.parametrize("kind", ["single:backlash", "single:joint_compliance", "pair", "confounded:sweep"])
    def test_hands_over_a_csv_that_truepath_reads(self, kind, tmp_path):
        case = draw_case(kind, 1)
        (tmp_path / "data.csv").write_text(case.csv)
        measurements = read_measurements(tmp_path / "data.csv", load_robot(case.spec))
        assert len(measurements) == case.unseal().poses

    def test_keeps_the_first_rows_when_more_is_measured(self, case):
        longer = case.measure_more(np.zeros((2, 6)))
        assert longer.startswith(case.csv)
        assert len(longer.splitlines()) == 153

    def test_moves_as_the_virtual_cell_does_while_no_cause_acts(self, case):
        robot, campaign = case._robot, case._campaign
        scene = robot.survey(campaign, campaign.time_s[-1])
        undisturbed = robot.true_poses(scene, scene.still())
        np.testing.assert_allclose(undisturbed, robot.X_MW @ robot.real.reflector_poses(campaign.q), atol=1e-12)

    def test_weighs_as_drake_does(self, case):
        scene = case._robot.survey(case._campaign, 1.0)
        about_axes = np.sum(scene.gravity_moment * scene.axes, axis=2)
        np.testing.assert_allclose(about_axes, scene.gravity_torque, atol=1e-10)

    def test_knows_how_far_a_small_motion_of_anything_carries_the_reflector(self, case):
        robot, campaign = case._robot, case._campaign
        scene = robot.survey(campaign, campaign.time_s[-1])
        rng, N = np.random.default_rng(0), len(scene)
        shapes = (N, 6), (N, 6, 6), (N, 3), (N, 6), (N, 3)
        motion = Motion(*(1e-6 * rng.normal(size=shape) for shape in shapes))
        moved = robot.true_poses(scene, motion)[:, :3, 3] - robot.true_poses(scene, scene.still())[:, :3, 3]
        np.testing.assert_allclose(moved, field(scene, motion)[:, :3], atol=1e-10)

    @pytest.mark.parametrize("effect", ["encoder_scale", "backlash", "thermal_expansion", "tool_shift"])
    def test_hides_causes_that_no_geometry_can_imitate(self, effect):
        case = draw_case(f"single:{effect}", 3, poses=150, six_d=False, outliers=False)
        assert case.unseal().visible_sigmas[effect] == pytest.approx(seen_beside_geometry(case), rel=0.02)

    @pytest.mark.parametrize("effect", [effect for effect in EFFECTS if effect != "outlier"])
    def test_measures_the_cause_that_it_states_and_nothing_else(self, effect):
        case = draw_case(f"single:{effect}", 2, poses=200, six_d=False, outliers=False)
        estimate, sigma, chi_square_per_reading = what_an_oracle_finds(case)
        assert abs(estimate - 1.0) < 4 * sigma + 0.02  # a mixed term of geometry and cause is not linear
        assert 0.8 < chi_square_per_reading < 1.25

    @pytest.mark.parametrize("effect", [effect for effect in EFFECTS if effect != "outlier"])
    def test_hides_causes_that_are_seen_but_barely(self, effect):
        sigmas = draw_case(f"single:{effect}", 6, poses=POSES).unseal().visible_sigmas[effect]
        assert 0.99 <= sigmas <= 20

    def test_hides_nothing_that_a_small_workspace_would_show(self):
        truth = draw_case("confounded:small_workspace", 2, outliers=False).unseal()
        assert truth.visible_sigmas["joint_compliance"] < 0.2


def what_an_oracle_finds(case):
    """Size of the cause, in sizes of the true one, from the CSV by one who knows its shape; its sigma; chi-square."""
    robot, campaign, truth = case._robot, case._campaign, case.unseal()
    table = np.genfromtxt(case.csv.splitlines(), delimiter=",", names=True)
    measured = 1e-3 * np.stack([table[f"{axis}_mm"] for axis in "xyz"], axis=1)
    scene = robot.survey(campaign, campaign.time_s[-1])
    visible = Visible(scene, truth.noise_m, None)
    rest = visible.part(measured - robot.true_poses(scene, scene.still())[:, :3, 3])
    shape = visible.part(field(scene, case._motion(scene)))
    size = shape @ rest / (shape @ shape)
    readings = len(rest) - 28  # geometry and frames of a UR, measured in 3D, and the size
    return size, 1 / np.linalg.norm(shape), np.sum((rest - size * shape) ** 2) / readings


def seen_beside_geometry(case):
    """Sigmas of a coordinate that a cause leaves when robots with other errors do their best, all moved by Drake."""
    robot, campaign = case._robot, case._campaign
    scene = robot.survey(campaign, campaign.time_s[-1])
    straight = robot.true_poses(scene, scene.still())[:, :3, 3]
    hidden = robot.true_poses(scene, case._motion(scene))[:, :3, 3] - straight
    imitations = []
    for joint in range(1, 7):
        for twist in 1e-6 * np.eye(6):
            other = robot.true_poses(scene, scene.carrying(joint, np.tile(twist, (len(scene), 1))))
            imitations.append((other[:, :3, 3] - straight).ravel() * 1e6)
    for shift in 1e-6 * np.eye(3):
        other = robot.true_poses(scene, scene.slipping(np.tile(shift, (len(scene), 1))))
        imitations.append((other[:, :3, 3] - straight).ravel() * 1e6)
    columns = np.stack(imitations, axis=1)
    best = np.linalg.lstsq(columns, hidden.ravel(), rcond=1e-6)[0]
    return np.sqrt(np.mean((hidden.ravel() - columns @ best) ** 2)) / campaign.noise_m
