"""Clearances in a cell that is simple enough to do by hand: a ball on two links before a wall, over a floor."""

from dataclasses import replace

import numpy as np
import pytest
from truepath.clearance import RANGE_M, Cell
from truepath.effects.base import EffectParameter, FittedTerm, Term
from truepath.errors import InputError
from truepath.model import nominal_model
from truepath.motions import Moves
from truepath.plants import load_robot

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
