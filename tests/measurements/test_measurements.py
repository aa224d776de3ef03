"""A measured data set as a value: its lines, its hash, its parts and its folds."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truepath.measurements import Measurements


def small(**more):
    N = 12
    rng = np.random.default_rng(0)
    return Measurements(q_rad=rng.normal(size=(N, 6)), p_ME=rng.normal(size=(N, 3)), **more)


def test_data_made_in_memory_numbers_its_lines_as_a_file_would(ur5):
    assert small().line.tolist() == list(range(2, 14))


def test_the_hash_of_data_in_memory_tells_different_data_apart():
    data = small()
    assert data.sha256 == small().sha256
    assert Measurements(q_rad=data.q_rad, p_ME=data.p_ME + 1e-9).sha256 != data.sha256
    assert Measurements(q_rad=data.q_rad + 1e-9, p_ME=data.p_ME).sha256 != data.sha256


@pytest.mark.parametrize("rows", [np.array([4, 0, 7]), np.arange(12) % 3 == 0], ids=["indices", "mask"])
def test_a_subset_takes_its_rows_out_of_every_column_and_keeps_what_is_common(rows):
    rng = np.random.default_rng(1)
    per_pose = {
        "R_ME": Rotation.random(12, rng=rng).as_matrix(),
        "time_s": np.arange(12.0),
        "temperature_c": rng.normal(size=12),
        "payload_kg": rng.normal(size=12),
        "approach": rng.integers(-1, 2, (12, 6)),
        "pose_id": np.arange(12) // 2,
        "line": np.arange(12) * 2 + 3,
    }
    data = small(**per_pose, X_MB_nominal=np.diag([1.0, 2, 3, 1]), source="f.csv", sha256="ab")
    part = data.subset(rows)
    for name in ("q_rad", "p_ME", *per_pose):
        np.testing.assert_array_equal(getattr(part, name), getattr(data, name)[rows], err_msg=name)
    assert part.X_MB_nominal is data.X_MB_nominal
    assert (part.source, part.sha256) == ("f.csv", "ab")


def test_a_subset_of_columns_that_are_not_there_has_none_either():
    part = small().subset(np.array([1, 2]))
    assert part.R_ME is None
    assert part.pose_id is None


def test_folds_share_out_every_row_once_in_parts_of_nearly_equal_size():
    folds = small().folds(5)
    assert sorted(np.concatenate(folds)) == list(range(12))
    assert sorted(map(len, folds)) == [2, 2, 2, 3, 3]


def test_folds_are_the_same_for_the_same_seed_and_others_for_another():
    first, again, other = (np.concatenate(small().folds(3, seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_visits_of_one_pose_stay_in_one_fold():
    data = small(pose_id=np.array([10, 10, 10, 3, 3, 7, 7, 7, 7, 99, 5, 5]))
    folds = data.folds(3)
    assert sorted(np.concatenate(folds)) == list(range(12))
    for k, fold in enumerate(folds):
        for other in folds[k + 1 :]:
            assert not set(data.pose_id[fold]) & set(data.pose_id[other])
