"""Clearances before and after a correction, compared by hand."""

import numpy as np
import pytest
from truepath.clearance import Clearances
from truepath.closer import (
    Closer,
    Driven,
    clearance_findings,
    collide_all_along,
    compare,
    driven_findings,
)

ARM_TABLE, TOOL_TABLE = ("arm", "table"), ("table", "tool")
INF = np.inf


def clearances(range_mm=11.0, **pairs_mm):
    """``TOOL_TABLE`` as ``tool``, ``ARM_TABLE`` as ``arm``."""
    names = {"tool": TOOL_TABLE, "arm": ARM_TABLE}
    table = np.array(list(pairs_mm.values()), float).T * 1e-3
    return Clearances(tuple(names[name] for name in pairs_mm), table, range_mm * 1e-3, len(table))


def kinds(places):
    return [(place.index, place.bodies, place.kind) for place in places]


def test_a_new_collision_is_found():
    before, after = clearances(tool=[3.0, INF, 0.5]), clearances(tool=[-0.5, -2.0, 0.4])
    assert compare(before, after) == [
        Closer(0, TOOL_TABLE, pytest.approx(0.003), pytest.approx(-0.0005), "new"),
        Closer(1, TOOL_TABLE, INF, pytest.approx(-0.002), "new"),
    ]


def test_a_collision_that_was_there_is_not_new():
    assert compare(clearances(tool=[-5.0]), clearances(tool=[-5.5])) == []
    assert kinds(compare(clearances(tool=[-5.0]), clearances(tool=[-6.5]))) == [(0, TOOL_TABLE, "closer")]


def test_what_lies_on_the_table_does_not_collide_with_it():
    assert compare(clearances(tool=[0.03]), clearances(tool=[-0.03])) == []


@pytest.mark.parametrize(
    ("before_mm", "after_mm", "found"),
    [(9.0, 7.9, True), (9.0, 8.1, False), (INF, 9.9, True), (10.9, 9.95, False), (INF, 10.5, False), (3.0, 9.0, False)],
)
def test_less_room_counts_where_there_is_little(before_mm, after_mm, found):
    assert bool(compare(clearances(tool=[before_mm]), clearances(tool=[after_mm]))) == found


def test_a_pair_that_is_always_close_hides_no_other():
    before = clearances(arm=[2.0], tool=[9.0])
    after = clearances(arm=[2.0], tool=[5.0])
    assert kinds(compare(before, after)) == [(0, TOOL_TABLE, "closer")]


def test_pairs_that_only_one_side_has_in_range():
    assert compare(clearances(arm=[2.0]), clearances(arm=[INF])) == []
    before, after = clearances(arm=[2.0]), clearances(tool=[4.0])
    assert kinds(compare(before, after)) == [(0, TOOL_TABLE, "closer")]


def test_what_comes_as_near_as_it_is_meant_to_is_left_out():
    before, after = clearances(tool=[8.0, 8.0]), clearances(tool=[5.0, 5.0])
    meant = clearances(tool=[5.2, 8.0])
    assert kinds(compare(before, after)) == [(0, TOOL_TABLE, "closer"), (1, TOOL_TABLE, "closer")]
    assert kinds(compare(before, after, meant)) == [(1, TOOL_TABLE, "closer")]


def test_a_collision_that_the_program_means_is_told_apart():
    before, after = clearances(tool=[1.0, 1.0]), clearances(tool=[-0.5, -0.5])
    meant = clearances(tool=[-0.4, 2.0])
    assert kinds(compare(before, after, meant)) == [(0, TOOL_TABLE, "meant"), (1, TOOL_TABLE, "new")]


def test_the_bounds_are_the_callers():
    before, after = clearances(51.0, tool=[40.0]), clearances(51.0, tool=[39.5])
    assert compare(before, after) == []
    assert kinds(compare(before, after, near_m=0.05, closer_m=0.0004)) == [(0, TOOL_TABLE, "closer")]


def test_clearances_that_cannot_be_compared_are_refused():
    with pytest.raises(ValueError, match="different numbers"):
        compare(clearances(tool=[1.0]), clearances(tool=[1.0, 2.0]))
    with pytest.raises(ValueError, match="must be up to"):
        compare(clearances(10.0, tool=[1.0]), clearances(tool=[1.0]))


def test_findings_carry_line_and_figures():
    before, after = clearances(tool=[INF, 9.0, 1.0]), clearances(tool=[-2.0, 6.0, -0.5])
    meant = clearances(tool=[INF, INF, -0.5])
    new, closer, as_meant = clearance_findings(compare(before, after, meant), line=np.array([12, 14, 17]))
    assert (new.level, new.guard, new.line, new.value, new.limit, new.unit) == (
        ("error", "collision", 12, pytest.approx(-2.0), 0.0, "mm")
    )
    assert new.message == "table and tool: 2.00 mm into each other after the correction, far apart before"
    assert (closer.level, closer.guard, closer.line, closer.limit) == ("warning", "clearance", 14, pytest.approx(10.0))
    assert closer.message == "table and tool: 6.00 mm apart after the correction, 9.00 mm apart before"
    assert (as_meant.level, as_meant.guard, as_meant.line) == ("warning", "collision", 17)
    assert as_meant.message.endswith("1.00 mm apart before; so does the program in the cell as drawn")


def test_what_collides_before_and_after_is_told_with_its_deepest_place_in_each_line():
    before = clearances(tool=[-3.0, -9.0, -4.0, 1.0, -2.0, -0.05], arm=[INF, -1.0, 5.0, 5.0, 5.0, 5.0])
    after = clearances(tool=[-3.1, -9.2, -4.1, -0.4, -2.1, -0.05], arm=[INF, -1.1, -0.2, 5.0, 5.0, 5.0])
    line = np.array([3, 3, 3, 4, 5, 6])
    driven = collide_all_along(before, after, line)
    assert driven == [
        Driven(1, TOOL_TABLE, pytest.approx(0.0092)),
        Driven(1, ARM_TABLE, pytest.approx(0.0011)),
        Driven(4, TOOL_TABLE, pytest.approx(0.0021)),
    ]
    first, *_ = findings = driven_findings(driven, line)
    assert first.message == (
        "the program itself drives table and tool 9.20 mm into each other; the correction does not change that"
    )
    assert (first.value, first.limit, first.unit) == (pytest.approx(-9.2), 0.0, "mm")
    assert [(each.level, each.guard, each.line) for each in findings] == [
        ("warning", "collision", 3),
        ("warning", "collision", 3),
        ("warning", "collision", 5),
    ]


def test_where_a_path_enters_the_deepest_place_is_told_with_the_first_touch():
    before, after = clearances(tool=[0.3, -20.0, -35.0]), clearances(tool=[-0.4, -20.5, -35.5])
    line = np.arange(3) + 1
    driven = collide_all_along(before, after, line)
    (touch,) = clearance_findings(compare(before, after), line, driven=driven)
    assert touch.level == "error"
    assert touch.message.endswith(
        "0.30 mm apart before; 35.50 mm deep at most, where the correction does not change that"
    )
    (elsewhere,) = clearance_findings(compare(before, after), line, driven=[Driven(2, ARM_TABLE, 0.1)])
    assert elsewhere.message.endswith("0.30 mm apart before")
