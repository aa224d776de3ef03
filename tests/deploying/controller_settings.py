"""Changing a virtual controller while somebody is connected to it."""

import time


def setting(controller, link, **values):
    """Changes the controller, and waits until the link has seen it."""
    controller.command({"do": "set", **values})
    now_s = controller.command({"do": "state"})["time_s"]
    while link.state().time_s <= now_s:
        time.sleep(0.01)
