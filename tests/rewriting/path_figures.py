"""What a rewritten program comes to in the virtual cell; each figure with what it is held against.

How targets are compared with the held-out error of the calibration. That error is how far the tool is from where the
calibration says it is, at poses that it has not seen. A corrected target misses its intent by just that, at its
corrected joints, if nothing else goes wrong between program and robot. So the comparison is fair if

- both are about the same point of the tool: the programs' TCP is where the reflector sat;
- both are over the same region: targets and fresh poses are drawn in one way, that of the measured poses, less those so
  near a singularity that truepath refuses them;
- the truth is without noise for both.

Then the means differ by chance alone, by 1.2 % (one sigma) for 2000 targets and 4000 fresh poses, errors having a
spread of 0.45 of their mean. Held against the same calibration at the very targets, as programmed, chance is out of it
too: both differences have to be small.
"""

from dataclasses import dataclass

import numpy as np
from path_truth import Cell, draw, drawn_arcs, drawn_lines, joint_program, pose_program, strokes_program
from scipy.spatial.transform import Rotation
from virtual_controller import UR5_ROWS, Controller, read_moves

LARGEST_DEVIATION, MOST_RESIDUAL_UM = 0.05, 1.0
LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
CALIBRATED_ROWS = ("delta_theta", "delta_a", "delta_d", "delta_alpha")


@dataclass(frozen=True)
class Figure:
    """One row of the table.

    Attributes:
        what: in words.
        value, limit: in ``unit``; passed if the value is no larger.
        detail: figures for comparison.
    """

    what: str
    value: float
    limit: float
    unit: str
    detail: dict

    @property
    def passed(self):
        return bool(self.value <= self.limit)


def controller_deltas(seed):
    """``(4, 6)`` what a factory calibration may add to theta, a, d, alpha: 0.3 mm and 0.3 mrad, one sigma.

    The last a and alpha stay zero, as in a controller, whose tool flange stands on the last axis.
    """
    deltas = np.random.default_rng([seed, 11]).normal(scale=3e-4, size=(4, 6))
    deltas[[1, 3], 5] = 0.0
    return deltas


def write_calibration_conf(path, deltas):
    """The file of a controller that has these deviations."""
    rows = [
        f"{name} = [ {', '.join(map(repr, row))} ]" for name, row in zip(CALIBRATED_ROWS, deltas.tolist(), strict=True)
    ]
    path.write_text("\n".join(["[mounting]", "calibration_status = 2", *rows]) + "\n")
    return str(path)


def write_extracted_yaml(path, deltas):
    """The same controller as ``ur_calibration`` writes it: each link in the one before, Rx Ry Rz."""
    theta, a, d, alpha = UR5_ROWS + deltas
    lines = ["kinematics:"]
    for i, name in enumerate(LINKS):
        before = Rotation.from_rotvec([alpha[i - 1] if i else 0.0, 0.0, 0.0])
        place = before.apply([0.0, 0.0, d[i]]) + np.eye(3)[0] * (a[i - 1] if i else 0.0)
        angles = (before * Rotation.from_rotvec([0.0, 0.0, theta[i]])).as_euler("XYZ")
        numbers = zip(("x", "y", "z", "roll", "pitch", "yaw"), [*place.tolist(), *angles.tolist()], strict=True)
        lines += [f"  {name}:", *(f"    {key}: {value!r}" for key, value in numbers)]
    path.write_text("\n".join([*lines, "  hash: calib_of_the_tests"]) + "\n")
    return str(path)


