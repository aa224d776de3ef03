"""The text after new targets and added lines: every byte of it is stated here by hand."""

import numpy as np
import pytest
from scripts import read
from truepath.programs.program import NewTargets, Via

POSE, JOINTS = (0.4, -0.1, 0.2, 0.0, 3.1, 0.0), (0.1, -1.2, 1.3, -1.4, -1.5, 0.6)
SIX = "0.400000000, -0.100000000, 0.200000000, 0.000000000, 3.100000000, 0.000000000"
Q = "0.100000000, -1.200000000, 1.300000000, -1.400000000, -1.500000000, 0.600000000"
OLD, OLD_Q = "p[0.3, 0, 0.3, 0, 3, 0]", "[0, -1, 1, -1, -1, 0]"
START = f"movej({OLD_Q})\n"


def rewritten(text, at=0, values=POSE, is_pose=True, vias=(), header="", change=True):
    index = [at] if change else []
    count = len(index)
    new = NewTargets(
        np.array(index, int), np.array([values] * count).reshape(count, 6), np.full(count, is_pose),
        np.array([JOINTS] * count).reshape(count, 6),
    )  # fmt: skip
    raw = text if isinstance(text, bytes) else text.encode()
    out = read(raw).rewritten(new, vias, header)
    return out if isinstance(text, bytes) else out.decode()


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (f"movel({OLD}, 1, 0.1)\n", f"movel(p[{SIX}], 1, 0.1)\n"),
        (f"movel(v=0.1, pose={OLD}, a=1)", f"movel(v=0.1, pose=p[{SIX}], a=1)"),
        (f"\tmovel( {OLD} ,a=1)\t# {OLD}\r\n", f"\tmovel( p[{SIX}] ,a=1)\t# {OLD}\r\n"),
        (f"\ufeffmovel({OLD}) # ü\r\n", f"\ufeffmovel(p[{SIX}]) # ü\r\n"),
        (f"P = {OLD}\nmovel(P, a=1)\n", f"P = {OLD}\nmovel(p[{SIX}], a=1)\n"),
        ("movel(p[0.3,0,0.3,0,3,0],a=1)\n", f"movel(p[{SIX.replace(', ', ',')}],a=1)\n"),
        (f"movel(pose_trans({OLD}, {OLD}), a=1)\n", f"movel(p[{SIX}], a=1)\n"),
        ("movel(p[0.3, 0,\n  0.3, # z\n  0, 3, 0],\n  a=1)\n", f"movel(p[{SIX}],\n  a=1)\n"),
        (f"p = [{OLD}]\nmovel(p[0], a=1)\n", f"p = [{OLD}]\nmovel(p[{SIX}], a=1)\n"),
        (f"p = [{OLD}]\nmovel(p [0], a=1)\n", f"p = [{OLD}]\nmovel(p[{SIX}], a=1)\n"),
        (f"if a == 1: movel({OLD}) end\n", f"if a == 1: movel(p[{SIX}]) end\n"),
        (f"movel({OLD}) movel({OLD})\n", f"movel(p[{SIX}]) movel({OLD})\n"),
        (f"movej(get_inverse_kin({OLD}, qnear={OLD_Q}), a=1)", f"movej(get_inverse_kin(p[{SIX}], qnear={OLD_Q}), a=1)"),
        (f"movej(get_inverse_kin(qnear={OLD_Q}, x={OLD}))", f"movej(get_inverse_kin(qnear={OLD_Q}, x=p[{SIX}]))"),
        (
            f"q = get_inverse_kin({OLD})\nmovej(q)",
            f"q = get_inverse_kin({OLD})\nmovej(get_inverse_kin(p[{SIX}], qnear=[{Q}]))",
        ),
        (f"movej({OLD}, a=1)", f"movej(p[{SIX}], a=1)"),
        (f"movej({OLD_Q}, a=1)", f"movej(get_inverse_kin(p[{SIX}], qnear=[{Q}]), a=1)"),
        (f"servoj({OLD_Q}, t=0.008)", f"servoj(get_inverse_kin(p[{SIX}], qnear=[{Q}]), t=0.008)"),
        (f"movel({OLD_Q}, a=1)", f"movel(p[{SIX}], a=1)"),
    ],
)  # fmt: skip
def test_a_pose_is_written_where_the_target_was(before, after):
    assert rewritten(before) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (f"movej({OLD_Q}, a=1)", f"movej([{Q}], a=1)"),
        (f"movel({OLD}, a=1)", f"movel([{Q}], a=1)"),
        (f"movej(get_inverse_kin({OLD}, {OLD_Q}), a=1)", f"movej([{Q}], a=1)"),
        ("movej([0, d2r(-90), 1, -1, -1, 0], a=1)", f"movej([{Q}], a=1)"),
    ],
)
def test_joints_are_written_where_the_target_was(before, after):
    assert rewritten(before, values=JOINTS, is_pose=False) == after


