"""Which targets are added, on ways whose bends are drawn by hand."""

from itertools import pairwise

import numpy as np
import pytest
from hand_made import ARC, JOINT, LINEAR, THROUGH, at, motions, plan_of, ways_of
from truepath.rewriting.arcs import arc_through
from truepath.rewriting.vias import choose_vias
from truepath.rewriting.ways import ARC_STEPS

LENGTH, SAMPLES = 0.4, 39


def off_chord(points, one, two):
    """``(K,)`` distances in mm from the line through two of the points, those between them."""
    along = points[two] - points[one]
    between = points[one + 1 : two] - points[one]
    return 1e3 * np.linalg.norm(np.cross(between, along), axis=1) / np.linalg.norm(along)


def bends(shape):
    """A way along x, 0.4 m long, that leaves it sideways by ``shape(share)`` mm; ends included."""
    share = np.linspace(0, 1, SAMPLES + 2)
    y, z = shape(share)
    return np.stack([LENGTH * share, 1e-3 * y, 1e-3 * z], axis=1)


SHAPES = {
    "bow": lambda s: (0.6 * np.sin(np.pi * s), 0 * s),
    "wave": lambda s: (0.3 * np.sin(3 * np.pi * s), 0.1 * np.sin(5 * np.pi * s)),
    "ramp": lambda s: (2.0 * s**3, -1.0 * s**2),
    "kink": lambda s: (np.where(s < 0.7, 0.0, 3.0 * (s - 0.7)), 0 * s),
}


def choose(points, tolerance_mm, blend_m=None, may_add=lambda at: True):
    ends = np.array([at(*points[0]), at(*points[-1])])
    plan = plan_of(motions([JOINT, LINEAR], ends, blend_m=blend_m))
    return choose_vias(plan, ways_of([0], [1], [points[1:-1]]), ends, tolerance_mm, may_add)


