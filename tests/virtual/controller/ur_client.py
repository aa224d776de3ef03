"""The unmodified ur_rtde in a process of its own, which can be killed: its constructors hold the interpreter."""

import importlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from itertools import count

from truepath.errors import InputError
from truepath.virtual.controller.process import ControllerProcess

KINDS = {
    "receive": ("rtde_receive", "RTDEReceiveInterface"),
    "control": ("rtde_control", "RTDEControlInterface"),
    "io": ("rtde_io", "RTDEIOInterface"),
    "dashboard": ("dashboard_client", "DashboardClient"),
    "script": ("script_client", "ScriptClient"),
}
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
NUMBERS = count(10 + 40 * (WORKER % 6))
BEGIN = "\x02"  # ur_rtde writes to standard output, too


class ClientError(Exception):
    """What ur_rtde raised."""


class ClientLostError(Exception):
    """The process has died, or does not answer."""


class UrClient:
    """Calls methods of ur_rtde's classes; objects are made when they are first needed.

    Args:
        address: of the controller.
        rate_hz: of the receive class.
    """

    def __init__(self, address, rate_hz=125.0):
        self.process = subprocess.Popen(
            [sys.executable, __file__, address, str(rate_hz)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()

    def __call__(self, kind, method, *arguments, patience_s=20.0):
        return self.calls([[kind, method, *arguments]], patience_s)[0]

    def calls(self, calls, patience_s=20.0):
        """Several in a row, ``[kind, method, arguments...]`` each; the list of results.

        Without a result: ``["sleep", seconds]``; ``["newer", time_s]``, which waits for samples of after that time of
        the robot; ``["upload"]``, which uploads the control script again and waits until it runs.
        """
        return self._asked(calls, patience_s)

    def _asked(self, question, patience_s):
        try:
            self.process.stdin.write(json.dumps(question) + "\n")
            self.process.stdin.flush()
        except OSError:
            raise ClientLostError from None
        killer = threading.Timer(patience_s, self.process.kill)
        killer.start()
        try:
            for line in self.process.stdout:
                if line.startswith(BEGIN):
                    answer = json.loads(line[1:])
                    break
            else:
                raise ClientLostError
        finally:
            killer.cancel()
        if "error" in answer:
            raise ClientError(answer["error"])
        return answer["result"]


def free_address():
    """A loopback address on which no controller listens; several test runs may go on at once."""
    for number in NUMBERS:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((f"127.0.1.{number}", 30004))
            except OSError:
                continue
        return f"127.0.1.{number}"
    raise AssertionError("no free address")


def controller(**options):
    """A virtual controller that has been started."""
    while True:
        process = ControllerProcess(free_address(), **options)
        try:
            return process.__enter__()
        except InputError as error:
            if "cannot be opened" not in str(error):
                raise


def _results(objects, make, calls):
    results = []
    for call in calls:
        kind, method, *arguments = [*call, None] if len(call) == 1 else call
        if kind == "sleep":
            time.sleep(method)
        elif kind == "upload":
            made(objects, make, "control").reuploadScript()
            while not made(objects, make, "control").isProgramRunning():
                time.sleep(0.001)
        elif kind == "newer":
            while made(objects, make, "receive").getTimestamp() <= method:
                time.sleep(0.001)
        else:
            results.append(getattr(made(objects, make, kind), method)(*arguments))
    return results


def made(objects, make, kind):
    if kind not in objects:
        objects[kind] = make(kind)
    return objects[kind]


def _serve(address, rate_hz):
    def make(kind):
        module, name = KINDS[kind]
        cls = getattr(importlib.import_module(module), name)
        if kind == "receive":
            return cls(address, rate_hz)
        if kind == "script":
            made = cls(address, 5, 13)
            made.connect()
            return made
        made = cls(address)
        if kind == "dashboard":
            made.connect()
        return made

    objects = {}
    for line in sys.stdin:
        try:
            answer = {"result": _results(objects, make, json.loads(line))}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(f"\n{BEGIN}{json.dumps(answer)}", flush=True)


if __name__ == "__main__":
    _serve(sys.argv[1], float(sys.argv[2]))
