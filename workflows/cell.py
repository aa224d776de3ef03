"""A small offline-programming host in Drake: a welding cell, a program, and truepath as its plugin.

Builds models/ur5/cell.dmd.yaml as a Drake diagram with a Meshcat, loads the plugin by its entry point, loads a
calibration (or measures and calibrates the virtual robot of the cell, which takes seconds), corrects the program, and
lets an operator look at it in a browser. Prints the address; ends with Ctrl-C.

    .venv/bin/python workflows/cell.py [PROGRAM] [--calibration FILE] [--port 7000]
"""

from __future__ import annotations

import argparse
import logging
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from truepath import plants
from truepath.errors import InputError, TruepathError

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, SceneGraph
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.framework import Context, Diagram

GROUP, NAME = "drake_olp.plugins", "truepath"
CELL, TOOL, PREFIX = "ur5_cell", "tool_tip", "/cell"
SKY, HORIZON = [1.0, 1.0, 1.0], [0.86, 0.89, 0.92]
HIDDEN, POSES, NOISE_MM = ("joint_compliance",), 100, 0.02


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options(arguments)
    try:
        operate(options)
    except TruepathError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print()
    return 0


def operate(options: argparse.Namespace) -> None:
    """Sets the host up, loads the plugin and shows the program until the time is over or somebody interrupts."""
    if not Path(options.program).is_file():  # before anybody waits for a calibration
        raise InputError("there is no such program", file=options.program)
    say = print if options.verbose else lambda text: None
    meshcat = start_meshcat(options.host, options.port)
    where = "this machine only" if options.host in ("localhost", "127.0.0.1") else f"whoever reaches {options.host}"
    print(f"open {meshcat.web_url()} in a browser (for {where}); Ctrl-C ends it", flush=True)
    host = Host(meshcat)
    plugin = load_plugin()(host.plant, tool_frame=TOOL, meshcat=meshcat, scene_graph=host.scene_graph)
    if options.calibration is None:
        calibrate_virtually(plugin, options.seed, say)
    else:
        plugin.load(options.calibration)
    if options.save_calibration is not None:
        plugin.save(options.save_calibration)

    from truepath.preview.figures import in_mm

    controls = plugin.operate(
        options.program,
        magnification=options.magnification,
        drawn_below=PREFIX,
        context=host.context,
        say=lambda text: print(text, flush=True),
    )
    course = controls.view.course
    for each in course.remarks:
        print(f"warning: {each.text}")
    print(f"looked for collisions in {course.shown.looked_in or 'no cell'}")
    before, after = (f"{in_mm(e.mean)} mm mean, {in_mm(e.max)} mm max" for e in course.at_waypoints())
    print(f"{Path(options.program).name}: predicted error of the tool {before}; corrected {after}")
    heldout = plugin.calibration.heldout
    if heldout is not None:
        known = heldout.calibrated.position_mm
        print(f"the calibration was off by {known.mean:.3f} mm mean, {known.max:.3f} mm max on poses it had not seen")
    print("ready: keys and buttons (Open Controls, top right) work in the browser", flush=True)
    meshcat.Flush()
    controls.run(0.0 if options.once else options.seconds)


class Host:
    """The host's own diagram: plant, scene graph, and a visualizer that draws the cell as it is drawn."""

    def __init__(self, meshcat: Meshcat) -> None:
        from pydrake.geometry import MeshcatVisualizer, MeshcatVisualizerParams, Role
        from pydrake.systems.framework import DiagramBuilder

        builder = DiagramBuilder()
        self.meshcat = meshcat
        self.plant: MultibodyPlant
        self.scene_graph: SceneGraph
        self.plant, self.scene_graph = plants.add_cell(builder, CELL)
        how = MeshcatVisualizerParams(prefix=PREFIX, role=Role.kIllustration)
        MeshcatVisualizer.AddToBuilder(builder, self.scene_graph, meshcat, how)
        self.diagram: Diagram = builder.Build()
        self.context: Context = self.diagram.CreateDefaultContext()
        self.diagram.ForcedPublish(self.context)
        self._brighten()

    def _brighten(self) -> None:
        """A bright background without a grid, against which thin lines are seen."""
        for part in ("/Grid", "/Axes"):
            self.meshcat.SetProperty(part, "visible", False)
        for key, colour in (("top_color", SKY), ("bottom_color", HORIZON)):
            self.meshcat.SetProperty("/Background/<object>", key, colour)


