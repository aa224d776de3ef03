"""Clearances in a cell. The truth is a second plant in Drake asked without any screening, or a sphere before a wall."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from truepath import plants
from truepath.calibrate import calibrate
from truepath.clearance import RANGE_M, Cell
from truepath.correct import correct
from truepath.effects.base import EffectParameter, FittedTerm, Term
from truepath.errors import InputError
from truepath.model import nominal_model
from truepath.motions import Moves
from truepath.plants import load_robot
from truepath.programs.toolpath_csv import read_toolpath
from truepath.virtual.real_robot import RealRobot
from truepath.virtual.simulate import Campaign, free_poses, measure

MICROMETRE = 1e-6
SCREENING_M = 3e-6  # what clearance.py leaves unmeasured, and rounding

# Two links about vertical axes, a ball at the tip, 0.5 m above the origin; a wall whose face is the plane x = 0.8.
ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="foot">{foot}</link>
  <link name="upper"/>
  <link name="lower">
    <collision name="ball"><origin xyz="0.3 0 0"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
  <link name="flange"/>
  <joint name="j1" type="revolute"><parent link="foot"/><child link="upper"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="j2" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="end" type="fixed"><parent link="lower"/><child link="flange"/><origin xyz="0.3 0 0"/></joint>
</robot>
"""
WALL = """<?xml version="1.0"?>
<robot name="wall"><link name="wall">
  <collision name="wall"><origin xyz="1.3 0 0"/><geometry><box size="1 4 4"/></geometry></collision>
</link></robot>
"""
FLOOR = """<?xml version="1.0"?>
<sdf version="1.7"><model name="floor"><static>true</static><link name="floor"><collision name="floor">
  <pose>0 0 0.45 0 0 0</pose><geometry><plane><normal>0 0 1</normal></plane></geometry>
</collision></link></model></sdf>
"""
ON_ITS_OWN_FRAME = """
  - add_frame: {name: mount, X_PF: {base_frame: world}}
  - add_weld: {parent: mount, child: arm::foot}
"""
ON_THE_WORLD = """
  - add_weld: {parent: world, child: arm::foot}
"""
WITH_WALL = """
  - add_model: {name: wall, file: WALL}
  - add_weld: {parent: world, child: wall::wall}
"""
PAIR = ("arm::lower", "wall::wall")


@pytest.fixture
def simple_cell(tmp_path):
    """Function: a cell around the arm of two links."""

    def write(mounting=ON_ITS_OWN_FRAME, around=WITH_WALL, foot=""):
        for name, text in (("arm.urdf", ARM.format(foot=foot)), ("wall.urdf", WALL), ("floor.sdf", FLOOR)):
            (tmp_path / name).write_text(text)
        text = "directives:\n  - add_model: {name: arm, file: ARM}\n" + mounting + around
        for word, name in (("ARM", "arm.urdf"), ("WALL", "wall.urdf"), ("FLOOR", "floor.sdf")):
            text = text.replace(word, f"file://{tmp_path / name}")
        path = tmp_path / "cell.dmd.yaml"
        path.write_text(text)
        return path

    return write


def to_the_wall(q_rad):
    """``(N,)`` by hand."""
    return 0.8 - 0.02 - (0.4 * np.cos(q_rad[:, 0]) + 0.3 * np.cos(q_rad.sum(axis=1)))


@pytest.fixture(scope="module")
def bare_drake():
    """Function: smallest distance of each pair of bodies up to ``range_m``, all of them asked of Drake every time."""
    builder = DiagramBuilder()
    plant, _scene_graph = plants.add_cell(builder, "ur5_cell")
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    nominal_context = plant.GetMyContextFromRoot(root)

    def distances(q, range_m, plant=plant, context=nominal_context):
        plant.SetPositions(context, q)
        query = plant.get_geometry_query_input_port().Eval(context)
        frame_of, found = query.inspector().GetFrameId, {}
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(range_m):
            two = [plant.GetBodyFromFrameId(frame_of(geometry)) for geometry in (pair.id_A, pair.id_B)]
            bodies = tuple(sorted(body.scoped_name().get_full() for body in two))
            found[bodies] = min(found.get(bodies, np.inf), pair.distance)
        return found

    distances.diagram, distances.root = diagram, root  # which must live as long
    return distances


