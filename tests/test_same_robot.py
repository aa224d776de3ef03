"""Whether a calibration fits a robot: its geometry decides, and a refusal says which numbers differ."""

from dataclasses import replace

import numpy as np
import pytest
from truepath import lie
from truepath.errors import InputError
from truepath.plants import load_robot
from truepath.same_robot import require_same_robot, what_differs


def moved(robot, joint, shift=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    """The robot with one axis elsewhere, in the base frame."""
    X_BA = robot.X_BA.copy()
    X_BA[joint, :3, 3] += shift
    X_BA[joint, :3, :3] = lie.from_rotation_vector(np.array(turn)) @ X_BA[joint, :3, :3]
    return replace(robot, X_BA=X_BA)


def test_names_limits_masses_and_place_do_not_count(ur5):
    other = replace(
        ur5,
        name="left",
        joint_names=tuple(f"left_{name}" for name in ur5.joint_names),
        upper_rad=0.5 * ur5.upper_rad,
        velocity_rad_s=2 * ur5.velocity_rad_s,
        link_mass_kg=3 * ur5.link_mass_kg,
        gravity_B=-ur5.gravity_B,
        X_WB=lie.make_pose(translation=np.ones(3)),
    )
    assert what_differs(ur5, other) == what_differs(other, ur5) == []
    require_same_robot(ur5, other)


def test_noise_far_below_a_nanometre_does_not_count(ur5):
    assert what_differs(ur5, moved(ur5, 2, shift=[0.0, 0.0, 1e-12], turn=[1e-13, 0.0, 0.0])) == []
    assert what_differs(ur5, moved(ur5, 2, shift=[0.0, 0.0, 1e-8])) != []


def test_another_size_is_told_by_the_lengths_of_the_links(ur5, ur10):
    """Upper arm and forearm as their maker states them: 425 and 392.25 mm of the UR5, 612 and 572.3 mm of the UR10."""
    found = "; ".join(what_differs(ur5, ur10))
    assert "from axis 2 to axis 3 612 mm instead of 425 mm" in found
    assert "from axis 3 to axis 4 572.3 mm instead of 392.25 mm" in found
    assert "from axis 2 to axis 3 425 mm instead of 612 mm" in "; ".join(what_differs(ur10, ur5))


def test_an_axis_that_stands_elsewhere_is_named_with_how_far(ur5):
    (turned,) = [
        each for each in what_differs(ur5, moved(ur5, 5, turn=[0.0, 0.0, np.radians(0.5)])) if "points" in each
    ]
    assert turned.startswith("axis 6 (wrist_3_joint)")
    assert "points 0.5 deg off" in turned
    (shifted,) = [each for each in what_differs(ur5, moved(ur5, 0, shift=[0.003, 0.004, 0.0])) if "points" in each]
    assert shifted == "axis 1 (shoulder_pan_joint) at zero lies 5 mm away and points 0 deg off"


def test_another_flange_is_told_as_such(ur5):
    X_BF = ur5.X_BF @ lie.make_pose(lie.from_rotation_vector(np.array([0.0, 0.0, np.pi / 2])), np.array([0, 0, 0.02]))
    (found,) = what_differs(ur5, replace(ur5, X_BF=X_BF))
    assert found == "all axes agree, but the flange is 20 mm and 90 deg away (see flange_frame)"


def test_another_number_of_joints_is_told_with_their_names(ur5, seven):
    (found,) = what_differs(ur5, seven)
    assert found.startswith("7 joints instead of 6: joint1, joint2")


def test_the_refusal_names_both_and_is_not_endless(ur5, ur10):
    with pytest.raises(InputError, match="another robot") as caught:
        require_same_robot(ur5, ur10, file="calibration.json")
    assert caught.value.file is not None
    assert "ur5" in caught.value.expected
    assert "ur10: from axis" in caught.value.found
    assert "differences more" in caught.value.found
    assert len(caught.value.found) < 500


def test_the_seal_of_files_by_earlier_versions_is_the_same_as_ever():
    """It covers the names of the joints; files carry it, so it must never come out otherwise."""
    assert load_robot("ur5").model_sha256[:16] == "70edbdbe4e25688c"
    assert load_robot("ur10").model_sha256[:16] == "f31229635f620313"
