"""The truth that the parser is tested against: the corpus of programs, the generator, and the spoilers.

The corpus was written together with its numbers; here runs of the programs and Drake's kinematics are asked too.
"""

import json
import random
import re
from pathlib import Path

import generate
import numpy as np
import pytest
import spoil
from drake_arm import DrakeArm
from generate import mutated, program, programs
from hypothesis import given, settings
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation
from spoil import mutate
from truepath.inverse import solve
from truepath.model import nominal_model
from urscript_runs import FUNCTIONS, MOVES, differences, matrix

CORPUS = Path(__file__).with_name("corpus")
SCRIPTS = sorted(CORPUS.glob("*.script"))
KINDS = {"joint": "movej", "linear": "movel", "process": "movep", "through": "movec", "arc": "movec", "servo": "servoj"}
NUMBERS = {"speed", "acceleration", "time_s", "blend_m"}
MICROMETRE, MICRORADIAN = 1e-6, 1e-6


def text_of(script):
    return script.read_bytes().decode()


def expected_of(script):
    return json.loads((CORPUS / "expected" / f"{script.stem}.json").read_text())


def all_targets(expected):
    return [*expected["targets"], *expected["optional"]]


@pytest.fixture(scope="module")
def arms():
    """Function: the nominal arm of a name, in Drake."""
    known = {}
    return lambda name: known.setdefault(name, DrakeArm(name))


def truth_of(made):
    unresolved = [{"line": line} for line in made.unresolved_lines]
    return {"targets": made.targets, "optional": [], "unresolved": unresolved, "not_run": made.not_run_lines}


def rotation_vector(R):
    return Rotation.from_matrix(R.matrix()).as_rotvec()


def drake_pose(pose):
    angle = np.linalg.norm(pose[3:])
    R = RotationMatrix(Rotation.from_rotvec(pose[3:]).as_matrix()) if angle else RotationMatrix()
    return RigidTransform(R, pose[:3])


# --- the corpus


def test_many_programs_each_with_its_truth_and_a_line_in_the_readme():
    readme = (CORPUS / "README.md").read_text()
    assert len(SCRIPTS) >= 36
    assert {s.stem for s in SCRIPTS} == {p.stem for p in (CORPUS / "expected").glob("*.json")}
    assert set(re.findall(r"^\| `(\w+)` \|", readme, re.M)) >= {s.stem for s in SCRIPTS}
    assert all(10 <= len(text_of(s).split("\n")) <= 300 for s in SCRIPTS)


def test_the_corpus_has_the_bytes_that_people_trip_over():
    content = [s.read_bytes() for s in SCRIPTS]
    for pattern in (
        *(
            rb"\r\n",
            rb"\A\xef\xbb\xbf",
            rb"[^\n]\Z",
            rb"\t",
            rb"[ \t]+\r?\n",
            rb"[\xc3-\xf0]",
            rb"\n[ \t]+\r?\n",
            rb":=",
        ),
        *("\u2028".encode(), rb"[^\n]{10000}", rb"\n\n", rb"thread ", rb"sec ", rb"elif", rb"\"[^\"\n]*movel\("),
    ):
        assert any(re.search(pattern, c) for c in content), pattern
    assert any(b"\r\n" in c and not re.search(rb"[^\r]\n", c) for c in content)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda s: s.stem)
