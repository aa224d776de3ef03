"""A cable that is pulled and a controller that is switched off: clients do not survive, the robot does."""

import time

import numpy as np
import pytest
from drawn_robot import HOME, until
from rtde_by_hand import Rtde
from ur_client import ClientLostError, UrClient

FAR = [1.5, -1.2, 1.1, -1.4, -1.3, 0.5]
NEAR = [0.2, -1.4, 1.7, -1.4, -1.4, 0.2]


def test_a_lost_connection_in_the_middle_of_a_move_does_not_stop_the_robot_and_comes_back(quick, fault, state):
    quick.command({"do": "set", "q_rad": HOME})
    with UrClient(quick.address) as client:
        client("control", "isConnected")
        fault("connection_lost", 0.4, for_s=0.4)
        with pytest.raises(ClientLostError):
            client("control", "moveJ", FAR, 0.2, 1.4, patience_s=1.2)
    assert any("all connections are cut" in line for line in quick.log())
    until(lambda: np.allclose(state()["commanded_q_rad"], FAR, atol=1e-9))
    with UrClient(quick.address) as again:
        assert np.allclose(again("receive", "getActualQ"), FAR, atol=1e-9)
        assert again("control", "moveJ", HOME, 1.0, 1.4)


def test_while_the_connection_is_lost_nobody_can_connect(quick, fault):
    fault("connection_lost", for_s=0.3)
    time.sleep(0.1)
    with pytest.raises(OSError):  # noqa: PT011
        Rtde(quick.address)
    until(lambda: connects(quick.address))


def connects(address):
    try:
        with Rtde(address):
            return True
    except OSError:
        return False


def test_a_restart_forgets_program_and_registers_but_not_where_the_arm_stands(quick, fault, state):
    quick.command({"do": "set", "q_rad": HOME})
    with UrClient(quick.address) as client:
        client("control", "moveJ", NEAR, 1.0, 1.4)
        client.calls([["io", "setStandardDigitalOut", 1, True], ["sleep", 0.1]])
    assert state()["digital_outputs"] == 2
    fault("restart", for_s=0.3)
    until(lambda: state()["program"] is None)
    until(lambda: connects(quick.address))
    assert state()["digital_outputs"] == 0
    assert np.allclose(state()["commanded_q_rad"], NEAR)
