"""Spoilt programs and toolpaths through the whole command: a clear error or a result, never anything else.

``workflows/fuzz_programs.py`` does the same with thousands.
"""

import importlib.util
import random
import sys
from pathlib import Path

import pytest
import spoil

SCRIPT = Path(__file__).parents[2] / "workflows" / "fuzz_programs.py"
SOME, MANY = 80, 5000


@pytest.fixture(scope="module")
def fuzz():
    """The workflow, as a module."""
    specification = importlib.util.spec_from_file_location("fuzz_programs", SCRIPT)
    module = importlib.util.module_from_spec(specification)
    sys.modules["fuzz_programs"] = module
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def calibration(fuzz, tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "calibration.json"
    fuzz.write_calibration(path)
    return path


@pytest.mark.parametrize("first", [10_000, pytest.param(20_000, marks=pytest.mark.slow)])
def test_spoilt_programs_end_in_a_clear_error_or_a_result(fuzz, calibration, tmp_path, first):
    count = SOME if first == 10_000 else MANY
    outcomes = [fuzz.tried(case, calibration, tmp_path) for case in fuzz.cases(count, first)]
    assert [(each.case.name, each.fault) for each in outcomes if each.fault is not None] == []
    words = {each.words.partition(":")[0] for each in outcomes}
    assert words == {"corrected", "corrected in part", "refused"}


@pytest.mark.parametrize(
    ("code", "said", "new", "seconds", "fault"),
    [
        (2, "error: program.csv: no\n", set(), 0.1, None),
        (0, "", {"corrected.csv"}, 0.1, None),
        (1, "", {"corrected.csv"}, 0.1, None),
        (0, "", {"corrected.csv", "corrected.csv.truepath.json"}, 0.1, None),
        (0, "", {"corrected.csv.truepath.json"}, 0.1, "leaves corrected.csv.truepath.json"),
        (3, "Traceback\nValueError: x\n", set(), 0.1, "ValueError: x"),
        (2, "error: program.csv: no\n", {"corrected.csv"}, 0.1, "is refused and leaves corrected.csv"),
        (2, "error: no\n", set(), 0.1, "no clear message: error: no"),
        (0, "", set(), 0.1, "leaves nothing"),
        (0, "", {"corrected.csv", "corrected.csv.tmp"}, 0.1, "leaves corrected.csv, corrected.csv.tmp"),
        (0, "", {"corrected.csv"}, 5.1, "takes 5.1 s"),
    ],
)
def test_what_must_not_be_is_seen(fuzz, code, said, new, seconds, fault):
    assert fuzz.fault_of(code, said, Path("program.csv"), Path("corrected.csv"), seconds, new) == fault


@pytest.mark.parametrize("wound", sorted(set(spoil.OF_TABLES), key=lambda f: f.__name__), ids=lambda f: f.__name__)
def test_each_wound_of_tables_spoils(wound):
    good = (SCRIPT.parents[1] / "models" / "ur5" / "pose_path.csv").read_bytes()
    spoilt = [wound(good, random.Random(seed)) for seed in range(20)]
    assert len({each for each in spoilt if each != good}) >= 4
    assert wound(good, random.Random(3)) == spoilt[3]
