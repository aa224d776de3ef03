"""What is written down as payload. The tool of the built-in cell weighs 0.86 + 0.17 kg (models/cell/tool.urdf)."""

from dataclasses import replace

import numpy as np
import pytest
from truepath.plants import load_robot
from truepath.recording.payload import extra_payload_kg
from truepath.robot_link import RobotFault, RobotState

Q = np.zeros(6)
STATE = RobotState(0.0, 0.0, Q, Q, Q, Q, Q, 7, "normal", False)


@pytest.mark.parametrize(("set_kg", "extra_kg"), [(1.03, 0.0), (1.5, 0.47), (0.95, 0.0)])
def test_the_tool_of_the_model_is_no_payload(set_kg, extra_kg):
    assert extra_payload_kg(replace(STATE, payload_kg=set_kg), load_robot("ur5_cell")) == pytest.approx(extra_kg)


def test_on_abare_arm_all_of_it_is():
    assert extra_payload_kg(replace(STATE, payload_kg=1.03), load_robot("ur5")) == pytest.approx(1.03)


@pytest.mark.parametrize("set_kg", [0.0, 0.5, None])
def test_a_payload_that_cannot_be_is_not_written_down(set_kg):
    with pytest.raises(RobotFault, match="--payload-kg"):
        extra_payload_kg(replace(STATE, payload_kg=set_kg), load_robot("ur5_cell"))
