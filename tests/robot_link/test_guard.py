"""The guard: it stops a robot that nobody watches, and goes on until it does."""

import time

import numpy as np
from truepath.robot_link import RobotFault, guard_child
from truepath.robot_link.guard import Guard

WALK = "def walk():\n  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=1, v=0.01)\nend\n"


def program(controller):
    return controller.command({"do": "state"})["program"]


def test_a_watcher_that_falls_silent_watches_no_more(controller, link):
    with Guard(controller.address) as guard:
        guard.is_sending(silence_s=5.0)
        link.send_program(WALK)
        end = time.monotonic() + 0.6
        while time.monotonic() < end:
            guard.is_sending(0.0, silence_s=0.5)
            time.sleep(0.05)
        assert program(controller) == "walk"
        time.sleep(0.9)
        assert program(controller) is None
        assert np.abs(controller.command({"do": "state"})["speed_rad_s"]).max() == 0.0
        guard.release()


def test_a_robot_that_is_out_of_reach_for_a_minute_is_stopped_then(monkeypatch):
    clock, told = [0.0], []

    def reachable():
        clock[0] += 1.0
        if clock[0] < 60.0:
            raise RobotFault("no route to host")

    def ask(host, question, timeout_s):
        reachable()
        told.append(question)
        return "STOPPED" if "stop" in told[:-1] else "PLAYING"

    def send(host, text, timeout_s):
        reachable()
        told.append(text)

    class Clock:
        monotonic = staticmethod(lambda: clock[0])
        sleep = staticmethod(lambda seconds: clock.append(clock.pop() + seconds))

    monkeypatch.setattr(guard_child, "time", Clock)
    monkeypatch.setattr(guard_child, "ask_dashboard", ask)
    monkeypatch.setattr(guard_child, "send_program", send)
    guard_child.stop("127.0.2.95", 0.0, guard_child.Watch().tries_s)
    assert "stop" in told
    assert guard_child.STOP_PROGRAM in told
    assert 60.0 <= clock[0] < 90.0