def test_both_targets_of_an_arc_have_their_places():
    text = f"movec({OLD}, pose_to=p[0.5, 0, 0, 0, 3, 0], a=1)\n"
    assert rewritten(text, 0) == text.replace(OLD, f"p[{SIX}]")
    assert rewritten(text, 1) == text.replace("p[0.5, 0, 0, 0, 3, 0]", f"p[{SIX}]")


def test_bytes_that_are_no_text_stay():
    before = b"# \xff\xfe\x85\nmovel(" + OLD.encode() + b") # \xc3\x28\n"
    assert rewritten(before) == before.replace(OLD.encode(), f"p[{SIX}]".encode())


def test_what_is_nothing_after_rounding_has_no_sign():
    assert rewritten(f"movel({OLD})", values=(-1e-12,) * 6) == f"movel(p[{', '.join(['0.000000000'] * 6)}])"


def via(share=0.25, is_pose=True, blend=0.002, before=1):
    return Via(before, (POSE if is_pose else JOINTS,), is_pose, blend, share)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("last", [True, False])
def test_a_line_is_added_before_with_the_same_settings_indentation_and_line_end(end, last):
    text = f"{START}\t movel({OLD}, 1.2, v=0.25, r=0.001) # seam\n".replace("\n", end)
    text = text.removesuffix(end) if last else text
    added = f"\t movel(p[{SIX}], a=1.2, v=0.25, r=0.002000){end}"
    head = START.replace("\n", end)
    assert rewritten(text, vias=[via()], change=False) == head + added + text.removeprefix(head)


def test_a_stated_time_is_shared_out():
    text = f"{START}movel({OLD}, t=2.0)\n"
    expected = (
        f"{START}movel(p[{SIX}], t=0.250000*(2.0), r=0.002000)\n"
        f"movel(p[{SIX}], t=0.500000*(2.0), r=0.003000)\nmovel({OLD}, t=0.250000*(2.0))\n"
    )
    assert rewritten(text, vias=[via(), via(0.5, blend=0.003)], change=False) == expected


def test_a_time_of_zero_is_none():
    text = f"{START}movel({OLD}, 1, 0.1, 0, 0.01)\n"
    added = f"movel(p[{SIX}], a=1, v=0.1, t=0, r=0.002000)\n"
    assert rewritten(text, vias=[via()], change=False) == START + added + text.removeprefix(START)


def test_an_arc_is_divided_into_arcs():
    text = f"{START}movec({OLD}, {OLD}, a=1, v=0.1, r=0, mode=0)\n"
    arc = Via(1, (POSE, JOINTS), True, 0.001, 0.5)
    added = f"movec(p[{SIX}], p[{Q}], a=1, v=0.1, r=0.001000, mode=0)\n"
    assert rewritten(text, vias=[arc], change=False) == START + added + text.removeprefix(START)


def test_targets_and_lines_and_a_header_go_together():
    text = f"\ufeff{START}movel({OLD}, a=1)\n"
    expected = f"\ufeff# by us\n{START}movel([{Q}], a=1, r=0.002000)\nmovel([{Q}], a=1)\n"
    assert rewritten(text, 1, JOINTS, False, [via(is_pose=False)], "# by us") == expected


@pytest.mark.parametrize(
    ("text", "can"),
    [
        (f"movel({OLD})\n", True),
        (f"movel({OLD}) # alone\n", True),
        ("  movel(p[0.3,\n 0, 0, 0, 0, 0])\n", True),
        (f"if a: movel({OLD}) end\n", False),
        (f"sync() movel({OLD})\n", False),
        (f"x = movel({OLD})\n", False),
        (f"if a:\n movel({OLD})\nend\n", True),
        (f"def f(t):\n movel(t)\nend\nf({OLD})\nf(p[0.3, 0, 0.1, 0, 3, 0])\n", False),
    ],
)  # fmt: skip
def test_a_line_can_be_added_only_before_a_move_that_stands_alone(text, can):
    assert read(text).can_be_added_before(0) is can
