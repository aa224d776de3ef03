"""What a tracker sees, by hand."""

import numpy as np
import pytest
from truepath import lie
from truepath.errors import InputError
from truepath.planning.sight import stated_sight


def reflector(x, y, z, turn=(0.0, 0.0, 0.0)):
    return lie.make_pose(lie.from_rotation_vector(np.array(turn)), np.array([x, y, z], float))[None]


def sees(sight, X_WE):
    return bool(sight.sees(X_WE)[0])


def test_range_counts_from_the_tracker():
    sight = stated_sight("1,0,0", "0.5,2", 180.0, "z")
    assert sees(sight, reflector(2.9, 0, 0))
    assert not sees(sight, reflector(3.1, 0, 0))
    assert not sees(sight, reflector(1.4, 0, 0))


def test_a_reflector_must_face_the_tracker_within_its_cone():
    sight = stated_sight("0,0,3", "0.5,10", 30.0, "z")
    assert sees(sight, reflector(0, 0, 1))
    assert sees(sight, reflector(0, 0, 1, (np.radians(29), 0, 0)))
    assert not sees(sight, reflector(0, 0, 1, (np.radians(31), 0, 0)))
    assert not sees(sight, reflector(0, 0, 1, (np.pi, 0, 0)))


def test_the_axis_of_the_reflector_can_be_any_of_its_frame():
    sight = stated_sight("-3,0,0", "0.5,10", 30.0, "-x")
    assert sees(sight, reflector(0, 0, 0))
    assert not sees(sight, reflector(0, 0, 0, (0, 0, np.pi / 2)))


def test_a_tracker_that_cannot_turn_sees_a_cone_about_where_it_looks():
    sight = stated_sight("0,0,0", "0.5,10", 180.0, "z", "5,0,0", 10.0)
    assert sees(sight, reflector(2, 2 * np.tan(np.radians(9)), 0))
    assert not sees(sight, reflector(2, 2 * np.tan(np.radians(11)), 0))
    assert not sees(sight, reflector(-2, 0, 0))


def test_without_a_tracker_there_is_no_cone():
    assert stated_sight(None, "0.5,10", 30.0, "z") is None


@pytest.mark.parametrize(
    "stated",
    [
        ("1,2", "0.5,10", 30.0, "z"),
        ("1,2,up", "0.5,10", 30.0, "z"),
        ("1,2,nan", "0.5,10", 30.0, "z"),
        ("1,2,3", "10,0.5", 30.0, "z"),
        ("1,2,3", "0.5", 30.0, "z"),
        ("1,2,3", "0.5,10", 0.0, "z"),
        ("1,2,3", "0.5,10", 181.0, "z"),
        ("1,2,3", "0.5,10", 30.0, "w"),
        ("1,2,3", "0.5,10", 30.0, "z", None, 20.0),
        ("1,2,3", "0.5,10", 30.0, "z", "1,2,3", 20.0),
    ],
)
def test_what_makes_no_sense_is_refused(stated):
    with pytest.raises(InputError) as error:
        stated_sight(*stated)
    assert error.value.expected