def start_meshcat(host: str, port: int | None) -> Meshcat:
    """A Meshcat that listens on one interface only, unless ``*`` is asked for.

    Raises:
        InputError: the port or the interface cannot be had.
    """
    from pydrake.geometry import Meshcat, MeshcatParams

    logging.getLogger("drake").setLevel(logging.WARNING)  # it would print the address a second time
    try:
        return Meshcat(MeshcatParams(host=host, port=port, show_stats_plot=False))
    except RuntimeError as error:
        raise InputError("Meshcat cannot be started", expected="a port that is free", found=str(error)) from None


def load_plugin() -> Any:
    """The plugin's class, found as any host would find it.

    Raises:
        InputError: it is not installed.
    """
    found = [each for each in entry_points(group=GROUP) if each.name == NAME]
    if not found:
        raise InputError(f"no plugin {NAME!r} in the group {GROUP!r}", expected="truepath installed: pip install -e .")
    return found[0].load()


def calibrate_virtually(plugin: Any, seed: int, say: Any) -> None:
    """Measures the virtual robot of the cell, which has hidden errors of its frames and soft joints, and calibrates.

    Raises:
        InputError: a negative seed.
    """
    from truepath.virtual.hidden_causes import draw_causes
    from truepath.virtual.real_robot import RealRobot
    from truepath.virtual.simulate import Campaign, free_poses, measure

    print(f"measuring and calibrating the virtual robot, seed {seed}", flush=True)
    real = RealRobot(CELL, seed)
    q = free_poses(real, POSES, np.random.default_rng(seed))
    measured = measure(real, q, Campaign(POSES, NOISE_MM, seed=seed), draw_causes(real, HIDDEN))
    measured = replace(measured, X_MB_nominal=plugin.robot.X_WB, X_FE_nominal=plugin.robot.X_FR)
    plugin.calibrate(measured, effects=HIDDEN, progress=say)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    default = plants.models_dir() / "ur5" / "weld.script"
    parser.add_argument("program", nargs="?", default=str(default), help="URScript or CSV; default: weld.script")
    parser.add_argument("--calibration", help="file of the robot's calibration; default: of the virtual robot")
    parser.add_argument("--save-calibration", help="file to write the calibration in use to")
    parser.add_argument("--seed", type=int, default=2, help="of the hidden errors of the virtual robot")
    parser.add_argument("--magnification", type=_factor, default=50.0, help="factor by which errors are drawn")
    parser.add_argument("--host", default="localhost", help="interface to listen on; * for all of them")
    parser.add_argument("--port", type=_port, help="default: the first free one from 7000")
    parser.add_argument("--seconds", type=_seconds, help="end after this time")
    parser.add_argument("--once", action="store_true", help="set everything up, and end")
    parser.add_argument("--verbose", action="store_true", help="say what the calibration is doing")
    return parser.parse_args(arguments)


def _number(text: str, least: float, most: float, what: str) -> float:
    value = float(text)
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"{text} is no {what}: {least:g} to {most:g}")
    return value


def _factor(text: str) -> float:
    return _number(text, 1.0, 10_000.0, "magnification")


def _seconds(text: str) -> float:
    return _number(text, 0.0, 1e9, "time")


def _port(text: str) -> int:
    return int(_number(text, 1024, 65535, "port"))


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends it as Ctrl-C does
    sys.exit(main())