@pytest.fixture(scope="module")
def nominal_cell(ur5):
    return Cell("ur5", nominal_model(ur5))


@pytest.fixture(scope="module")
def weld_path():
    """``(1000, 6)`` along the example program."""
    q = read_toolpath(plants.models_dir() / "ur5" / "weld_path.csv", 6).q_rad
    along = np.linspace(0, len(q) - 1, 1000)
    return np.stack([np.interp(along, np.arange(len(q)), column) for column in q.T], axis=1)


def differences(found, q_rad, truth):
    """How far from ``truth(q)``, m; a pair that only one has in range is to the other at the end of it."""
    all_of_them = []
    for k, q in enumerate(q_rad):
        true = truth(q)
        for bodies in {*true, *found.bodies}:
            both = np.minimum([found.of(bodies)[k], true.get(bodies, np.inf)], found.range_m)
            if (both < found.range_m).any():
                all_of_them.append(np.ptp(both))
    return np.array(all_of_them)


def agree(found, q_rad, truth):
    """To what Drake's distance of two cylinders jumps by when a joint turns by a nanoradian."""
    difference = differences(found, q_rad, truth)
    assert len(difference) > 50
    return np.quantile(difference, 0.98) < 2e-5 and difference.max() < 1e-3


# By hand


def test_the_distance_of_a_ball_from_a_wall(simple_cell):
    spec = simple_cell()
    q = np.random.default_rng(0).uniform(-3, 3, (300, 2)) * [0.2, 0.3]
    found = Cell(spec, nominal_model(load_robot(spec))).clearances(q, range_m=10.0)
    assert found.bodies == (PAIR,)
    assert np.abs(found.distance_m - to_the_wall(q)).max() < MICROMETRE
    assert found.nearest == [PAIR] * 300


def test_the_reach_of_a_joint(simple_cell):
    """The far side of the ball is 0.72 m from the axis of joint 1, 0.32 m from that of joint 2."""
    spec = simple_cell()
    assert pytest.approx(np.array([[0.72, 0.32]])) == Cell(spec, nominal_model(load_robot(spec)))._pairs.reach_m


def test_what_is_out_of_range_is_told_to_be_far(simple_cell):
    spec = simple_cell(
        around=WITH_WALL.replace("child: wall::wall", "child: wall::wall, X_PC: {translation: [-0.1, 0, 0]}")
    )
    q = np.stack([np.linspace(-0.8, 0.8, 2001), np.zeros(2001)], axis=1)
    found = Cell(spec, nominal_model(load_robot(spec))).clearances(q)
    expected = to_the_wall(q) - 0.1
    near = expected <= RANGE_M
    assert 0 < near.sum() < 2001
    assert (expected < 0).any()
    assert (np.isfinite(found.distance_m) == near).all()
    assert np.abs(found.distance_m - expected)[near].max() < SCREENING_M
    assert found.nearest[0] is None
    assert found.nearest[1000] == PAIR


def test_a_half_space_is_a_floor(simple_cell):
    spec = simple_cell(around="\n  - add_model: {name: floor, file: FLOOR}\n")
    found = Cell(spec, nominal_model(load_robot(spec))).clearances(np.array([[0.0, 0.0], [1.0, 2.0]]), range_m=0.1)
    assert np.abs(found.distance_m - 0.03).max() < MICROMETRE  # the ball of 20 mm is 50 mm above it


@pytest.mark.parametrize("mounting", [ON_ITS_OWN_FRAME, ON_THE_WORLD])
def test_a_base_that_is_known_to_stand_elsewhere_is_put_there(simple_cell, mounting):
    spec = simple_cell(mounting)
    X_MB, X_MB_nominal = np.eye(4), np.eye(4)
    X_MB_nominal[:3, 3] = 1.0, 2.0, 3.0  # where the tracker stands is of no concern
    X_MB[:3, 3] = 1.002, 2.0, 3.0
    stated = replace(nominal_model(load_robot(spec), X_MB), X_MB_nominal=X_MB_nominal, base_is_given=True)
    q = np.array([[0.3, -0.2], [0.0, 0.4]])
    assert np.abs(Cell(spec, stated).clearances(q, 1.0).distance_m - (to_the_wall(q) - 0.002)).max() < MICROMETRE
    registered = replace(stated, base_is_given=False)
    assert np.abs(Cell(spec, registered).clearances(q, 1.0).distance_m - to_the_wall(q)).max() < MICROMETRE


