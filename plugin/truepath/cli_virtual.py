"""Commands about the virtual cell: simulate, demo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from truepath.cli_options import Output, RobotSpec


def simulate(
    output: Output,
    robot: RobotSpec = "ur5_cell",
    poses: Annotated[int, typer.Option(min=1, help="number of different poses")] = 300,
    noise_mm: Annotated[float, typer.Option(min=0, help="noise of each measured coordinate")] = 0.02,
    orientation_noise_mrad: Annotated[
        float | None, typer.Option(min=0, help="measure orientation too, with this noise per axis")
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="visits of each pose")] = 1,
    tracker: Annotated[
        bool, typer.Option("--tracker", help="in a tracker's frame instead of the cell's world")
    ] = False,
    seed: Annotated[int, typer.Option(help="of the robot's hidden errors")] = 0,
    poses_seed: Annotated[int, typer.Option(help="of poses and noise")] = 0,
    hide: Annotated[
        list[str] | None,
        typer.Option(
            help="hide causes besides frame errors, comma-separated or one by one: transmission_error, "
            "joint_compliance, backlash, frame_drift, tool_shift"
        ),
    ] = None,
    truth: Annotated[Path | None, typer.Option(help="also write what was hidden")] = None,
) -> None:
    """Make measured data of a virtual robot with hidden errors; the truth is computed by Drake."""
    from truepath import console
    from truepath.pipeline import require_place, simulate_campaign
    from truepath.virtual.simulate import Campaign

    require_place(output)
    names = [name.strip() for text in hide or () for name in text.split(",")]
    campaign = Campaign(poses, noise_mm, orientation_noise_mrad, repeats, tracker, poses_seed)
    with console.progress("simulating"):
        rows = simulate_campaign(robot, seed, campaign, output, truth, names)
    console.out.print(f"{rows} measurements written to {output}")


def demo(
    folder: Annotated[Path, typer.Option("--folder", help="where the results go")] = Path("truepath-demo"),
    seed: Annotated[int, typer.Option(help="of the virtual robot's hidden errors")] = 0,
    show: Annotated[
        bool | None,
        typer.Option("--open/--no-open", help="open the preview in a browser; default: where somebody looks on"),
    ] = None,
) -> None:
    """Run everything on the built-in virtual cell: simulate, diagnose, validate, correct, preview."""
    from truepath import browser, console
    from truepath.demo import run_demo

    with console.progress("demo") as say:
        result = run_demo(folder, seed, say)
    console.out.print(result.verdict, style="bold")
    console.print_accuracy("on 200 fresh poses", result.validation.nominal, result.validation.calibrated)
    console.out.print(
        f"welding path, tool error computed by Drake: mean {result.before_mm.mean():.3f} mm as programmed, "
        f"{result.after_mm.mean():.3f} mm corrected "
        f"({result.before_mm.mean() / result.after_mm.mean():.0f} times better)"
    )
    wanted = browser.somebody_looks_on() if show is None else show
    opened = wanted and browser.open_page(result.preview)
    if show and not opened:
        console.warn("no browser could be started")
    console.out.print("the preview is open in a browser:" if opened else "open in a browser:")
    console.out.print(f"  {result.preview.resolve()}  the path, as programmed and corrected")
    console.out.print(f"  {result.report.resolve()}  what is wrong with the robot, and why")
