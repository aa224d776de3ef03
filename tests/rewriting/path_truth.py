"""A virtual cell whose robot has hidden errors, programs for it, and where its tool really goes. All by Drake.

Frames: W world of the cell, C the controller's base, 0 its tool flange, T tool (where the reflector sits), B base link
and F flange of the plant, which are C and 0 for the built-in robot.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation
from truepath import plants
from truepath.calibrate import calibrate
from truepath.describe import describe
from truepath.learn import learn
from truepath.readers import with_nominal_frames
from truepath.rewriting.options import RewriteOptions
from truepath.rewriting.rewrite import rewrite_program
from truepath.virtual.hidden_causes import draw_causes, true_poses
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure
from truepath.virtual.visits import Visits
from virtual_controller import Controller, circle_by_equations, read_moves, turned

CELL, HIDDEN = "ur5_cell", ("joint_compliance", "transmission_error")
LARGEST_MM = 10.0  # of a correction: hidden errors of this size are wanted here
LENGTH_M, LONGEST_STEP_RAD, CLEAR_OF_SINGULAR = 0.4, 0.1, 0.05


class Cell:
    """A robot with hidden errors, calibrated on noisy poses.

    Args:
        seed: of all that is hidden, measured and drawn.
        poses: measured, with 0.02 mm noise.
        fresh_poses: on which the calibration is held out.
        find_effects: let the diagnosis find what is hidden; else it is told, which takes less time.
    """

    def __init__(self, seed, poses=300, fresh_poses=4000, find_effects=False):
        self.seed, self.fresh_poses = seed, fresh_poses
        self.real = RealRobot(CELL, seed)
        self.causes = list(draw_causes(self.real, HIDDEN).values())
        self.nominal_plant = plants.load_plant(CELL)
        context = self.nominal_plant.CreateDefaultContext()
        frame = self.nominal_plant.GetFrameByName
        self.X_WC = frame("base_link").CalcPoseInWorld(context).GetAsMatrix4()
        self.X_0T = frame("reflector").CalcPose(context, frame("flange")).GetAsMatrix4()
        self.tool = vector(self.X_0T)
        self.nominal = Controller(tool=self.tool)

        robot = plants.load_robot(CELL)
        q = free_poses(self.real, poses, np.random.default_rng(seed))
        measured = measure(self.real, q, Campaign(poses, 0.02, seed=seed), draw_causes(self.real, HIDDEN))
        measured = with_nominal_frames(measured, robot.X_WB, robot.X_FR)
        if find_effects:
            self.calibration = learn(robot, measured, effects="auto", source=CELL).calibration
        else:
            self.calibration = describe(robot, measured, calibrate(robot, measured, HIDDEN), CELL, None)

    def true_positions(self, q_rad):
        """``(N, 3)`` of the tool in W, all that is hidden being at work."""
        return true_poses(self.real, Visits.of(self.real, q_rad), self.causes)[:, :3, 3]

    def meant(self, X_CT):
        """``(N, 3)`` where a program means the tool to be, in W."""
        return (self.X_WC @ X_CT)[:, :3, 3]

    def heldout_mm(self, q_rad):
        """``(N,)`` by how much the calibration is wrong about where the tool is: no noise, poses it has not seen."""
        told = self.calibration.model.predict(q_rad)[:, :3, 3]
        return 1e3 * np.linalg.norm(told - self.true_positions(q_rad), axis=1)

    @cached_property
    def on_fresh_poses_mm(self):
        """``(N,)`` the same at fresh poses."""
        return self.heldout_mm(self.fresh(self.fresh_poses, 1))

    def fresh(self, count, seed):
        """Joints like those that were measured, less those so near a singularity that they cannot be corrected."""
        q = free_poses(self.real, 2 * count, np.random.default_rng([self.seed, seed]))
        clear = [self.nominal.distance_to_singularity(each) > CLEAR_OF_SINGULAR for each in q]
        return q[clear][:count]

    def corrected(self, script, folder, **options):
        """The script as rewritten, and all that is known of it."""
        path = folder / "program.script"
        path.write_text(script)
        rewritten = rewrite_program(
            path, self.calibration, RewriteOptions(**{"max_correction_mm": LARGEST_MM, **options})
        )
        return rewritten.content.decode(), rewritten


def vector(X):
    """x, y, z and rotation vector of a pose."""
    return np.concatenate([X[:3, 3], Rotation.from_matrix(X[:3, :3]).as_rotvec()])


def written(values, mark=""):
    """Six numbers as a script has them."""
    return f"{mark}[{', '.join(f'{value:.12f}' for value in values)}]"


def script_of(cell, lines):
    """A script that sets the tool and makes these moves."""
    body = "\n".join(f"  {line}" for line in (f"set_tcp({written(cell.tool, 'p')})", *lines))
    return f"def program():\n{body}\nend\n"


def joint_program(cell, q_rad):
    """Joints one after the other."""
    return script_of(cell, [f"movej({written(q)}, a=1.4, v=0.5) # target {k}" for k, q in enumerate(q_rad)])


def pose_program(cell, q_rad):
    """The same as poses, the posture being told."""
    poses = cell.nominal.tool_poses(q_rad)
    return script_of(
        cell,
        [
            f"movej(get_inverse_kin({written(vector(X), 'p')}, qnear={written(q)}), a=1.4, v=0.5) # target {k}"
            for k, (X, q) in enumerate(zip(poses, q_rad, strict=True))
        ],
    )


@dataclass
class Stroke:
    """A line or an arc to be drawn: joints where it starts, tool poses X_CT of its start, middle (arcs) and end."""

    q_start: np.ndarray
    X: list


def strokes_program(cell, strokes, extra=""):
    """Each stroke after a motion of the joints to its start: targets 2 k (start) and 2 k + 1 (end)."""
    lines = []
    for k, stroke in enumerate(strokes):
        poses = ", ".join(written(vector(X), "p") for X in stroke.X[1:])
        name = "movel" if len(stroke.X) == 2 else "movec"
        lines.append(f"movej({written(stroke.q_start)}, a=1.4, v=0.5) # target {2 * k}")
        lines.append(f"{name}({poses}, a=1.2, v=0.25{extra}) # target {2 * k + 1}")
    return script_of(cell, lines)


def drawn_lines(cell, count, seed, length_m=LENGTH_M, most_turn_rad=0.8):
    """Lines in all directions, the tool turning by up to ``most_turn_rad``, that the arm can follow well."""
    rng = np.random.default_rng([cell.seed, seed])

    def propose(X):
        end = X.copy()
        end[:3, 3] += length_m * unit(rng)
        end[:3, :3] = Rotation.from_rotvec(rng.uniform(0, most_turn_rad) * unit(rng)).as_matrix() @ X[:3, :3]
        return [X, end]

    return _drawn(cell, count, rng, propose)


def drawn_arcs(cell, count, seed):
    """Arcs of 60 to 180 mm radius over 60 to 270 degrees, the tool turning with them or not."""
    rng = np.random.default_rng([cell.seed, seed])

    def propose(X):
        axis, angle, radius = unit(rng), rng.uniform(np.pi / 3, 1.5 * np.pi), rng.uniform(0.06, 0.18)
        outward = np.cross(axis, unit(rng))
        outward *= radius / np.linalg.norm(outward)
        centre = X[:3, 3] - outward
        poses, turn = [X], rng.uniform(0, 0.8) * unit(rng)
        for share in (rng.uniform(0.3, 0.7), 1.0):
            there = np.eye(4)
            there[:3, :3] = X[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
            there[:3, 3] = centre + Rotation.from_rotvec(share * angle * axis).apply(outward)
            poses.append(there)
        return poses

    return _drawn(cell, count, rng, propose)


def unit(rng):
    """A direction."""
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction)


def _drawn(cell, count, rng, propose):
    found = []
    for _ in range(300 * count):
        q = free_poses(cell.real, 1, rng)[0]
        stroke = Stroke(q, propose(cell.nominal.flange(q) @ cell.X_0T))
        if _can_be_followed(cell, stroke):
            found.append(stroke)
            if len(found) == count:
                return found
    raise ValueError("hardly any stroke can be followed")


def _can_be_followed(cell, stroke):
    reach = [np.linalg.norm(X[:3, 3] - [0, 0, 0.089]) for X in stroke.X]
    if max(reach) > 0.85 or min(reach) < 0.25:
        return False
    text = strokes_program(cell, [stroke])
    try:
        q = cell.nominal.run(read_moves(text), stroke.q_start, step_m=0.02).q_rad
    except (ValueError, AssertionError, np.linalg.LinAlgError):
        return False
    steps = np.abs(np.diff(q, axis=0)).max()
    lower, upper = np.maximum(cell.real.robot.lower_rad, -np.pi), np.minimum(cell.real.robot.upper_rad, np.pi)
    if steps > LONGEST_STEP_RAD or (q < lower).any() or (q > upper).any():
        return False
    clear = min(cell.nominal.distance_to_singularity(each) for each in q)
    return clear > CLEAR_OF_SINGULAR and all(cell.real.is_free(each) for each in q)


@dataclass
class Drawn:
    """Where the tool really was on its way along strokes.

    Attributes:
        off_mm: ``(K,)`` distance of each sample from the ideal line or circle.
        stroke: ``(K,)``.
        is_blend: ``(K,)`` True where a blend rounds a corner.
        added: how many targets the script has more than it was written with.
    """

    off_mm: np.ndarray
    stroke: np.ndarray
    is_blend: np.ndarray
    added: int

    @property
    def p95_mm(self):
        """Of all samples."""
        return float(np.percentile(self.off_mm, 95))


def draw(cell, script, strokes, controller, step_m=0.002):
    """Runs a script made of strokes and measures how far the tool is off them."""
    moves = read_moves(script)
    target = np.full(len(moves), -1)
    following = -1
    for k in reversed(range(len(moves))):
        following = following if moves[k].target is None else moves[k].target
        target[k] = following
    run = controller.run(moves, strokes[0].q_start, step_m)
    on_way = np.array([moves[k].name != "movej" for k in run.move])
    q, stroke = run.q_rad[on_way], target[run.move[on_way]] // 2
    p = cell.true_positions(q)
    off = np.empty(len(q))
    for k, each in enumerate(strokes):
        rows = stroke == k
        ideal = cell.meant(np.array(each.X))
        off[rows] = from_line(p[rows], *ideal) if len(ideal) == 2 else from_circle(p[rows], *ideal)
    return Drawn(1e3 * off, stroke, run.is_blend[on_way], sum(move.target is None for move in moves))


def from_line(p, start, end):
    """``(K,)`` distances of points from a line."""
    along = (end - start) / np.linalg.norm(end - start)
    return np.linalg.norm(np.cross(p - start, along), axis=1)


def from_circle(p, one, two, three):
    """``(K,)`` distances of points from the circle through three."""
    centre, axis = circle_by_equations(one, two, three)
    assert turned(one - centre, two - centre, axis) < turned(one - centre, three - centre, axis)
    away = p - centre
    height = away @ axis
    radial = np.linalg.norm(np.cross(axis, away), axis=1)
    return np.hypot(radial - np.linalg.norm(one - centre), height)