def test_joints_turn_as_far_as_the_effects_say(simple_cell):
    spec = simple_cell()
    covered = (("lower_rad", -3.0), ("upper_rad", 3.0))
    term = Term("encoder_scale", Moves.JOINT, 1, ("theta",), covered, (EffectParameter("scale", "rad/rad", 0.0, ""),))
    fitted = FittedTerm(term, np.array([0.01]), np.array([0.0]))
    model = replace(nominal_model(load_robot(spec)), effects=(fitted,))
    q = np.array([[0.5, 0.1], [-0.9, 0.3]])
    found = Cell(spec, model).clearances(q, range_m=1.0).distance_m
    assert np.abs(found - to_the_wall(q * [1.01, 1.0])).max() < MICROMETRE
    assert np.abs(found - to_the_wall(q)).min() > 1e-3


def test_what_touches_at_every_posture_is_how_the_cell_is_drawn(simple_cell):
    housing = '<collision name="hall"><geometry><sphere radius="3"/></geometry></collision>'
    spec = simple_cell(foot=housing)
    cell = Cell(spec, nominal_model(load_robot(spec)))
    assert cell.body_pairs == (PAIR,)
    assert cell.is_free(np.array([0.5, 0.0]))


def test_a_ball_in_the_wall_is_not_free(simple_cell):
    closer = WITH_WALL.replace("child: wall::wall", "child: wall::wall, X_PC: {translation: [-0.2, 0, 0]}")
    spec = simple_cell(around=closer)
    cell = Cell(spec, nominal_model(load_robot(spec)))
    assert not cell.is_free(np.zeros(2))
    assert cell.is_free(np.array([1.5, 0.0]))


def test_a_cell_without_shapes_is_refused(seven, seven_joint_arm):
    with pytest.raises(InputError, match="nothing in this cell can collide"):
        Cell(seven_joint_arm, nominal_model(seven))


def test_a_cell_of_another_robot_is_refused(ur10):
    with pytest.raises(InputError, match="not the calibrated robot"):
        Cell("ur5", nominal_model(ur10))


# Against Drake, asked for everything every time


def test_along_a_path_nothing_is_missed(nominal_cell, weld_path, bare_drake):
    found = nominal_cell.clearances(weld_path, range_m=0.03)
    assert found.measured > 0
    assert len(found.bodies) > 3
    assert agree(found, weld_path, lambda q: bare_drake(q, 0.03))


def test_through_collisions_nothing_is_missed(nominal_cell, bare_drake):
    """Long swings through pedestal, table and arm, in steps of half a degree, and single postures."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(-np.pi, np.pi, (8, 6))
    swings = [a + np.linspace(0, 1, 120)[:, None] * np.clip(b - a, -1, 1) for a, b in pairwise(ends)]
    q = np.concatenate([*swings, rng.uniform(-np.pi, np.pi, (60, 6))])
    found = nominal_cell.clearances(q)
    assert (found.distance_m < -0.01).sum() > 50
    assert (found.distance_m > 0.01).sum() > 50
    assert agree(found, q, lambda q: bare_drake(q, RANGE_M))


def test_what_is_not_asked_for_is_far(nominal_cell, bare_drake):
    """Swings in steps so small that most pairs are screened most of the time."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(-np.pi, np.pi, (4, 6))
    q = np.concatenate([a + np.linspace(0, 1, 1200)[:, None] * np.clip(b - a, -1, 1) for a, b in pairwise(ends)])
    found = nominal_cell.clearances(q)
    assert found.measured < 0.9 * len(q)
    assert 0 < np.isfinite(found.distance_m).sum() < found.measured
    assert agree(found, q, lambda q: bare_drake(q, RANGE_M))