@pytest.mark.parametrize("tolerance_mm", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("name", SHAPES)
def test_every_piece_is_within_the_tolerance_and_no_target_can_be_spared(name, tolerance_mm):
    points = bends(SHAPES[name])
    vias = choose(points, tolerance_mm)
    places = [0, *(via.samples[0] + 1 for via in vias.added), len(points) - 1]
    assert len(places) > 2
    assert places == sorted(places)
    off = [off_chord(points, *piece).max(initial=0.0) for piece in pairwise(places)]
    assert max(off) <= tolerance_mm
    assert vias.after_mm[0] == pytest.approx(max(off), abs=1e-9)
    assert vias.before_mm[0] == pytest.approx(off_chord(points, 0, len(points) - 1).max(), abs=1e-9)
    for before, after in zip(places, places[2:], strict=False):
        assert off_chord(points, before, after).max() > tolerance_mm


@pytest.mark.parametrize("name", SHAPES)
def test_nothing_is_added_where_the_way_is_within_the_tolerance(name):
    points = bends(SHAPES[name])
    off = off_chord(points, 0, len(points) - 1).max()
    assert choose(points, 1.001 * off).added == []
    assert choose(points, 0.999 * off).added != []


def test_a_straight_way_needs_nothing_even_with_hardly_any_tolerance():
    vias = choose(bends(lambda s: (0 * s, 0 * s)), 1e-9)
    assert vias.added == []
    assert vias.after_mm == pytest.approx(0, abs=1e-10)


def test_with_no_tolerance_every_sample_is_added_but_perhaps_those_at_the_very_ends():
    vias = choose(bends(SHAPES["bow"]), 0.0)
    assert {via.samples[0] for via in vias.added} >= set(range(1, SAMPLES - 1))


def test_nothing_is_added_without_a_tolerance_or_where_no_line_can_be():
    points = bends(SHAPES["bow"])
    for vias in (choose(points, None), choose(points, 0.05, may_add=lambda at: False)):
        assert vias.added == []
        assert vias.before_mm[0] == vias.after_mm[0] == pytest.approx(0.6, abs=1e-3)


@pytest.mark.parametrize("start_m", [0.0, 0.004, 0.1, 0.18])
@pytest.mark.parametrize("end_m", [np.nan, 0.02, 0.15, 0.18])
@pytest.mark.parametrize("name", ["bow", "wave"])
def test_no_blend_reaches_into_another(name, start_m, end_m):
    points = bends(SHAPES[name])
    vias = choose(points, 0.02, blend_m=[start_m, end_m])
    assert vias.added
    places = [0, *(via.samples[0] + 1 for via in vias.added), len(points) - 1]
    radii = [start_m, *(via.blend_m for via in vias.added), float(np.nan_to_num(end_m))]
    assert all(radius >= 0 for radius in radii)
    for (one, two), (r_one, r_two) in zip(pairwise(places), pairwise(radii), strict=True):
        assert r_one + r_two < np.linalg.norm(points[two] - points[one])
    assert max(via.blend_m for via in vias.added) <= 0.010


def test_the_shares_of_the_way_are_where_the_targets_are():
    points = bends(SHAPES["bow"])
    vias = choose(points, 0.05)
    places = [0, *(via.samples[0] + 1 for via in vias.added)]
    expected = np.diff([points[place, 0] / LENGTH for place in places])
    assert [via.share for via in vias.added] == pytest.approx(expected, abs=1e-9)
    assert sum(via.share for via in vias.added) < 1


def test_several_ways_each_get_their_own():
    bow, straight, wave = (bends(shape) for shape in (SHAPES["bow"], lambda s: (0 * s, 0 * s), SHAPES["wave"]))
    ends = np.array([at(*p[0]) for p in (bow,)] + [at(*p[-1]) for p in (bow, straight, wave)])
    ends[0, :3, 3] = bow[0]
    plan = plan_of(motions([JOINT, LINEAR, LINEAR, LINEAR], ends))
    ways = ways_of([0, 0, 0], [1, 2, 3], [each[1:-1] for each in (bow, straight, wave)])
    vias = choose_vias(plan, ways, ends, 0.05, lambda at: True)
    assert {via.target for via in vias.added} == {1, 3}
    assert vias.before_mm[1] == pytest.approx(0, abs=1e-9)
    alone = choose(bow, 0.05)
    assert [via.samples for via in vias.added if via.target == 1] == [via.samples for via in alone.added]
    offset = 2 * SAMPLES
    assert [via.samples[0] - offset for via in vias.added if via.target == 3] == [
        via.samples[0] for via in choose(wave, 0.05).added
    ]


def bent_arc(waves_mm, cycles, radius=0.1, turn=1.5 * np.pi):
    """An arc about z, whose commanded points leave it by waves along the radius; its ends and its middle included."""
    share = np.linspace(0, 1, ARC_STEPS + 1)
    angle = share * turn
    r = radius + 1e-3 * waves_mm * np.sin(cycles * angle)
    points = np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r], axis=1)
    ideal = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return points, arc_through(ideal[0], ideal[ARC_STEPS // 2], ideal[-1], 0, 1)


def choose_on_arc(points, arc, tolerance_mm, blend_m=None):
    ends = np.array([at(*points[0]), at(*points[ARC_STEPS // 2]), at(*points[-1])])
    plan = plan_of(motions([JOINT, THROUGH, ARC], ends, blend_m=blend_m))
    ways = ways_of([0], [2], [points[1:-1]], {0: arc})
    return choose_vias(plan, ways, ends, tolerance_mm, lambda at: True)


def off_circle(points):
    """Largest distance, mm, of points from the circle through the first, the middle and the last, in their plane."""
    one, two, three = (points[k, 0] + 1j * points[k, 1] for k in (0, len(points) // 2, -1))
    w = (three - one) / (two - one)
    centre = (two - one) * (w - abs(w) ** 2) / (2j * w.imag) + one
    return 1e3 * np.abs(np.abs(points[:, 0] + 1j * points[:, 1] - centre) - abs(one - centre)).max()


@pytest.mark.parametrize("cycles", [1.3, 2.2, 3.4])
def test_an_arc_is_divided_into_arcs_that_stay_within_the_tolerance(cycles):
    points, arc = bent_arc(0.3, cycles)
    vias = choose_on_arc(points, arc, 0.05)
    assert vias.added
    places = [0, *(via.samples[1] + 1 for via in vias.added), ARC_STEPS]
    middles = [via.samples[0] + 1 for via in vias.added] + [vias.through[1] + 1]
    assert middles == [(one + two) // 2 for one, two in pairwise(places)]
    off = max(off_circle(points[one : two + 1]) for one, two in pairwise(places))
    assert off <= 0.05
    assert vias.after_mm[0] == pytest.approx(off, abs=1e-9)
    assert vias.before_mm[0] == pytest.approx(off_circle(points), abs=1e-9)
    assert sum(via.share for via in vias.added) + 1 / (len(vias.added) + 1) == pytest.approx(1)


def test_a_round_arc_is_left_as_it_is():
    vias = choose_on_arc(*bent_arc(0.0, 1), 1e-6)
    assert (vias.added, vias.through) == ([], {})


@pytest.mark.parametrize("end_m", [np.nan, 0.02, 0.08, 0.2])
def test_blends_on_an_arc_are_small_and_meet_no_other(end_m):
    points, arc = bent_arc(0.3, 3.4)
    tolerance_mm = 0.05
    vias = choose_on_arc(points, arc, tolerance_mm, blend_m=[0.01, np.nan, end_m])
    part = arc.length_m / (len(vias.added) + 1)
    for via in vias.added:
        assert via.blend_m**2 / (4 * 0.1) <= 0.25e-3 * tolerance_mm  # what a parabola cuts off
        assert via.blend_m + max(0.01, float(np.nan_to_num(end_m))) < part
        assert 2 * via.blend_m < part
    if end_m == 0.2:
        assert part > 0.2