def target_figures(cell: Cell, count, folder):
    """Error of corrected targets against intent: as joints, as poses, as poses of a controller with its own rows."""
    q = cell.fresh(count, 2)
    fresh_mm = cell.on_fresh_poses_mm
    here_mm = cell.heldout_mm(q)
    deltas = controller_deltas(cell.seed)
    conf = write_calibration_conf(folder / "calibration.conf", deltas)
    yaml = write_extracted_yaml(folder / "kinematics.yaml", deltas)
    own = Controller(deltas, cell.tool)
    figures = []
    for title, program, controller, options in (
        ("joints", joint_program, cell.nominal, {"express": "joints"}),
        ("poses", pose_program, cell.nominal, {"express": "poses"}),
        ("poses, own kinematics", pose_program, own, {"express": "poses", "controller_kinematics": conf}),
        ("poses as joints", pose_program, cell.nominal, {"express": "joints"}),
        ("joints as poses, own (YAML)", joint_program, own, {"express": "poses", "controller_kinematics": yaml}),
    ):
        script, _ = cell.corrected(program(cell, q), folder, **options)
        moves = read_moves(script)
        assert len(moves) == len(q)
        commanded = controller.run(moves, q[0]).q_rad
        meant = cell.meant(cell.nominal.tool_poses(q))
        error_mm = 1e3 * np.linalg.norm(cell.true_positions(commanded) - meant, axis=1)
        detail = {
            "targets": len(q),
            "mean_mm": float(error_mm.mean()),
            "p95_mm": float(np.percentile(error_mm, 95)),
            "heldout_mean_mm": float(fresh_mm.mean()),
            "heldout_p95_mm": float(np.percentile(fresh_mm, 95)),
            "heldout_at_the_targets_mean_mm": float(here_mm.mean()),
        }
        off = 100 * max(abs(error_mm.mean() / fresh_mm.mean() - 1), abs(error_mm.mean() / here_mm.mean() - 1))
        figures.append(Figure(f"targets as {title}: off held-out", float(off), 100 * LARGEST_DEVIATION, "%", detail))
        residual = _residual_um(cell, commanded, q)
        figures.append(Figure(f"targets as {title}: residual", residual, MOST_RESIDUAL_UM, "um", {}))
    return figures


def _residual_um(cell, commanded, q):
    """Largest distance between where the calibration says the tool is and where it is meant to be."""
    told = cell.calibration.model.predict(commanded)[:, :3, 3]
    return 1e6 * float(np.linalg.norm(told - cell.meant(cell.nominal.tool_poses(q)), axis=1).max())


def stroke_figures(cell: Cell, kind, count, tolerance_mm, folder, step_m=0.002):
    """95th percentile of the distance from lines of 400 mm or from arcs, over all samples of all of them.

    The limit is the tolerance and the mean held-out error, the least that can be meant by "held-out error".
    """
    strokes = {"lines": drawn_lines, "arcs": drawn_arcs}[kind](cell, count, 5)
    program = strokes_program(cell, strokes)
    heldout_mm = cell.on_fresh_poses_mm
    deltas = controller_deltas(cell.seed)
    conf = write_calibration_conf(folder / "calibration.conf", deltas)
    own = Controller(deltas, cell.tool)
    as_programmed = draw(cell, program, strokes, cell.nominal, step_m)
    figures = []
    for title, controller, options in (
        ("nominal controller", cell.nominal, {}),
        ("own kinematics", own, {"controller_kinematics": conf}),
    ):
        ends, without = cell.corrected(program, folder, path_tolerance_mm=None, **options)
        script, rewritten = cell.corrected(program, folder, path_tolerance_mm=tolerance_mm, **options)
        only_ends = draw(cell, ends, strokes, controller, step_m)
        drawn = draw(cell, script, strokes, controller, step_m)
        assert drawn.added == len(rewritten.vias.added)
        detail = {
            "strokes": len(strokes),
            "samples": len(drawn.off_mm),
            "added": drawn.added,
            "max_mm": float(drawn.off_mm.max()),
            "only_ends_p95_mm": only_ends.p95_mm,
            "only_ends_max_mm": float(only_ends.off_mm.max()),
            "only_ends_predicted_max_mm": float(without.vias.before_mm.max()),
            "predicted_max_mm": float(rewritten.vias.after_mm.max()),
            "as_programmed_p95_mm": as_programmed.p95_mm,
            "heldout_mean_mm": float(heldout_mm.mean()),
            "heldout_p95_mm": float(np.percentile(heldout_mm, 95)),
        }
        limit = tolerance_mm + float(heldout_mm.mean())
        figures.append(Figure(f"{kind}, {title}: off the path, p95", drawn.p95_mm, limit, "mm", detail))
    return figures
