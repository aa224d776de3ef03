"""Command plan: which poses to measure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from truepath.cli_options import Json, Output
from truepath.errors import InputError


def _two_files(stated: tuple[Path, Path] | None) -> tuple[Path, Path] | None:
    """Refuses an option that was taken for the second file, before it is missed."""
    if stated is not None and str(stated[1]).startswith("-"):
        raise InputError(
            "--improve needs two files",
            expected="--improve calibration.json data.csv",
            found=f"{stated[0]}, then {stated[1]}",
        )
    return stated


def plan(
    output: Output,
    robot: Annotated[str, typer.Option("--robot", help="ur5, ur10, a .urdf or a .dmd.yaml")] = "ur5",
    cell: Annotated[
        str | None,
        typer.Option(help="where it stands: ur5_cell, a .dmd.yaml; none: only joint limits count; default: its own"),
    ] = None,
    poses: Annotated[int, typer.Option(min=1, help="number of measurements, visits of the same pose counted")] = 60,
    effects: Annotated[
        str, typer.Option(help="to be estimated besides the kinematics: none, or names with commas between them")
    ] = "none",
    criterion: Annotated[
        str, typer.Option(help="I: the tool position over the workspace; D: all parameters together")
    ] = "I",
    repeats: Annotated[
        int | None, typer.Option(min=0, help="measurements that visit a pose again [default: one in 15]")
    ] = None,
    tracker: Annotated[
        str | None, typer.Option(help="x,y,z of the tracker in the world, m; default: it sees everything")
    ] = None,
    range_m: Annotated[str, typer.Option("--range-m", help="nearest,farthest distance of the reflector, m")] = "0.5,10",
    acceptance_deg: Annotated[
        float, typer.Option("--acceptance-deg", help="half angle of the reflector's cone; 180: seen from everywhere")
    ] = 30.0,
    reflector_axis: Annotated[
        str, typer.Option(help="where the reflector looks, in its frame: x, y, z, -x, -y, -z")
    ] = "z",
    aim: Annotated[
        str | None, typer.Option(help="x,y,z of a point in the world at which a tracker that cannot turn looks, m")
    ] = None,
    view_deg: Annotated[float, typer.Option("--view-deg", help="half angle of what that tracker sees")] = 180.0,
    probe: Annotated[str, typer.Option(help="reflector on the flange: model, or x,y,z in mm")] = "model",
    noise_mm: Annotated[float, typer.Option("--noise-mm", help="expected noise of each coordinate")] = 0.02,
    orientation_noise_mrad: Annotated[
        float | None, typer.Option("--orientation-noise-mrad", help="of a 6D probe, per axis; default: a reflector")
    ] = None,
    clearance_mm: Annotated[float, typer.Option("--clearance-mm", help="to keep at poses; on ways half of it")] = 20.0,
    speed_deg_s: Annotated[float, typer.Option("--speed-deg-s", help="of the robot, to estimate the time")] = 30.0,
    improve: Annotated[
        tuple[Path, Path] | None,
        typer.Option(
            help="both files, one after the other: poses for what is still uncertain or ambiguous",
            metavar="CALIBRATION.JSON DATA.CSV",
            callback=_two_files,
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="of all chance: the same seed, the same plan")] = 0,
    json: Json = False,
) -> None:
    """Plan which poses to measure, in which order, on which way."""
    import math

    from truepath import console
    from truepath.files import write_atomically
    from truepath.pipeline import keep, require_place
    from truepath.planning.campaign import Pace, plan_campaign
    from truepath.planning.design import Wish
    from truepath.planning.pose_list import to_csv
    from truepath.planning.setup import feasible_poses, robot_in_cell, stated_noise
    from truepath.planning.sight import stated_sight
    from truepath.planning.summary import figures, print_plan

    require_place(output)
    wish = Wish(poses, poses // 15 if repeats is None else repeats, criterion.upper())
    if not (math.isfinite(speed_deg_s) and speed_deg_s > 0):
        raise InputError("no such speed", expected="more than 0 degrees a second", found=f"{speed_deg_s:g}")
    pace = Pace(speed_rad_s=math.radians(speed_deg_s))
    sight = stated_sight(tracker, range_m, acceptance_deg, reflector_axis, aim, view_deg)
    margin_m = 1e-3 * clearance_mm
    standing, spec = robot_in_cell(robot, cell)
    confusions: list[str] = []
    with console.progress("planning") as say:
        if improve is None:
            names = () if effects == "none" else tuple(name.strip() for name in effects.split(","))
            feasible = feasible_poses(standing, spec, probe, sight, margin_m=margin_m, seed=seed)
            noise = stated_noise(noise_mm, orientation_noise_mrad)
            planned = plan_campaign(feasible, wish, noise, names, pace=pace, seed=seed, say=say)
        else:
            from truepath.planning.improve import plan_from_files

            keep(output, *improve)
            found = plan_from_files(
                improve, standing, spec, sight, effects, wish, margin_m=margin_m, pace=pace, seed=seed, say=say
            )
            planned, confusions = found.plan, [confusion.why for confusion in found.confusions]
    write_atomically(output, to_csv(planned.poses))
    if json:
        console.print_json({"output": str(output), **figures(planned), "ambiguous": confusions})
        return
    print_plan(planned, sight, None if spec is None else str(spec))
    for why in confusions:
        console.warn(f"to be told apart: {why}")
    console.out.print(f"written to {output}")
