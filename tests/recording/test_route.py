"""Ways along a list of poses, worked out by hand."""

import itertools

import numpy as np
from truepath.recording.route import back_and_forth, route

LIST = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 2.0]])


def between(row, share):
    return LIST[row] + share * (LIST[row + 1] - LIST[row])


def rows(q_now, goal):
    found = route(LIST, np.asarray(q_now), goal)
    assert found.known
    return found.rows


def test_the_next_row_is_reached_from_the_way_to_it():
    assert rows(between(2, 0.4), 3) == (3,)
    assert rows(LIST[2], 3) == (3,)


def test_a_row_further_on_is_reached_through_those_before_it():
    assert rows(between(0, 0.5), 3) == (1, 2, 3)


def test_a_row_behind_is_passed_and_reached_again_from_its_own_side():
    assert rows(between(3, 0.5), 2) == (3, 2, 1, 2)


def test_a_pose_at_which_the_robot_stands_is_left_and_reached_anew():
    """From which side it had come nobody knows any more."""
    assert rows(LIST[2], 2) == (1, 2)


def test_the_first_pose_is_reached_anew_from_the_one_after_it():
    assert rows(LIST[0], 0) == (1, 0)


def test_where_all_rows_are_one_place_there_is_nowhere_to_go():
    assert route(LIST[[1, 1, 1]], LIST[1], 2).rows[-1] == 2


def test_the_first_row_is_reached_by_going_back():
    assert rows(between(1, 0.5), 0) == (1, 0)


def test_a_place_off_the_list_is_not_known_and_the_row_before_the_goal_comes_first():
    found = route(LIST, np.array([0.5, 0.7]), 3)
    assert not found.known
    assert found.rows == (2, 3)


def test_every_move_of_a_route_is_one_of_the_list():
    for place in (between(k, s) for k in range(4) for s in (0.0, 0.3, 1.0)):
        for goal in range(5):
            stops = [place, *LIST[list(rows(place, goal))]]
            for a, b in itertools.pairwise(stops):
                legs = [(LIST[k], LIST[k + 1]) for k in range(4)]
                assert any(on(a, leg) and on(b, leg) for leg in legs)


def on(q, leg):
    a, b = leg
    return np.isclose(np.abs(q - a).sum() + np.abs(b - q).sum(), np.abs(b - a).sum())


def test_rows_at_the_same_place_are_one_place_when_going_back():
    twice = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    assert back_and_forth(twice, 3, 2) == (2, 1, 0, 1, 2)