def test_the_truth_is_well_formed(script):
    expected, lines = expected_of(script), re.split(r"\r?\n", text_of(script))
    assert list(expected) == ["about", "robot", "targets", "unresolved", "optional", "not_run"]
    assert [t["line"] for t in expected["targets"]] == sorted(t["line"] for t in expected["targets"])
    for target in all_targets(expected):
        known = {"line", "kind", "joints", "pose", "near", "tool", "reached_at", "moved_by", *NUMBERS}
        assert set(target) <= known
        assert ("joints" in target) != ("pose" in target)
        assert ("pose" in target) == ("reached_at" in target)
        for name in {"joints", "pose", "near", "tool", "reached_at"} & set(target):
            assert np.isfinite(target[name]).all()
            assert len(target[name]) == 6
        assert all(target[name] >= 0 for name in NUMBERS & set(target))
        move = target.get("moved_by", target["line"])
        assert KINDS[target["kind"]] + "(" in lines[move - 1].replace(" ", "")
    places = [all_targets(expected), expected["unresolved"], [{"line": n} for n in expected["not_run"]]]
    places = [{entry["line"] for entry in entries} for entries in places]
    assert sum(map(len, places)) == len(set.union(*places))
    for number in places[1] | places[2]:
        assert re.search("|".join(MOVES), lines[number - 1])


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda s: s.stem)
def test_runs_of_the_program_show_the_expected_targets(script, arms):
    expected = expected_of(script)
    arm = arms(expected["robot"])
    assert differences(text_of(script), expected, lambda q: arm.flange_poses(q)[0]) == []


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda s: s.stem)
def test_drake_reaches_the_poses(script, arms):
    expected = expected_of(script)
    arm = arms(expected["robot"])
    targets = all_targets(expected)
    q = np.array([t.get("joints", t.get("reached_at")) for t in targets]).reshape(-1, 6)
    assert (np.abs(q) <= 2 * np.pi).all()
    for target, X_BF in zip(targets, arm.flange_poses(q) if len(q) else [], strict=True):
        if "pose" in target:
            missing = RigidTransform(X_BF @ matrix(target["tool"])).InvertAndCompose(drake_pose(target["pose"]))
            assert np.linalg.norm(missing.translation()) < MICROMETRE
            assert np.linalg.norm(rotation_vector(missing.rotation())) < MICRORADIAN


def test_every_kind_and_every_way_to_be_unresolved_is_there():
    everything = [expected_of(s) for s in SCRIPTS]
    assert {t["kind"] for e in everything for t in e["targets"]} == set(KINDS)
    assert sum(bool(e["unresolved"]) for e in everything) >= 10
    assert sum(bool(e["not_run"]) for e in everything) >= 2
    assert {e["robot"] for e in everything} == {"ur5", "ur10"}


# --- the runs: they must be able to find fault, and know their poses


def tampered(expected, how):
    expected = json.loads(json.dumps(expected))
    how(expected)
    return expected


@pytest.mark.parametrize(
    "how",
    [
        lambda e: e["targets"][3].update(pose=[e["targets"][3]["pose"][0] + 1e-7, *e["targets"][3]["pose"][1:]]),
        lambda e: e["targets"][2].update(tool=[0.0, 0.0, 0.15, 0.0, 0.0, 1e-6]),
        lambda e: e["targets"][1].update(line=e["targets"][1]["line"] + 1),
        lambda e: e["targets"][1].update(speed=e["targets"][1]["speed"] + 1e-6),
        lambda e: e["targets"].pop(),
        lambda e: e["unresolved"].append({"line": e["targets"].pop(1)["line"]}),
        lambda e: e["unresolved"].pop(),
        lambda e: e["targets"].append({**e["targets"][1], "line": e["unresolved"].pop()["line"]}),
    ],
)
def test_a_false_truth_is_found_out(how):
    script = CORPUS / "tool_changes.script"
    assert differences(text_of(script), tampered(expected_of(script), how)) != []


