"""Finding the files behind a robot: the URDF within a cell, the meshes of a URDF."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import yaml
import yourdfpy.urdf

from truepath import plants
from truepath.errors import InputError

MAX_NESTING = 20


def find_urdf(source: str | Path, joint_names: tuple[str, ...], robot_name: str) -> Path:
    """The URDF that holds the arm.

    Args:
        source: built-in name, URDF or Drake directives.
        joint_names: the arm's joints; in a cell the model that has them all is the arm.
        robot_name: model instance of the arm, which decides between several such models.

    Raises:
        InputError: no such file, or no model with these joints in it.
    """
    path = plants.resolve(source)
    candidates = [(robot_name, path)] if path.suffix == ".urdf" else list(models_of(path))
    arms = [(name, urdf) for name, urdf in candidates if set(joint_names) <= _joints(urdf)]
    if not arms:
        raise InputError(
            "the model has no such arm",
            file=path,
            expected="a URDF with the joints " + ", ".join(joint_names),
            found=", ".join(urdf.name for _, urdf in candidates) or "no URDF",
        )
    return next((urdf for name, urdf in arms if name == robot_name), arms[0][1])


def mesh_file(uri: str, urdf: Path) -> Path | None:
    """The file that a URDF means by a mesh name; None if there is none."""
    path = _locate(uri, urdf)
    if path is None:  # a ROS package that is not registered: look for its files above the URDF
        path = Path(yourdfpy.urdf.filename_handler_magic(uri, dir=str(urdf.parent)))
    return path if path.is_file() else None


def models_of(directives: Path, depth: int = 0) -> Iterator[tuple[str, Path]]:
    """Names and files of the URDF models that directives add, also those of directives that they add."""
    if depth > MAX_NESTING:
        raise InputError("these directives include themselves", file=directives)
    try:
        content = yaml.load(directives.read_text(encoding="utf-8"), Loader=_DirectivesLoader)
        items = [(kind, body) for item in content["directives"] for kind, body in item.items()]
    except (OSError, UnicodeDecodeError, yaml.YAMLError, TypeError, KeyError, AttributeError) as error:
        raise InputError("these are no Drake directives", file=directives, found=str(error)[:300]) from None
    for kind, body in items:
        if kind not in ("add_model", "add_directives"):
            continue
        path = _locate(str(body.get("file", "")), directives)
        if path is None or not path.is_file():
            raise InputError(
                "the directives name a file that is not there", file=directives, found=str(body.get("file"))
            )
        if kind == "add_directives":
            yield from models_of(path, depth + 1)
        elif path.suffix == ".urdf":
            yield str(body.get("name", "")), path


class _DirectivesLoader(yaml.SafeLoader):
    """Plain YAML; Drake's own tags (!Rpy, !AngleAxis, ...) carry poses, which do not matter here."""


_DirectivesLoader.add_multi_constructor("!", lambda loader, tag, node: None)


def _locate(uri: str, beside: Path) -> Path | None:
    """A file given by ``package://`` or ``file://`` or as a path relative to the file that names it.

    Returns:
        None for a package that is neither our own nor one of the folders above ``beside``.
    """
    scheme, _, rest = uri.rpartition("://")
    if scheme not in ("package", "model"):
        return (beside.parent / rest).resolve()
    package, _, inside = rest.partition("/")
    if package == "truepath_models":
        return plants.models_dir() / inside
    manifests = (folder / "package.xml" for folder in beside.resolve().parents)
    roots = (file.parent for file in manifests if file.is_file() and _package_name(file) == package)
    return next((root / inside for root in roots), None)


def _package_name(manifest: Path) -> str | None:
    try:
        return (ElementTree.parse(manifest).findtext("name") or "").strip()
    except (OSError, ElementTree.ParseError):
        return None


def _joints(urdf: Path) -> set[str]:
    try:
        return {joint.get("name", "") for joint in ElementTree.parse(urdf).getroot().iterfind("joint")}
    except (OSError, ElementTree.ParseError) as error:
        raise InputError("the URDF cannot be read", file=urdf, found=str(error)) from None
