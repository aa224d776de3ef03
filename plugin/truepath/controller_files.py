"""The two files in which the factory calibration of a Universal Robot comes; neither is trusted."""

from __future__ import annotations

import configparser
from pathlib import Path

import numpy as np
import yaml

from truepath import lie
from truepath.errors import InputError
from truepath.lie import Array
from truepath.ur_models import AtZero

MAX_BYTES = 1 << 20
MAX_NUMBER = 1e4  # rad, m; parallel axes give lengths of 100 m that cancel
DELTAS = ("delta_theta", "delta_a", "delta_d", "delta_alpha")
LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
NUMBERS = ("x", "y", "z", "roll", "pitch", "yaw")


def read_calibration_conf(path: str | Path) -> Array:
    """What the controller adds to its Denavit-Hartenberg parameters: ``(4, 6)`` theta, a, d, alpha in rad and m.

    The file is ``calibration.conf`` from the controller. Its section ``[mounting]`` holds a list of six numbers each
    for ``delta_theta``, ``delta_a``, ``delta_d``, ``delta_alpha``; what else is in it does not move the arm.

    Raises:
        InputError: no such file, not of this form, or a number that is none.
    """
    path = Path(path)
    text = _text(path)
    parser = configparser.RawConfigParser(inline_comment_prefixes=("#",), default_section="no defaults")
    try:
        parser.read_string(text)
    except configparser.Error as error:
        several = getattr(error, "errors", None)
        line = several[0][0] if several else getattr(error, "lineno", None)
        raise InputError(
            "this is no calibration.conf",
            file=path,
            line=line,
            expected="a section [mounting] and lines 'name = [ ... ]', every name once",
            found=type(error).__name__,
        ) from None
    if not parser.has_section("mounting"):
        raise InputError(
            "a section is missing",
            file=path,
            expected="[mounting]",
            found=", ".join(f"[{name[:40]}]" for name in parser.sections()[:5]) or "no section",
        )
    mounting = parser["mounting"]
    deltas = np.array([_six_numbers(mounting, name, path, text) for name in DELTAS])
    status = mounting.get("calibration_status", "2")
    if status not in ("0", "1", "2") or (status == "0" and deltas.any()):
        raise InputError(
            "the file says that the robot is not calibrated" if status == "0" else "unknown calibration status",
            file=path,
            line=_line(text, "calibration_status"),
            expected="calibration_status 1 or 2, or 0 and all deltas zero",
            found=status[:40],
        )
    return deltas


def _six_numbers(mounting: configparser.SectionProxy, name: str, path: Path, text: str) -> list[float]:
    value = mounting.get(name)
    if value is None:
        raise InputError("an entry is missing", file=path, column=name, expected=f"{name} = [ six numbers ]")
    cells = [cell.strip() for cell in value[1:-1].split(",")]
    if not (value.startswith("[") and value.endswith("]")) or len(cells) != 6:
        raise InputError(
            "not a list of six numbers",
            file=path,
            line=_line(text, name),
            column=name,
            expected=f"{name} = [ six numbers ]",
            found=value[:80],
        )
    return [_number(cell, path, _line(text, name), name) for cell in cells]


def _line(text: str, name: str) -> int | None:
    """Where an entry of this name stands in the text, counted from 1."""
    section = ""
    for number, line in enumerate(text.splitlines(), start=1):
        section = line.strip() if line.startswith("[") else section
        if section.startswith("[mounting]") and line.split("=")[0].strip().lower() == name:
            return number
    return None


def read_extracted_kinematics(path: str | Path) -> AtZero:
    """The arm that the ROS driver's ``ur_calibration`` read out of a controller.

    Each of the six links is placed in the one before it by x, y, z and a rotation, then turns about its z. The
    rotation is written as Rx(roll) Ry(pitch) Rz(yaw), as ur_calibration takes it apart (``eulerAngles(0, 1, 2)``); one
    sees it from ``upper_arm``, which is Rx(alpha) Rz(theta) and has a pitch of exactly 0. A URDF takes the same angles
    in the other order, which tilts a link by about its yaw: 1e-5 to 1e-4 rad in files that people have published.

    Raises:
        InputError: no such file, not of this form, or a number that is none.
    """
    path = Path(path)
    top = _mapping(_compose(path), ("kinematics",), path, "the file")
    links = _mapping(top["kinematics"], LINKS, path, "kinematics", optional=("hash",))
    X, axes = np.eye(4), []
    for name in LINKS:
        entries = _mapping(links[name], NUMBERS, path, name)
        place = [_scalar(entries[key], path, f"{name}.{key}") for key in NUMBERS]
        turns = [lie.from_rotation_vector(angle * axis) for angle, axis in zip(place[3:], np.eye(3), strict=True)]
        X = X @ lie.make_pose(turns[0] @ turns[1] @ turns[2], np.array(place[:3]))
        axes.append(X)
    return AtZero(np.stack(axes), X)


def _compose(path: Path) -> yaml.Node | None:
    """The nodes of the file, which keep their lines; nothing is constructed from them."""
    try:
        return yaml.compose(_text(path), Loader=yaml.SafeLoader)
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        problem = str(getattr(error, "problem", "") or "nested too deeply")
        raise InputError("this is no YAML", file=path, line=line, found=problem[:120]) from None


def _mapping(
    node: yaml.Node | None, names: tuple[str, ...], path: Path, where: str, optional: tuple[str, ...] = ()
) -> dict[str, yaml.Node]:
    line = None if node is None else node.start_mark.line + 1
    expected = "entries " + ", ".join(names)
    if not isinstance(node, yaml.MappingNode):
        raise InputError(f"{where} has no entries", file=path, line=line, expected=expected)
    entries: dict[str, yaml.Node] = {}
    for key, value in node.value:
        name = key.value if isinstance(key, yaml.ScalarNode) else "?"
        if name in entries or name not in names + optional:
            problem = "an entry stands twice" if name in entries else "an unknown entry"
            line = key.start_mark.line + 1
            raise InputError(problem, file=path, line=line, column=name[:40], expected=expected)
        entries[name] = value
    for name in names:
        if name not in entries:
            found = ", ".join(entries) or "none"
            raise InputError(
                f"an entry is missing in {where}", file=path, line=line, column=name, expected=expected, found=found
            )
    return entries


def _scalar(node: yaml.Node, path: Path, name: str) -> float:
    line = node.start_mark.line + 1
    if not isinstance(node, yaml.ScalarNode):
        raise InputError("not a number", file=path, line=line, column=name, expected="a finite number")
    return _number(node.value, path, line, name)


def _number(cell: str, path: Path, line: int | None, name: str) -> float:
    try:
        if "_" in cell or not cell.isascii():  # Python reads 1_000, nobody else does
            raise ValueError
        value = float(cell)
    except ValueError:
        value = np.nan
    if not abs(value) <= MAX_NUMBER:  # NaN is not
        raise InputError(
            "not a number" if np.isnan(value) else "a number beyond all reason",
            file=path,
            line=line,
            column=name,
            expected=f"a number, {MAX_NUMBER:g} at most",
            found=repr(cell[:40]),
        )
    return value


def _text(path: Path) -> str:
    try:
        if not path.is_file():
            raise InputError("no such file", file=path)
        if path.stat().st_size > MAX_BYTES:
            raise InputError("the file is larger than 1 MiB", file=path)
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("the file is not UTF-8 text", file=path) from None
    except (OSError, ValueError) as error:
        raise InputError("the file cannot be read", file=path, found=str(error)[:80]) from None
