"""Programs and their truth, and what a reader makes of them."""

import json
import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from truepath.programs.motions import Kind
from truepath.programs.program import NewTargets
from truepath.programs.urscript.script import parse_script

CORPUS = Path(__file__).with_name("corpus")
SCRIPTS = sorted(CORPUS.glob("*.script"))
NUMBERS = {"speed": "speed", "acceleration": "acceleration", "time_s": "time_s", "blend_m": "blend_m"}
NINE = r"-?\d+\.\d{9}"
SIX = rf"\[{NINE}(?:, ?{NINE}){{5}}\]"
WRITTEN = re.compile(rf"get_inverse_kin\(p{SIX}, qnear={SIX}\)|p?{SIX}".encode())


def expected_of(script):
    """What the program means, as in the corpus' README."""
    return json.loads((CORPUS / "expected" / f"{script.stem}.json").read_text())


def pose_matrix(pose):
    """``(4, 4)`` of position and rotation vector."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec(pose[3:]).as_matrix(), pose[:3]
    return X


def faults(parsed, expected):
    """Sentences about what was read otherwise than expected; none if all agrees."""
    motions, wrong = parsed.motions, []
    optional = {target["line"] for target in expected["optional"]}
    found = [at for at in range(len(motions)) if motions.line[at] not in optional]
    places = [(int(motions.line[at]), Kind(motions.kind[at]).name.lower()) for at in found]
    wanted = [(target["line"], target["kind"]) for target in expected["targets"]]
    if places != wanted:
        return [f"targets {sorted(set(places) ^ set(wanted))}"]
    lines = {each.line for each in parsed.unresolved}
    unresolved = {each["line"] for each in expected["unresolved"]}
    if lines - optional != unresolved:
        wrong.append(f"unresolved lines {sorted((lines - optional) ^ unresolved)}")
    several = [target for target in expected["optional"] for at in _at(motions, target) if not _is(motions, at, target)]
    wrong += [f"line {target['line']} is read as something else" for target in several]
    for at, target in zip(found, expected["targets"], strict=True):
        if not _is(motions, at, target):
            wrong.append(f"line {target['line']}: target or tool")
        for name in NUMBERS:
            if name in target and not np.isclose(getattr(motions, name)[at], target[name], rtol=0, atol=1e-12):
                wrong.append(f"line {target['line']}: {name} {getattr(motions, name)[at]}")
        near = target.get("near")
        if not np.allclose(
            motions.q_near_rad[at], np.nan if near is None else near, rtol=0, atol=1e-12, equal_nan=True
        ):
            wrong.append(f"line {target['line']}: near")
    return wrong


def _at(motions, target):
    kind = Kind[target["kind"].upper()]
    return [at for at in range(len(motions)) if motions.line[at] == target["line"] and motions.kind[at] == kind]


def _is(motions, at, target):
    tool = np.allclose(motions.X_0T[at], pose_matrix(target["tool"]), rtol=0, atol=1e-9)
    if "joints" in target:
        return tool and np.allclose(motions.q_rad[at], target["joints"], rtol=0, atol=1e-9)
    return tool and np.allclose(motions.X_CT[at], pose_matrix(target["pose"]), rtol=0, atol=1e-9)


def nothing_new():
    """No target is to be written."""
    return NewTargets(np.zeros(0, int), np.zeros((0, 6)), np.zeros(0, bool), np.zeros((0, 6)))


def new_targets(motions, seed=0, form=None):
    """Other numbers for all targets; as they are held, or all as ``joints`` or ``poses``."""
    values = np.random.default_rng(seed).uniform(-0.9, 0.9, (len(motions), 6)).round(9)
    is_pose = motions.is_pose if form is None else np.full(len(motions), form == "poses")
    return NewTargets(np.arange(len(motions)), values, is_pose, values[:, ::-1].copy())


def read(text, **options):
    """A program from text or bytes."""
    return parse_script(text if isinstance(text, bytes) else text.encode(), "p.script", **options)


def differs_elsewhere(old, new, values):
    """Whether the bytes differ in anything but lists of these values, which stand for something within a line."""
    stated = {tuple(f"{number:.9f}" for number in row) for row in values.tolist()}
    pieces, known = [], 0
    for match in WRITTEN.finditer(new):
        if tuple(re.findall(NINE, match[0].decode())[:6]) in stated:
            pieces.append(new[known : match.start()])
            known = match.end()
    pattern = rb"[^\r\n]+?".join(re.escape(piece) for piece in [*pieces, new[known:]])
    return len(pieces) < 1 or re.fullmatch(pattern, old) is None
