"""``workflows/coverage_study.py``, which lies in no package, as a module."""

import importlib.util
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def load_study():
    """The workflow, which lies in no package."""
    spec = importlib.util.spec_from_file_location("coverage_study", ROOT / "workflows" / "coverage_study.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


study = load_study()
