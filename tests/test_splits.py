"""Parts of a data set that are left out in turn: every row once, visits of a pose together, neighbours in blocks."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from truepath.measurements import Measurements
from truepath.splits import BLOCKS_PER_PART, block_parts, random_parts


@given(visits=st.lists(st.integers(0, 8), min_size=9, max_size=60), count=st.integers(2, 6), seed=st.integers(0, 99))
def test_every_row_is_in_one_random_part_and_visits_of_a_pose_stay_together(visits, count, seed):
    visits = np.unique(visits, return_inverse=True)[1]
    parts = random_parts(visits, count, seed)
    assert len(parts) == count
    assert sorted(np.concatenate(parts).tolist()) == list(range(len(visits)))
    for pose in range(visits.max() + 1):
        assert sum(pose in visits[part] for part in parts) == 1


@given(poses=st.integers(5, 200), count=st.integers(2, 5), seed=st.integers(0, 9))
def test_random_parts_have_nearly_the_same_number_of_poses(poses, count, seed):
    sizes = [len(part) for part in random_parts(np.arange(poses), count, seed)]
    assert max(sizes) - min(sizes) <= 1


def test_the_seed_draws_the_parts():
    one, again, other = (np.concatenate(random_parts(np.arange(50), 5, seed)) for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_random_parts_are_spread_over_the_campaign():
    for part in random_parts(np.arange(500), 5):
        assert abs(part.mean() - 249.5) < 50


@given(rows=st.integers(1, 500), count=st.integers(2, 6))
def test_every_row_is_in_one_block(rows, count):
    parts = block_parts(rows, count)
    assert len(parts) == count
    assert sorted(np.concatenate(parts).tolist()) == list(range(rows))


def test_blocks_hold_neighbours_in_time_and_each_part_has_some_all_over_the_campaign():
    for part in block_parts(400, 5):
        runs = np.split(part, np.flatnonzero(np.diff(part) > 1) + 1)
        assert len(runs) == BLOCKS_PER_PART
        assert {len(run) for run in runs} == {400 // 5 // BLOCKS_PER_PART}
        assert part.min() < 400 // BLOCKS_PER_PART
        assert part.max() >= 400 - 400 // BLOCKS_PER_PART


def test_the_folds_of_measurements_keep_visits_together():
    pose_id = np.tile(np.arange(20), 3)
    measurements = Measurements(np.zeros((60, 6)), np.zeros((60, 3)), pose_id=pose_id)
    folds = measurements.folds(5)
    assert sorted(np.concatenate(folds).tolist()) == list(range(60))
    for rows in folds:
        assert set(pose_id[rows]).isdisjoint(pose_id[np.setdiff1d(np.arange(60), rows)])
