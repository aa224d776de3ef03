"""Names of the files with poses to measure next, so that they replace nothing but those of an earlier diagnosis."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from truepath.diagnosis import Diagnosis

OTHER_NAME = "measure_next"


def beside(diagnosis: Diagnosis, folder: Path, data: Path) -> Diagnosis:
    """The diagnosis with such names that nobody's file in its folder is written over.

    Args:
        diagnosis: names the files as it likes.
        folder: where its files are to be written; need not be there.
        data: the measured poses, which no result may replace.

    Returns:
        The same, with ``measure_next.csv`` (``measure_next2.csv``, ...) for each name that stands for somebody else's
        file. A file that the diagnosis now in the folder names is its own, and is replaced.
    """
    own, taken, items = _named_before(folder), set[str](), []
    for item in diagnosis.ambiguous:
        name = item.measure_next
        number = 1
        while name is not None and (name in taken or not _is_free(folder / name, name in own, data)):
            name = f"{OTHER_NAME}{'' if number == 1 else number}.csv"
            number += 1
        taken |= set() if name is None else {name}
        items.append(replace(item, measure_next=name))
    return replace(diagnosis, ambiguous=tuple(items))


def _is_free(path: Path, is_own: bool, data: Path) -> bool:
    if not path.exists() and not path.is_symlink():
        return True
    return is_own and path.is_file() and not (data.exists() and path.samefile(data))


def _named_before(folder: Path) -> set[str]:
    """By the diagnosis that is in the folder; none if it is no diagnosis."""
    try:
        content = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        return {item["measure_next"] for item in content["ambiguous"] if item["measure_next"] is not None}
    except (OSError, ValueError, RecursionError, LookupError, TypeError):
        return set()
