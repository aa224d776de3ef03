"""Circles and arcs against ones drawn by hand."""

import numpy as np
import pytest
from hand_made import ARC, JOINT, LINEAR, THROUGH, at, motions, plan_of
from scipy.spatial.transform import Rotation
from truepath.rewriting.arcs import arc_through, arcs_of, circle_through


def on_circle(degrees, centre=(0.4, -0.3, 0.2), radius=0.12, tilt=(0.3, -0.8, 0.5)):
    """Points of a circle that lies askew, and its axis."""
    angle = np.radians(np.atleast_1d(degrees))
    flat = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    turn = Rotation.from_rotvec(tilt)
    return np.array(centre) + turn.apply(flat), turn.apply([0.0, 0.0, 1.0])


@pytest.mark.parametrize("degrees", [(0, 90, 180), (10, 15, 20), (-170, 20, 150), (0, 200, 350), (40, 10, -30)])
def test_a_circle_is_found_from_three_of_its_points(degrees):
    points, axis = on_circle(degrees)
    circle = circle_through(*points)
    assert circle.centre == pytest.approx([0.4, -0.3, 0.2], abs=1e-9)
    assert circle.radius_m == pytest.approx(0.12, abs=1e-9)
    turns_right = (degrees[1] - degrees[0]) % 360 < (degrees[2] - degrees[0]) % 360
    assert circle.axis == pytest.approx(axis if turns_right else -axis, abs=1e-9)


@pytest.mark.parametrize("degrees", [(0, 30, 60), (0, 100, 200), (0, 10, 350), (90, 20, -200), (0, -5, -10)])
def test_an_arc_goes_through_the_middle_and_ends_at_its_end(degrees):
    points, _ = on_circle(degrees)
    arc = arc_through(*points)
    turn = degrees[2] - degrees[0]
    assert arc.angle_rad == pytest.approx(np.radians(abs(turn)), abs=1e-9)
    assert arc.length_m == pytest.approx(0.12 * np.radians(abs(turn)), abs=1e-9)
    share = np.array([0.0, 0.25, 0.5, 1.0])
    assert arc.points(share) == pytest.approx(on_circle(degrees[0] + share * turn)[0], abs=1e-9)
    middle = (degrees[1] - degrees[0]) / turn
    assert arc.points(np.array([middle]))[0] == pytest.approx(points[1], abs=1e-9)


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0, 0), (0.1, 0, 0), (0.3, 0, 0)],
        [(0, 0, 0), (0.3, 0.3, 0.3), (0.1, 0.1, 0.1)],
        [(0, 0, 0), (0, 0, 0), (0.1, 0, 0)],
        [(0, 0, 0), (0.1, 0, 0), (0, 0, 0)],
        [(0.2, 0, 0), (0.2, 0, 0), (0.2, 0, 0)],
    ],
)
def test_points_on_a_line_make_no_circle(points):
    assert circle_through(*np.array(points, float)) is None
    assert arc_through(*np.array(points, float)) is None


def test_the_distance_from_a_circle():
    circle = circle_through(*np.array([[0.1, 0, 0], [0, 0.1, 0], [-0.1, 0, 0]]))
    points = np.array([[0.1, 0, 0], [0.13, 0, 0], [0, 0.06, 0.03], [0, 0, 0], [0.1, 0, -0.02]])
    assert circle.distance(points) == pytest.approx([0, 0.03, 0.05, 0.1, 0.02], abs=1e-12)


def test_arcs_of_a_program_and_those_that_are_none():
    points, _ = on_circle([0, 60, 120])
    poses = [at(*p) for p in points] + [at(0.1 * k, 0, 0) for k in range(3)]
    kinds = [LINEAR, THROUGH, ARC, LINEAR, THROUGH, ARC]
    plan = plan_of(motions(kinds, poses))
    arcs, findings = arcs_of(plan, np.array(poses))
    assert list(arcs) == [2]
    assert (arcs[2].start, arcs[2].through) == (0, 1)
    assert arcs[2].angle_rad == pytest.approx(np.radians(120))
    assert [(finding.level, finding.line) for finding in findings] == [("warning", 15)]
    assert "no arc" in findings[0].message


def test_an_arc_whose_start_is_not_known_is_left_alone():
    points, _ = on_circle([0, 60, 120])
    poses = [at(*p) for p in points]
    for previous in ([-1, -1, 1], [-1, 0, -1]):
        plan = plan_of(motions([JOINT, THROUGH, ARC], poses, previous=previous))
        assert arcs_of(plan, np.array(poses)) == ({}, [])
