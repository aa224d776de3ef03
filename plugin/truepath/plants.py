"""Finding a robot: a built-in name, a URDF or a Drake directives file becomes a finalized plant."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from truepath.errors import InputError
from truepath.robot import NominalRobot, read_robot

if TYPE_CHECKING:
    from pydrake.geometry import SceneGraph
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.framework import DiagramBuilder

HOSTS_PLANT = "a host's plant"  # stands for a source where the plant of a host was never a file

BUILT_IN = {
    "ur5": "ur5/ur5.urdf",
    "ur10": "ur10/ur10.urdf",
    "ur5_cell": "ur5/cell.dmd.yaml",
    "ur10_cell": "ur10/cell.dmd.yaml",
}


def models_dir() -> Path:
    """The folder ``models``: inside an installed package, or beside ``plugin`` in a checkout."""
    installed = Path(__file__).parent / "models"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "models"


def resolve(spec: str | Path, called: str = "robot") -> Path:
    """The file behind a built-in name or a path.

    Args:
        called: what the message calls it.

    Raises:
        InputError: neither a built-in name nor an existing ``.urdf`` or ``.dmd.yaml`` file.
    """
    if str(spec) in BUILT_IN:
        return models_dir() / BUILT_IN[str(spec)]
    if str(spec) == HOSTS_PLANT:
        raise InputError(
            "this calibration was made on a host's own plant in memory, so it names no file of the robot",
            expected="--robot with the URDF or directives of that robot; or robot_source=, given to the host's "
            "CalibrationPlugin before it saves",
        )
    path = Path(spec)
    try:
        exists, is_file = path.exists(), path.is_file()
    except (OSError, ValueError):  # no name that a file could have
        exists = is_file = False
    if not is_file or not path.name.endswith((".urdf", ".dmd.yaml")):
        raise InputError(
            f"no {called} {str(spec)!r}",
            expected=f"a built-in name ({', '.join(BUILT_IN)}) or an existing .urdf or .dmd.yaml file",
            found="a file of another kind" if exists else "no such file",
        )
    return path


def cell_of(spec: str | Path) -> str | Path:
    """The whole cell: for a built-in robot the one that comes with it, else the model itself."""
    return f"{spec}_cell" if f"{spec}_cell" in BUILT_IN else spec


def make_parser(plant: MultibodyPlant) -> Parser:
    """A Drake parser that knows ``package://truepath_models``."""
    from pydrake.multibody.parsing import Parser

    parser = Parser(plant)
    parser.package_map().Add("truepath_models", str(models_dir()))
    return parser


def add_model(plant: MultibodyPlant, spec: str | Path) -> None:
    """Adds a robot or a cell to a plant that is not finalized yet. A free base is welded to the world.

    Raises:
        InputError: Drake cannot read the file; its own words are passed on.
    """
    path = resolve(spec)
    try:
        added = make_parser(plant).AddModels(str(path))
    except (RuntimeError, ValueError) as error:
        raise InputError("Drake cannot read this model", file=path, found=str(error)) from error
    if not added or not plant.GetBodyIndices(added[0]):
        raise InputError("there is no body in this model", file=path)
    if path.suffix == ".urdf":
        base = plant.get_body(plant.GetBodyIndices(added[0])[0])
        children = {int(plant.get_joint(i).child_body().index()) for i in plant.GetJointIndices(added[0])}
        if int(base.index()) not in children:
            plant.WeldFrames(plant.world_frame(), base.body_frame())


def add_cell(builder: DiagramBuilder, spec: str | Path) -> tuple[MultibodyPlant, SceneGraph]:
    """Adds a finalized plant with a scene graph to a diagram under construction."""
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph

    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    add_model(plant, spec)
    plant.Finalize()
    return plant, scene_graph


def load_plant(spec: str | Path) -> MultibodyPlant:
    """A finalized plant, without geometry."""
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(time_step=0.0)
    add_model(plant, spec)
    plant.Finalize()
    return plant


@lru_cache(maxsize=8)
def _load_robot(path: Path, changed_ns: int) -> NominalRobot:
    return read_robot(load_plant(path))


def load_robot(spec: str | Path) -> NominalRobot:
    """The nominal robot behind a built-in name, a URDF or a directives file; read once per process."""
    path = resolve(spec).resolve()
    return _load_robot(path, path.stat().st_mtime_ns)
