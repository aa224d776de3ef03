"""The hash of the nominal model changes with geometry and names, and with nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from arm_judge import load
from truepath.plants import load_plant
from truepath.robot import read_robot


def test_the_hash_does_not_depend_on_where_the_robot_stands(seven_joint_urdf, seven, ur5):
    stand = 'xyz="0.3 -0.2 0.7" rpy="0.5 -0.3 1.1"'
    for elsewhere in ('xyz="0 0 0" rpy="0 0 0"', 'xyz="-12.3 4.5 6.7" rpy="1 2 3"', 'xyz="1e3 0 0" rpy="-3 0.1 0"'):
        moved = read_robot(load(seven_joint_urdf.replace(stand, elsewhere)))
        assert not np.allclose(moved.X_WB, seven.X_WB)
        assert moved.model_sha256 == seven.model_sha256
    assert read_robot(load_plant("ur5_cell")).model_sha256 == ur5.model_sha256


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('xyz="0.04 -0.03 0.19"', 'xyz="0.04 -0.03001 0.19"'),  # a link, 10 um
        ('rpy="0.4 0.3 -0.6"', 'rpy="0.4 0.3 -0.60001"'),  # a joint, 10 urad
        ('axis xyz="0 -1 0"', 'axis xyz="0 1 0"'),  # a sense of rotation
        ('rpy="0.3 -0.2 0.4"', 'rpy="0.3 -0.2 0.401"'),  # a bracket between two joints
        ('xyz="0.02 -0.01 0.09"', 'xyz="0.02 -0.01 0.0901"'),  # the flange
        ('"joint5"', '"joint_5"'),  # a name
    ],
)
def test_the_hash_changes_with_the_geometry_and_with_the_names_of_the_joints(seven_joint_urdf, seven, old, new):
    assert old in seven_joint_urdf
    assert read_robot(load(seven_joint_urdf.replace(old, new))).model_sha256 != seven.model_sha256


def test_the_hash_does_not_change_with_masses_or_limits(seven_joint_urdf, seven):
    text = seven_joint_urdf.replace('<mass value="3.1"/>', '<mass value="9"/>').replace('upper="2.1"', 'upper="2.05"')
    other = read_robot(load(text))
    assert other.link_mass_kg[0] != seven.link_mass_kg[0]
    assert other.upper_rad[1] != seven.upper_rad[1]
    assert other.model_sha256 == seven.model_sha256


def test_the_hash_does_not_change_with_noise_far_below_a_nanometre(seven):
    noise = 1e-13 * np.random.default_rng(0).normal(size=(7, 4, 4))
    assert replace(seven, X_BA=seven.X_BA + noise, X_BF=seven.X_BF - noise[0]).model_sha256 == seven.model_sha256


def test_the_hash_tells_the_built_in_robots_apart(ur5, ur10, seven):
    assert len({ur5.model_sha256, ur10.model_sha256, seven.model_sha256}) == 3
