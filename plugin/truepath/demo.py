"""Everything on the built-in virtual cell, judged by Drake and not by the code under test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truepath import plants
from truepath.controller import controller_of
from truepath.diagnose import diagnose
from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.lie import Array
from truepath.model import nominal_flange_poses
from truepath.pipeline import write_diagnosis
from truepath.preview import write_program_preview
from truepath.readers import read_measurements, with_nominal_frames
from truepath.rewriting.rewrite import rewrite_program
from truepath.validate import Validation, validate
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure, to_csv, truth_json
from truepath.virtual.visits import Visits

CELL = "ur5_cell"
HIDDEN = ("joint_compliance", "transmission_error")  # besides errors of the frames
POSES, FRESH_POSES, NOISE_MM = 300, 200, 0.02
REPORT = "report.html"  # as ``write_diagnosis`` calls it


@dataclass(frozen=True)
class DemoResult:
    """What the demo found.

    Attributes:
        verdict: of the diagnosis, in one sentence.
        validation: on fresh poses.
        before_mm, after_mm: ``(N,)`` error of the tool along the path as Drake computes it, all causes at work.
        report, preview: the pages to look at.
    """

    verdict: str
    validation: Validation
    before_mm: Array
    after_mm: Array
    report: Path
    preview: Path


def run_demo(folder: Path, seed: int, say: Callable[[str], None]) -> DemoResult:
    """Simulates, diagnoses, validates, corrects and previews; every file goes to ``folder``.

    Raises:
        InputError: a negative seed, or a folder that cannot be made.
    """
    say(f"a robot with hidden errors is measured in {POSES} poses")
    real = RealRobot(CELL, seed)
    causes = draw_causes(real, HIDDEN)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("cannot make the folder", file=folder, found=error.strerror) from None
    campaign = Campaign(POSES, NOISE_MM, seed=seed)
    q = free_poses(real, POSES + FRESH_POSES, np.random.default_rng(seed))
    data = folder / "measured.csv"
    write_atomically(data, to_csv(measure(real, q[:POSES], campaign, causes)))
    write_atomically(folder / "truth.json", truth_json(real, campaign, causes))
    fresh = measure(real, q[POSES:], Campaign(FRESH_POSES, NOISE_MM, seed=seed + 1), causes)

    nominal = plants.load_robot(CELL)
    measurements = with_nominal_frames(read_measurements(data, nominal), nominal.X_WB, nominal.X_FR)
    diagnosis = diagnose(nominal, measurements, spec=CELL, source=CELL, progress=say)
    say("writing the report")
    write_diagnosis(diagnosis, folder, data)
    calibration = diagnosis.calibration

    say("a welding path is corrected")
    path = plants.models_dir() / "ur5" / "weld_path.csv"
    corrected = rewrite_program(path, calibration)
    corrected.write(folder / "weld_path.corrected.csv")
    assert nominal.X_FR is not None
    wanted = (nominal.X_WB @ nominal_flange_poses(nominal, corrected.plan.q_rad) @ nominal.X_FR)[:, :3, 3]
    before, after = (
        1e3 * np.linalg.norm(true_poses(real, Visits.of(real, q), list(causes.values()))[:, :3, 3] - wanted, axis=1)
        for q in (corrected.plan.q_rad, corrected.correction.q_rad)
    )

    say("the preview is drawn")
    preview = folder / "preview.html"
    write_program_preview(
        preview,
        calibration,
        corrected,
        controller_of(calibration.model.robot),
        robot_source=CELL,
        title="weld_path.csv on the virtual UR5",
        report=REPORT,
    )
    validation = validate(calibration.model, fresh)
    return DemoResult(diagnosis.verdict, validation, before, after, folder / REPORT, preview)
