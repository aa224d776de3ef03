"""Passages: which targets a stream of joints has come by. Paths are made by hand."""

from itertools import pairwise

import numpy as np
import pytest
from truepath.deploying.passages import Passages


def along(*corners, step=0.005, dwell=0):
    """Joints ``(B, 6)`` that go straight between corners of the first two joints, resting at each."""
    rows = [np.tile(corners[0], (dwell + 1, 1))]
    for start, end in pairwise(corners):
        count = max(int(np.ceil(np.abs(np.subtract(end, start)).max() / step)), 1)
        rows += [np.linspace(start, end, count + 1)[1:], np.tile(end, (dwell, 1))]
    path = np.zeros((sum(map(len, rows)), 6))
    path[:, :2] = np.concatenate(rows)
    return path


def goals(*points):
    q = np.zeros((len(points), 6))
    q[:, :2] = points
    return q


def passed(path, targets, blend_m=None, batch=7):
    passages = Passages(targets, np.zeros(len(targets)) if blend_m is None else np.array(blend_m))
    time_s = 0.008 * np.arange(len(path))
    for k in range(0, len(path), batch):
        passages.take(time_s[k : k + batch], path[k : k + batch])
    passages.take(time_s[-1:], path[-1:], ended=True)
    return passages


@pytest.mark.parametrize("batch", [1, 7, 10_000])
@pytest.mark.parametrize("dwell", [0, 30])
def test_targets_are_passed_in_order_where_they_are(batch, dwell):
    corners = [(0.0, 0.0), (0.3, 0.1), (0.3, -0.2), (0.0, 0.0)]
    found = passed(along(*corners, dwell=dwell), goals(*corners[1:]), batch=batch)
    assert found.count == 3
    assert np.abs(found.reached_rad - goals(*corners[1:])).max() < 1e-9
    assert (np.diff(found.time_s) > 0).all()


def test_a_target_between_two_samples_is_met_between_them():
    found = passed(along((0.0, 0.0), (0.4, 0.0), step=0.03), goals((0.2, 0.0), (0.4, 0.0)))
    assert found.reached_rad[0, 0] == pytest.approx(0.2, abs=1e-12)
    assert found.time_s[0] == pytest.approx(0.5 * found.time_s[1], rel=1e-9)


def test_what_was_reached_beside_a_target_is_told():
    found = passed(along((0.0, 0.002), (0.3, 0.002), (0.6, 0.002)), goals((0.3, 0.0)))
    assert found.reached_rad[0, :2] == pytest.approx([0.3, 0.002], abs=1e-9)


def test_a_blended_corner_is_passed_at_its_nearest():
    corner = along((0.0, 0.0), (0.25, 0.0), (0.3, 0.05), (0.3, 0.4))
    found = passed(corner, goals((0.3, 0.0), (0.3, 0.4)), blend_m=[0.01, 0.0])
    assert found.count == 2
    assert found.reached_rad[0, :2] == pytest.approx([0.275, 0.025], abs=0.003)


def test_a_target_that_was_not_met_stops_the_count():
    found = passed(along((0.0, 0.0), (0.5, 0.0)), goals((0.2, 0.0), (0.3, 0.5), (0.5, 0.0)))
    assert found.count == 1
    assert np.isnan(found.time_s[1:]).all()


def test_where_the_robot_stands_already_and_where_it_stays():
    found = passed(along((0.1, 0.1), (0.1, 0.1), dwell=20), goals((0.1, 0.1), (0.1, 0.1)))
    assert found.count == 2


def test_five_hundred_targets_close_together_are_all_met():
    s = np.linspace(0, 2 * np.pi, 500)
    points = np.column_stack([0.2 * np.cos(s), 0.1 * np.sin(2 * s)])
    found = passed(along(*points, step=0.0004), goals(*points))
    assert found.count == 500
    assert np.abs(found.reached_rad - goals(*points)).max() < 1e-6


def test_out_and_back_over_the_same_places_counts_twice():
    points = [(0.1, 0.0), (0.2, 0.0), (0.1, 0.0), (0.0, 0.0)]
    found = passed(along((0.0, 0.0), *points), goals(*points))
    assert found.count == 4
    assert (np.diff(found.time_s) > 0).all()


def test_after_a_gap_the_next_target_that_is_seen_counts_and_those_before_it_were_passed_unseen():
    corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3), (0.0, 0.6)]
    path, targets = along(*corners), goals(*corners[1:])
    time_s = 0.008 * np.arange(len(path))
    seen = (np.abs(path[:, :2] - corners[2]).max(axis=1) > 0.15) | (time_s == 0)
    passages = Passages(targets, np.zeros(4))
    passages.take(time_s[seen], path[seen], ended=True)
    assert passages.count == 4
    assert np.isnan(passages.time_s).tolist() == [False, True, False, False]
    assert np.abs(passages.reached_rad[[0, 2, 3]] - targets[[0, 2, 3]]).max() < 1e-9


def test_without_a_gap_no_target_is_left_out():
    corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3)]
    found = passed(along(*corners), goals((0.3, 0.0), (9.0, 9.0), (0.3, 0.3), (0.0, 0.3)))
    assert found.count == 1


def test_after_a_gap_the_place_where_the_robot_stands_is_no_later_target_for_which_there_was_no_time():
    home, away = (0.0, 0.0), [(0.5, 0.3), (0.8, 0.6), (1.1, 0.9)]
    path = along(home, home, (0.2, 0.12), dwell=60)
    time_s = 0.008 * np.arange(len(path))
    time_s[30:] += 0.15
    passages = Passages(goals(home, *away, home), np.zeros(5))
    passages.take(time_s, path)
    passages.take(time_s[-1:], path[-1:], ended=True)
    assert passages.count == 1


def test_what_was_nearest_while_nothing_was_seen_is_not_told_as_reached():
    path = along((0.0, 0.0), (0.3, 0.0), (0.3, 0.3))
    time_s = 0.008 * np.arange(len(path)) + np.where(path[:, 1] > 0, 0.2, 0.0)
    seen = np.abs(path[:, :2] - (0.3, 0.0)).max(axis=1) > 0.012
    passages = Passages(goals((0.3, 0.0), (0.3, 0.3)), np.zeros(2))
    passages.take(time_s[seen], path[seen], ended=True)
    assert passages.count == 2
    assert np.isnan(passages.time_s).tolist() == [True, False]
