"""Positioning and distance accuracy after ISO 9283, on numbers that can be followed by hand."""

import itertools

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation
from truepath.iso9283 import ErrorStatistics, accuracy


def poses(positions_mm, rotations=None):
    X = np.tile(np.eye(4), (len(positions_mm), 1, 1))
    X[:, :3, 3] = np.array(positions_mm) / 1000
    if rotations is not None:
        X[:, :3, :3] = rotations
    return X


def measured(positions_mm):
    return np.array(positions_mm, float) / 1000


def test_statistics_are_mean_root_mean_square_95th_percentile_and_maximum():
    errors = np.arange(101.0)
    assert ErrorStatistics.of(errors) == ErrorStatistics(
        mean=50.0, rms=pytest.approx(np.sqrt(np.sum(errors**2) / 101)), p95=95.0, max=100.0
    )


def test_there_are_no_statistics_of_nothing():
    with pytest.raises(ValueError, match="no errors"):
        ErrorStatistics.of(np.array([]))


def test_position_error_is_the_distance_between_command_and_reading():
    result = accuracy(poses([[0, 0, 0], [100, 0, 0]]), measured([[1, 2, 2], [100, 3, 4]]), None, np.arange(2))
    assert result.position_mm.mean == pytest.approx((3 + 5) / 2)
    assert result.position_mm.max == pytest.approx(5)
    assert result.position_mm.rms == pytest.approx(np.sqrt((9 + 25) / 2))


def test_repeated_visits_are_replaced_by_their_barycentre():
    # Pose 0: (1, 0, 0) and (-1, 2, 0), barycentre (0, 1, 0), 1 mm off. Pose 1: barycentre (301, 0, 2), sqrt(5) off.
    command = poses([[0, 0, 0], [300, 0, 0], [0, 0, 0], [300, 0, 0]])
    reading = measured([[1, 0, 0], [300, 0, 3], [-1, 2, 0], [302, 0, 1]])
    result = accuracy(command, reading, None, np.array([0, 1, 0, 1]))
    assert result.position_mm.mean == pytest.approx((1 + np.sqrt(5)) / 2)
    assert result.position_mm.max == pytest.approx(np.sqrt(5))
    # One pair: attained |(301, -1, 2)| = sqrt(90606) = 301.0083 mm, commanded 300 mm.
    assert result.distance_mm.mean == result.distance_mm.max == pytest.approx(np.sqrt(90606) - 300)


def test_a_pose_that_is_visited_more_often_weighs_no_more():
    command = poses([[0, 0, 0], [100, 0, 0], [0, 0, 0], [0, 0, 0]])
    reading = measured([[4, 0, 0], [100, 0, 0], [4, 0, 0], [4, 0, 0]])
    assert accuracy(command, reading, None, np.array([0, 1, 0, 0])).position_mm.mean == pytest.approx(2)


def test_distance_accuracy_on_an_example_worked_out_by_hand():
    # A 3-4-5 triangle in mm, commanded; read with its sides 3, 4 and 5 turned into 6, 4 and sqrt(52).
    command = poses([[0, 0, 0], [3, 0, 0], [0, 4, 0]])
    reading = measured([[0, 0, 0], [6, 0, 0], [0, 4, 0]])
    distance = accuracy(command, reading, None, np.arange(3)).distance_mm
    errors = [3.0, 0.0, np.sqrt(52) - 5]
    assert distance.mean == pytest.approx(sum(errors) / 3)
    assert distance.max == pytest.approx(3)


def test_too_short_counts_like_too_long():
    short, long = (
        accuracy(poses([[0, 0, 0], [100, 0, 0]]), measured([[0, 0, 0], [x, 0, 0]]), None, np.arange(2)).distance_mm.mean
        for x in (98, 102)
    )
    assert short == pytest.approx(2)
    assert long == pytest.approx(2)


def test_distances_do_not_feel_where_the_measurement_frame_is():
    rng = np.random.default_rng(0)
    p = rng.uniform(-500, 500, (20, 3))
    turned = Rotation.random(rng=rng).apply(p) + np.array([1000, 2000, -500])
    result = accuracy(poses(p), measured(turned), None, np.arange(20))
    assert result.distance_mm.max == pytest.approx(0, abs=1e-9)
    assert result.position_mm.mean > 100