def test_pose_functions_are_those_of_the_manual_and_of_drake():
    rng = np.random.default_rng(3)
    for a, b in rng.uniform(-1, 1, (20, 2, 6)):
        X, Y = drake_pose(a), drake_pose(b)
        wanted = {
            "pose_trans": X @ Y,
            "pose_inv": X.inverse(),
            "pose_add": RigidTransform(X.rotation() @ Y.rotation(), X.translation() + Y.translation()),
        }
        for name, pose in wanted.items():
            arguments = (a,) if name == "pose_inv" else (a, b)
            for make in {FUNCTIONS[name], getattr(generate, name, FUNCTIONS[name])}:
                np.testing.assert_allclose(matrix(make(*arguments)), pose.GetAsMatrix4(), atol=1e-12)
    # The worked example of the script manual; a rotation of 3.14 has two vectors that are nearly the same rotation.
    manual = FUNCTIONS["pose_add"]([0.2, 0.5, 0.1, 1.57, 0, 0], [0.2, 0.5, 0.6, 1.57, 0, 0])
    np.testing.assert_allclose(manual, [0.4, 1.0, 0.7, 3.14, 0, 0], atol=1e-12)


# --- the generator


@settings(max_examples=150)
@given(programs())
def test_runs_of_generated_programs_show_what_was_constructed(made):
    assert differences(made.text, truth_of(made), enough=6) == []


def test_generated_programs_are_varied():
    made = [program(seed) for seed in range(60)]
    assert {t["kind"] for m in made for t in m.targets} == set(KINDS)
    assert sum(bool(m.unresolved_lines) for m in made) > 20
    assert sum(bool(m.not_run_lines) for m in made) > 5
    text = "\n".join(m.text for m in made)
    for word in ("while", "elif", "else", "def", "thread", "pose_trans", "pose_add", "get_inverse_kin", "d2r", "\r\n"):
        assert word in text
    assert any(m.text.startswith("\ufeff") for m in made)
    assert any(not m.text.endswith("\n") for m in made)
    assert re.search(
        r"(?m)^(\t| +)(while|if) .*\n(?:(?!\s*end\b).*\n)*\s+(while|if) .*\n(?:(?!\s*end\b).*\n)*\s+(while|if) ", text
    )
    assert program(7) == program(7)


def test_generated_poses_can_be_reached(ur5):
    targets = [t for seed in range(25) for t in program(seed).targets]
    poses = [t for t in targets if "pose" in t]
    assert len(poses) > 100
    goals = np.array([matrix(t["pose"]) @ np.linalg.inv(matrix(t["tool"])) for t in poses])
    starts = np.broadcast_to(generate.HOME, (len(goals), 6))
    found = solve(nominal_model(ur5).flange_poses_and_jacobian, goals, starts, max_iterations=80)
    assert found.converged.all()
    assert (np.abs(found.q_rad) < 2 * np.pi).all()
    assert (found.smallest_singular_value > 0.01).all()


# --- the spoilers


@pytest.mark.parametrize("wound", [*spoil.SMALL, *spoil.LARGE], ids=lambda f: f.__name__.strip("_"))
def test_each_spoiler_spoils(wound):
    good = program(11).data
    spoilt = [wound(good, random.Random(seed)) for seed in range(20)]
    assert all(isinstance(s, bytes) for s in spoilt)
    assert len({s for s in spoilt if s != good}) >= 10
    assert [wound(good, random.Random(3)) for _ in range(2)] == [spoilt[3]] * 2


def test_the_wounds_are_those_that_were_asked_for():
    good = program(11).data
    spoilt = [mutate(good, random.Random(seed)) for seed in range(1500)]
    assert any(max(map(len, s.split(b"\n"))) > 900_000 for s in spoilt)
    assert any(b"(" * 10_000 in s or b"[" * 10_000 in s for s in spoilt)
    for wound in (b"\x00", b"nan", b"inf", b"1e999", b"\xff\xfe", b"9" * 400):
        assert any(wound in s for s in spoilt), wound
    assert any(len(s) < len(good) / 2 for s in spoilt)
    assert sum(s == good for s in spoilt) < 75


@settings(max_examples=30)
@given(mutated())
def test_spoilt_programs_are_bytes(data):
    assert isinstance(data, bytes)


def test_the_smallest_files_can_be_spoilt():
    for text in ("", "\n", "a", b"\xff"):
        for seed in range(50):
            assert isinstance(mutate(text, random.Random(seed)), bytes)