def test_no_joint_changes_a_distance_by_more_than_its_reach(nominal_cell):
    """Single turns of a joint; some of the bounds must be nearly met, or they would hold for any reach."""
    pairs, rng, most = nominal_cell._pairs, np.random.default_rng(5), 0.0

    def distances(q):
        query = nominal_cell._at(q)
        return np.array([query.ComputeSignedDistancePairClosestPoints(*ids).distance for ids in pairs.ids])

    for q in rng.uniform(-np.pi, np.pi, (40, 6)):
        joint, turn = rng.integers(6), rng.uniform(0.2, 0.6)
        before, after = distances(q), distances(q + turn * np.eye(6)[joint])
        apart, bound = (before > 0) & (after > 0), turn * pairs.reach_m[:, joint]
        assert (np.abs(after - before)[apart] <= bound[apart] + 5e-3).all()  # 5 mm: Drake, with cylinders far apart
        most = max(
            most, np.max(np.abs(after - before)[apart & (bound > 0.1)] / bound[apart & (bound > 0.1)], initial=0)
        )
    assert most > 0.6


def test_where_drake_finds_no_distance_a_hair_beside_it_does(nominal_cell, monkeypatch, weld_path):
    expected = nominal_cell.clearances(weld_path[:1], range_m=0.03)
    at, asked = nominal_cell._at, []

    def fails_at_first(phi):
        asked.append(phi.copy())
        if len(asked) == 1:
            raise RuntimeError("FCL: the origin is outside of the polytope")
        return at(phi)

    monkeypatch.setattr(nominal_cell, "_at", fails_at_first)
    found = nominal_cell.clearances(weld_path[:1], range_m=0.03)
    assert len(asked) == 2
    assert found.distance_m == pytest.approx(expected.distance_m, abs=1e-5)

    def fails_always(phi):
        raise RuntimeError("FCL: the origin is outside of the polytope")

    monkeypatch.setattr(nominal_cell, "_at", fails_always)
    with pytest.raises(InputError, match="cannot tell a distance") as caught:
        nominal_cell.clearances(weld_path[:1])
    assert "polytope" in caught.value.found


def test_a_path_far_from_everything_is_hardly_asked_for(nominal_cell, bare_drake):
    start = np.array([0.0, -1.2, 0.9, -1.3, -1.2, 0.3])
    q = start + np.linspace(0, 1, 5000)[:, None] * [0.5, 0.1, 0.1, 0.1, 0.1, 0.1]
    assert not any(bare_drake(row, RANGE_M) for row in q[::50])
    found = nominal_cell.clearances(q)
    assert found.bodies == ()
    assert np.isinf(found.distance_m).all()
    assert found.measured < 0.2 * len(q)


# The robot that really stands there


@pytest.fixture(scope="module")
def real():
    return RealRobot("ur5", 0)


@pytest.fixture(scope="module")
def model(real):
    """Calibrated, with what is known of where base and reflector are meant to be."""
    data = measure(real, free_poses(real, 150, np.random.default_rng(0)), Campaign())
    stated = replace(data, X_MB_nominal=real.robot.X_WB, X_FE_nominal=real.robot.X_FR)
    return calibrate(real.robot, stated).model


def test_the_calibrated_cell_is_the_real_one(real, model, nominal_cell, bare_drake):
    """Hidden errors of all frames, in Drake. Left is what a reflector does not show: how the tool is turned."""
    q = free_poses(real, 80, np.random.default_rng(1))
    cells = {"calibrated": Cell("ur5", model), "nominal": nominal_cell}
    found = {name: cell.clearances(q, range_m=0.3) for name, cell in cells.items()}
    errors = {name: [] for name in cells}
    for k, row in enumerate(q):
        for bodies, distance in bare_drake(row, 0.25, real.plant, real._context).items():
            if bodies[0].startswith(("table", "pedestal")) and bodies[1].startswith("tool"):
                for name in cells:
                    errors[name].append(found[name].of(bodies)[k] - distance)
    rms = {name: np.sqrt(np.mean(np.square(values))) for name, values in errors.items()}
    assert len(errors["nominal"]) > 20
    assert rms["nominal"] > 1e-3
    assert rms["calibrated"] < 0.4e-3


def test_corrected_joints_bring_the_tool_as_near_as_the_program_means_it(model, bare_drake, weld_path):
    """The correction knows nothing of shapes, the nominal cell nothing of the calibration: here they meet."""
    q, cell, pair = weld_path[::25], Cell("ur5", model), ("table::workpiece", "tool::tool")
    meant = np.array([bare_drake(row, 1.0)[pair] for row in q])
    before, after = (cell.clearances(joints, range_m=1.0).of(pair) for joints in (q, correct(model, q).q_rad))
    assert np.abs(after - meant).max() < 2e-5
    assert np.abs(before - meant).max() > 0.3e-3
