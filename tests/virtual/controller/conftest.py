"""A virtual controller with a client for each module of tests."""

import numpy as np
import pytest
from drawn_robot import HOME, SPEED_UP, TOOL, Drawn
from rtde_by_hand import Rtde
from ur_client import UrClient, controller


@pytest.fixture(scope="session")
def drawn():
    return Drawn()


@pytest.fixture(scope="module")
def quick():
    """A controller that lives several times faster than the clock on the wall."""
    process = controller(seed=3, speed_up=SPEED_UP, tcp_offset=TOOL)
    yield process
    process.close()


@pytest.fixture(scope="module")
def client(quick):
    """ur_rtde, connected to it."""
    with UrClient(quick.address) as connected:
        yield connected


@pytest.fixture
def home(quick, client):
    """Joints at which the arm stands, whatever the test before left; the client has control."""
    quick.command({"do": "recover"})
    client("control", "isConnected")
    if quick.command({"do": "state"})["program"] != "rtde_control":
        client.calls([["upload"]])
    quick.command({"do": "set", "q_rad": HOME, "tcp_offset": TOOL})
    client.calls([["newer", quick.command({"do": "state"})["time_s"]]])
    return np.array(HOME)


@pytest.fixture
def state(quick):
    """Function: what is true of the controller."""
    return lambda: quick.command({"do": "state"})


@pytest.fixture
def fault(quick):
    """Function: lets a fault happen."""

    def happen(name, after_s=0.0, **more):
        quick.command({"do": "fault", "name": name, "after_s": after_s, **more})

    return happen


@pytest.fixture
def watched(quick, client, home):
    """Function: a call of the client, after which the robot stands; joints, speeds, TCP poses ``(N, 6)`` meanwhile."""

    def watch(*call):
        names = ["actual_q", "actual_qd", "actual_TCP_pose"]
        with Rtde(quick.address) as reader:
            reader.start(["timestamp", *names], 250.0)  # what is not read at once waits: nothing is missed
            assert client(*call)
            end = quick.command({"do": "state"})["time_s"]
            samples = [reader.sample()]
            while samples[-1]["timestamp"] < end:
                samples.append(reader.sample())
        return [np.array([sample[name] for sample in samples]) for name in names]

    return watch