def test_single_visits_obey_the_equations_of_the_paper():
    """Jiang et al. 2020, eq. 23 to 28, written out for one visit each."""
    rng = np.random.default_rng(1)
    c = rng.uniform(-500, 500, (12, 3))
    a = c + rng.normal(size=(12, 3))
    result = accuracy(poses(c), measured(a), None, np.arange(12))
    ap = [np.sqrt((x - xc) ** 2 + (y - yc) ** 2 + (z - zc) ** 2) for (x, y, z), (xc, yc, zc) in zip(a, c, strict=True)]
    pairs = itertools.combinations(range(12), 2)
    ad = [abs(np.linalg.norm(a[i] - a[j]) - np.linalg.norm(c[i] - c[j])) for i, j in pairs]
    for mine, theirs in ((result.position_mm, ap), (result.distance_mm, ad)):
        assert mine.mean == pytest.approx(np.mean(theirs))
        assert mine.rms == pytest.approx(np.sqrt(np.mean(np.square(theirs))))
        assert mine.p95 == pytest.approx(np.quantile(theirs, 0.95))
        assert mine.max == pytest.approx(np.max(theirs))


def test_with_repeats_the_distance_of_barycentres_is_the_papers_mean_distance_to_second_order():
    """Eq. 26 averages the n attained distances; barycentres differ from that by about scatter squared over distance."""
    rng = np.random.default_rng(2)
    n, command, scatter_mm = 30, np.array([[0.0, 0, 0], [400, 300, 0]]), 0.05
    a = np.array([[1.0, 0, 0], [401, 302, 0]])[:, None] + scatter_mm * rng.normal(size=(2, n, 3))
    paper = np.mean(np.linalg.norm(a[0] - a[1], axis=1)) - 500
    rows = a.transpose(1, 0, 2).reshape(-1, 3)
    mine = accuracy(poses(np.tile(command, (n, 1))), measured(rows), None, np.tile([0, 1], n)).distance_mm.mean
    assert mine == pytest.approx(abs(paper), abs=10 * scatter_mm**2 / 500)


def test_a_single_pose_has_a_position_error_and_no_distance():
    result = accuracy(poses([[0, 0, 0]]), measured([[0, 3, 4]]), None, np.zeros(1, int))
    assert result.position_mm == ErrorStatistics(*[pytest.approx(5)] * 4)
    assert result.distance_mm is None
    assert result.orientation_mrad is None


def test_orientation_error_is_the_angle_between_command_and_reading_whatever_both_are():
    rng = np.random.default_rng(0)
    commanded = Rotation.random(3, rng=rng)
    turns = Rotation.from_rotvec([[0.002, 0, 0], [0, -0.003, 0], [0, 0, 0.007]])
    X = poses(np.zeros((3, 3)), commanded.as_matrix())
    result = accuracy(X, np.zeros((3, 3)), (turns * commanded).as_matrix(), np.arange(3)).orientation_mrad
    assert result.mean == pytest.approx(4)
    assert result.max == pytest.approx(7)


def test_repeated_orientations_are_averaged_before_their_error_is_taken():
    turns = Rotation.from_rotvec([[0.004, 0, 0], [-0.002, 0, 0]]).as_matrix()
    result = accuracy(poses(np.zeros((2, 3))), np.zeros((2, 3)), turns, np.zeros(2, int))
    assert result.orientation_mrad.mean == pytest.approx(1)


def test_of_very_many_pairs_a_fixed_sample_stands_for_all():
    rng = np.random.default_rng(3)
    c = rng.uniform(-500, 500, (1200, 3))
    a = c + rng.normal(size=(1200, 3))
    result, again = (accuracy(poses(c), measured(a), None, np.arange(1200)) for _ in range(2))
    exact = np.abs(pdist(a) - pdist(c))
    assert len(exact) > 500_000
    assert result == again
    assert result.distance_mm.mean == pytest.approx(exact.mean(), rel=5e-3)
    assert result.distance_mm.p95 == pytest.approx(np.quantile(exact, 0.95), rel=1e-2)
    assert result.distance_mm.max <= exact.max() * (1 + 1e-9)


def test_it_becomes_the_dictionary_of_the_validation_file():
    result = accuracy(poses([[0, 0, 0]]), measured([[0, 3, 4]]), None, np.zeros(1, int)).to_dict()
    assert set(result) == {"position_mm", "distance_mm", "orientation_mrad"}
    assert list(result["position_mm"]) == ["mean", "rms", "p95", "max"]
    assert result["distance_mm"] is None
