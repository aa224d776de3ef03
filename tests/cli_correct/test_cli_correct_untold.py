"""``truepath correct`` leaves a target as it is, and says so, where its place or posture shows only in a run."""

import numpy as np
from urscript_poses import HOME

UNRESOLVED = """  movel(get_actual_tcp_pose(), a=1, v=0.1)
"""


def test_what_only_a_run_can_tell_stays_and_is_told(correct, weld, output):
    text = weld.replace("  set_digital_out(0, True)\n", UNRESOLVED)
    outcome = correct(text)
    assert outcome.code == 1
    assert "line 5: movel(get_actual_tcp_pose(), a=1, v=0.1)" in outcome.out
    assert UNRESOLVED in output.read_text()
    assert correct(text, "--allow-partial").code == 0
    content = correct(text, "--json").json()
    assert [each["line"] for each in content["unresolved"]] == [5]
    assert (content["targets"], content["corrected"]) == (4, 3)


def test_a_program_of_poses_only_needs_a_posture_to_start_from(correct, poses):
    text = f"def p():\n  set_tcp(p[0,0,0.12,0,0,0])\n  movel({poses[0]}, v=0.1)\nend\n"
    outcome = correct(text)
    assert outcome.code == 1
    assert "--start-deg" in outcome.out
    start = ",".join(f"{np.degrees(each):.1f}" for each in HOME)
    assert correct(text, f"--start-deg={start}").code == 0


TWICE = """def pick():
  movel(p[0.093022, -0.359454, 0.019153, -0.171982, 1.690211, 1.801271])
end
def prog():
  set_tcp(p[0, 0, 0, 0, 0, 0])
  movej([1.470356, -0.960435, 1.998879, -0.874187, -1.332254, -0.584063])
  pick()
  movej({second})
  pick()
end
prog()
"""
SAME_POSTURE = "[1.470356, -0.960435, 1.998879, -0.874187, -1.332254, -0.584063]"
OTHER_POSTURE = "[-1.170948, 1.797779, 1.997534, -0.868668, -2.301174, 2.452038]"


def test_a_pose_that_is_reached_in_two_postures_is_not_corrected_for_one_of_them(correct):
    """One correction cannot be right for both: in the other posture the real robot errs otherwise."""
    same = correct(TWICE.format(second=SAME_POSTURE), "--cell", "none", "--json").json()
    other = correct(TWICE.format(second=OTHER_POSTURE), "--cell", "none", "--json").json()
    assert same["unresolved"] == []
    assert [each["line"] for each in other["unresolved"]] == [2]


def test_what_follows_a_posture_that_cannot_be_told_cannot_be_told_either(correct, poses):
    text = f"def p():\n  movel({poses[0]})\n  movel({poses[1]})\n  movej({HOME})\n  movel({poses[1]})\nend\n"
    content = correct(text, "--tcp", "0,0,120,0,0,0", "--json").json()
    assert [each["line"] for each in content["unresolved"]] == [2, 3]


TIE = """def p():
  set_tcp(p[0, 0, 0, 0, 0, 0])
  movej([1.0, -0.83, 0.12, -0.74, -1.57, 0.5])
  movej(p[-0.487173, -0.109216, 0.431784, 2.220645, 2.220645, 0])
  movel(p[-0.487173, -0.059216, 0.431784, 2.220645, 2.220645, 0])
  movej([0, -1.6, 1.7, -1.65, -1.55, 0.1])
end
"""


def test_what_follows_a_tie_of_two_postures_is_not_corrected_for_a_guess(correct):
    content = correct(TIE, "--cell", "none", "--json").json()
    assert [each["line"] for each in content["unresolved"]] == [4, 5]
    assert content["corrected"] == 2
