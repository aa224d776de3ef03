"""Command about the virtual controller: controller."""

from __future__ import annotations

from typing import Annotated

import typer

from truepath.cli_options import RobotSpec


def controller(
    address: Annotated[str, typer.Option(help="loopback address; its ports are a UR's, so each needs its own")] = (
        "127.0.0.1"
    ),
    robot: RobotSpec = "ur5_cell",
    seed: Annotated[int, typer.Option(help="of the robot's hidden errors")] = 0,
    hide: Annotated[
        list[str] | None,
        typer.Option(
            help="hide causes besides frame errors, comma-separated or one by one: transmission_error, "
            "joint_compliance, backlash, frame_drift, tool_shift"
        ),
    ] = None,
    noise_mm: Annotated[float, typer.Option(min=0, help="noise of each coordinate of the tracker")] = 0.02,
    speed_up: Annotated[float, typer.Option(help="how many times faster than the clock on the wall it lives")] = 1.0,
    payload_kg: Annotated[float | None, typer.Option(help="set on the controller; default: as the cell is drawn")] = (
        None
    ),
    tcp: Annotated[str | None, typer.Option(help="tool on the flange: x,y,z,rx,ry,rz in m and rad")] = None,
    tracker_at: Annotated[
        str | None, typer.Option(help="x,y,z of the tracker in the world, m; default: it measures in the world")
    ] = None,
    acceptance_deg: Annotated[
        float, typer.Option("--acceptance-deg", help="half angle of the reflector's cone, seen by that tracker")
    ] = 180.0,
    tracker_port: Annotated[int, typer.Option(min=1024, max=65535, help="where the tracker's readings are")] = 30100,
    local_control: Annotated[bool, typer.Option("--local-control", help="the robot is not in remote control")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="something goes wrong, NAME:AFTER_S or NAME:AFTER_S:FOR_S: protective_stop, emergency_stop, "
            "connection_lost, late_packets, missing_packets, beam_break, restart"
        ),
    ] = None,
) -> None:
    """Play a UR controller on this machine, a robot with hidden errors and a tracker behind it; Ctrl-C ends it."""
    import logging

    from truepath import console
    from truepath.virtual.controller.foreground import run_in_foreground, stated_fault
    from truepath.virtual.controller.options import ControllerOptions

    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(message)s")
    options = ControllerOptions(
        address=address,
        robot=robot,
        seed=seed,
        hide=[name.strip() for text in hide or () for name in text.split(",")],
        noise_mm=noise_mm,
        speed_up=speed_up,
        payload_kg=payload_kg,
        tcp_offset=_numbers(tcp, 6, "--tcp"),
        remote_control=not local_control,
        tracker_port=tracker_port,
        tracker_at_m=_numbers(tracker_at, 3, "--tracker-at"),
        acceptance_deg=acceptance_deg,
    )
    run_in_foreground(options, [stated_fault(text) for text in fault or ()], console.out.print)
    console.out.print("the controller is off")


def _numbers(text: str | None, count: int, option: str) -> list[float] | None:
    from truepath.errors import InputError

    if text is None:
        return None
    try:
        numbers = [float(cell) for cell in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        raise InputError(f"{option} is a list of numbers", expected=f"{count} numbers, commas between", found=text)
    return numbers
