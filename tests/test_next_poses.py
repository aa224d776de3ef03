"""Poses to measure next: within limits, free of collision for Drake, and more telling than any that come by chance."""

import io

import numpy as np
import pytest
from drake_arm import DrakeArm
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from truepath import plants
from truepath.measurements import from_table
from truepath.next_poses import CANDIDATES, Cell, candidates, most_telling, to_csv
from truepath.tables import read_table

ANYWHERE = np.full(6, np.pi)
FOLDED = np.array([0, -np.pi / 2, 3.0, 0, 0, 0])  # the forearm in the upper arm
UPRIGHT = np.array([0, -np.pi / 2, 0, -np.pi / 2, 0, 0])


@pytest.fixture(scope="module")
def penetrations():
    """Function: number of pairs of shapes of the UR5's cell that are in each other at joints ``(6,)``."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    parser = Parser(plant)
    parser.package_map().Add("truepath_models", str(plants.models_dir()))
    parser.AddModels(str(plants.models_dir() / "ur5" / "cell.dmd.yaml"))
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()

    def count(q):
        plant.SetPositions(plant.GetMyMutableContextFromRoot(root), q)
        query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
        return len(query.ComputePointPairPenetration())

    count.diagram = diagram  # which must live as long
    return count


@pytest.fixture(scope="module")
def free(ur5):
    return candidates(ur5, "ur5", -ANYWHERE, ANYWHERE)


# Where the arm may be


def test_a_cell_says_of_a_pose_what_drake_says(penetrations):
    cell = Cell("ur5")
    assert not cell.is_free(FOLDED)
    assert cell.is_free(UPRIGHT)
    for q in np.random.default_rng(0).uniform(-np.pi, np.pi, (60, 6)):
        assert cell.is_free(q) == (penetrations(q) == 0)


def test_candidates_are_free_of_collision_in_the_cell_of_the_robot(free, penetrations):
    assert len(free) == CANDIDATES
    assert all(penetrations(q) == 0 for q in free)


def test_candidates_keep_away_from_the_joint_limits(seven):
    drawn = candidates(seven, None, np.full(7, -4.0), np.full(7, 4.0))
    margin = np.radians(2.9)
    assert (drawn > seven.lower_rad + margin).all()
    assert (drawn < seven.upper_rad - margin).all()


def test_candidates_stay_within_the_angles_that_are_asked_for(ur5):
    lower, upper = np.array([-1, -2, 0.5, -2, -1, 0.0]), np.array([1, -1, 2, 0, 1, 0.5])
    drawn = candidates(ur5, "ur5", lower, upper)
    assert len(drawn)
    assert (drawn >= lower).all()
    assert (drawn <= upper).all()


def test_no_candidate_turns_a_joint_more_than_half_a_turn(free):
    assert np.abs(free).max() < np.pi


def test_the_flange_stays_above_the_floor_on_which_the_base_stands(free):
    assert DrakeArm("ur5").flange_poses(free)[:, 2, 3].min() > 0.049


def test_without_a_cell_the_limits_alone_decide(ur5, free):
    drawn = candidates(ur5, None, -ANYWHERE, ANYWHERE)
    assert len(drawn) == CANDIDATES
    assert not np.array_equal(drawn, free)


def test_the_same_candidates_come_every_time(ur5, free):
    np.testing.assert_array_equal(candidates(ur5, "ur5", -ANYWHERE, ANYWHERE), free)


# Which of them


class Question:
    """Two causes that the data so far hardly tell apart: readings along q1 and q2, and a third that is known."""

    def __init__(self):
        self.q = np.random.default_rng(2).uniform(-1, 1, (300, 6))
        alike = 0.9999
        self.covariance = np.array([[1.0, -alike, 0.0], [-alike, 1.0, 0.0], [0.0, 0.0, 1e-4]])

    @staticmethod
    def columns(q):
        rows = np.stack([q[:, 0], q[:, 1], np.ones(len(q))], axis=1)
        return np.stack([3.0 * rows, np.zeros_like(rows)], axis=1)

    def doubt_left(self, q):
        """Log determinant of the covariance once poses are measured, the textbook way."""
        X = self.columns(q).reshape(-1, 3)
        return -np.linalg.slogdet(np.linalg.inv(self.covariance) + X.T @ X)[1]


@pytest.fixture(scope="module")
def question():
    return Question()


def test_the_chosen_poses_leave_less_doubt_than_any_of_a_thousand_random_choices(question):
    chosen = most_telling(question.columns, question.covariance, question.q, 10)
    rng = np.random.default_rng(3)
    by_chance = [question.doubt_left(question.q[rng.permutation(300)[:10]]) for _ in range(1000)]
    assert question.doubt_left(chosen) < min(by_chance)


def test_the_first_pose_is_the_single_best_and_each_later_one_the_best_given_those_before(question):
    chosen = most_telling(question.columns, question.covariance, question.q, 4)
    for k in range(4):
        others = [pose for pose in question.q if not (chosen[:k] == pose).all(axis=1).any()]
        left = [question.doubt_left(np.concatenate([chosen[:k], pose[None]])) for pose in others]
        assert question.doubt_left(chosen[: k + 1]) == pytest.approx(min(left), abs=1e-9)


def test_no_pose_is_asked_for_twice_and_no_more_than_there_are(question):
    chosen = most_telling(question.columns, question.covariance, question.q, 50)
    assert len(np.unique(chosen, axis=0)) == 50
    assert len(most_telling(question.columns, question.covariance, question.q[:7], 50)) == 7


def test_units_of_the_parameters_do_not_change_the_choice(question):
    """The same question with the second parameter in micrometres."""
    unit = np.array([1.0, 1e-6, 1.0])
    other = most_telling(
        lambda q: question.columns(q) / unit, question.covariance * np.outer(unit, unit), question.q, 8
    )
    np.testing.assert_array_equal(other, most_telling(question.columns, question.covariance, question.q, 8))


# The file


def test_the_file_holds_every_pose_once_to_the_nanoradian(free, tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text(to_csv(free[:40]))
    table = np.loadtxt(io.StringIO(path.read_text()), delimiter=",", skiprows=1)
    assert path.read_text().splitlines()[0] == "q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad"
    order = [int(np.argmin(np.abs(free[:40] - row).max(axis=1))) for row in table]
    assert sorted(order) == list(range(40))
    np.testing.assert_allclose(table, free[order], atol=1e-9)


def test_the_order_of_the_file_has_nothing_to_do_with_the_poses():
    """So that time and angle do not go along with each other once more."""
    swept = np.linspace(-1, 1, 40)[:, None] * np.ones(6)
    table = np.loadtxt(io.StringIO(to_csv(swept)), delimiter=",", skiprows=1)
    assert abs(np.corrcoef(np.arange(40), table[:, 0])[0, 1]) < 0.4


def test_with_positions_beside_them_the_poses_are_a_data_set(free, tmp_path):
    header, *rows = to_csv(free[:5]).splitlines()
    path = tmp_path / "measured.csv"
    path.write_text("\n".join([header + ",x_mm,y_mm,z_mm", *(row + ",1,2,3" for row in rows)]) + "\n")
    assert len(from_table(read_table(path), 6)) == 5
