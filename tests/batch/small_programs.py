"""Programs of a few lines, and the workflow that corrects them."""

import importlib.util
from pathlib import Path

import numpy as np

SCRIPT = Path(__file__).parents[2] / "workflows" / "batch_correct.py"

HOME = np.array([0.0, -1.6, 1.7, -1.65, -1.55, 0.1])


def program(seed, targets=3):
    """A program of joint moves near home; no two seeds give the same."""
    q = HOME + np.random.default_rng(seed).uniform(-0.3, 0.3, (targets, 6))
    moves = "".join(f"  movej([{', '.join(f'{each:.6f}' for each in row)}], a=1.4, v=1.05)\n" for row in q)
    return f"def weld_{seed}():\n{moves}end\n"


OUT_OF_REACH = "def far():\n  movej([0, -1.6, 1.7, -1.65, -1.55, 0.1])\n  movel(p[9, 0, 0, 0, 0, 0])\nend\n"
BY_SENSOR = "def seen():\n  movej([0, -1.6, 1.7, -1.65, -1.55, 0.1])\n  movel(get_target_tcp_pose())\nend\n"
NOTHING_MOVES = "def still():\n  set_digital_out(0, True)\nend\n"


def workflow():
    spec = importlib.util.spec_from_file_location("truepath_batch_correct", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
