"""Everything on the built-in virtual cell, judged by Drake and not by the code under test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath import plants
from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.learn import learn
from truepath.lie import Array
from truepath.model import nominal_flange_poses
from truepath.pipeline import correct_toolpath
from truepath.preview import write_preview
from truepath.readers import read_measurements, with_nominal_frames
from truepath.validate import Validation, validate
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure, to_csv, truth_json

CELL = "ur5_cell"


@dataclass(frozen=True)
class DemoResult:
    """What the demo found: errors of the tool in mm along the path as Drake computes them, and the page to look at."""

    validation: Validation
    before_mm: Array
    after_mm: Array
    page: Path


def run_demo(folder: Path, seed: int, say: Callable[[str], None]) -> DemoResult:
    """Simulates, calibrates, validates, corrects and previews; every file goes to ``folder``."""
    say("a robot with hidden errors is measured in 300 poses")
    real, campaign = RealRobot(CELL, seed), Campaign(poses=300, noise_mm=0.02, seed=seed)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("cannot make the folder", file=folder, found=error.strerror) from None
    q = free_poses(real, 500, np.random.default_rng(seed))
    write_atomically(folder / "measured.csv", to_csv(measure(real, q[:300], campaign)))
    write_atomically(folder / "truth.json", truth_json(real, campaign))
    fresh = measure(real, q[300:], Campaign(noise_mm=0.02, seed=seed + 1))

    nominal = plants.load_robot(CELL)
    measurements = read_measurements(folder / "measured.csv", nominal)
    measurements = with_nominal_frames(measurements, nominal.X_WB, nominal.X_FR)
    calibration, _ = learn(nominal, measurements, source=CELL, progress=say)
    calibration.save(folder / "calibration.json")

    say("a welding path is corrected")
    path = plants.models_dir() / "ur5" / "weld_path.csv"
    corrected = correct_toolpath(path, calibration)
    write_atomically(folder / "weld_path.corrected.csv", corrected.text)
    assert nominal.X_FR is not None
    wanted = (nominal.X_WB @ nominal_flange_poses(nominal, corrected.q_programmed) @ nominal.X_FR)[:, :3, 3]
    before, after = (
        1e3 * np.linalg.norm(real.reflector_poses(q)[:, :3, 3] - wanted, axis=1)
        for q in (corrected.q_programmed, corrected.correction.q_rad)
    )

    say("the preview is drawn")
    page = folder / "preview.html"
    write_preview(
        page,
        calibration,
        corrected.q_programmed,
        corrected.correction.q_rad,
        robot_source=CELL,
        title="weld_path.csv on the virtual UR5",
    )
    return DemoResult(validate(calibration.model, fresh), before, after, page)
