"""How one program of a batch is to be corrected, in the words of the command line."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

import truepath
from truepath import plants
from truepath.calibration import Calibration
from truepath.controller import NOMINAL, controller_of
from truepath.correct import MAX_CORRECTION_MM
from truepath.errors import InputError
from truepath.model_files import models_of as models_of
from truepath.rewriting.options import PATH_TOLERANCE_MM, RewriteOptions
from truepath.rewriting.stated import stated_options


def _with_commas(value: Any) -> Any:
    """A list of numbers, as JSON has it, becomes the text that the command line has."""
    is_list = isinstance(value, list) and all(type(each) in (int, float) for each in value)
    return ",".join(map(repr, value)) if is_list else value


Numbers = Annotated[str | None, BeforeValidator(_with_commas)]


class Settings(BaseModel):
    """Options of ``truepath correct`` that a program can have of its own; names and meaning are the same there."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_by_name=True, validate_by_alias=True
    )

    express: Literal["joints", "poses"] | None = Field(alias="as", default=None)
    controller_kinematics: str = Field(min_length=1, default=NOMINAL)
    path_tolerance_mm: float = Field(ge=0, default=PATH_TOLERANCE_MM)
    max_correction_mm: float = Field(gt=0, default=MAX_CORRECTION_MM)
    cell: str | None = Field(min_length=1, default=None)
    start_deg: Numbers = None
    tcp: Numbers = None
    payload_kg: float | None = Field(ge=0, default=None)

    def options(self, calibration: Calibration, controller_kinematics: str | None = None) -> RewriteOptions:
        """For a calibration, which tells what is left open here; ``controller_kinematics``: where that file lies.

        Raises:
            InputError: numbers that are none.
        """
        return stated_options(
            calibration,
            self.express,
            controller_kinematics or self.controller_kinematics,
            self.path_tolerance_mm,
            self.max_correction_mm,
            self.cell,
            self.start_deg,
            self.tcp,
        )

    def placed(self, beside: Path) -> Settings:
        """The same with files that are named by a relative path found from a folder, as absolute paths."""
        update = {}
        if self.controller_kinematics != NOMINAL:
            update["controller_kinematics"] = str((beside / self.controller_kinematics).absolute())
        if self.cell is not None and self.cell.endswith((".urdf", ".dmd.yaml")):
            update["cell"] = str((beside / self.cell).absolute())
        return self.model_copy(update=update)


class Prepared:
    """Settings checked against a calibration, with what must be known before a program is sent anywhere.

    Attributes:
        calibration_path, calibration: the file and its content.
        heldout_mm: errors on poses that the fit had not seen; None if none were held back.
        settings: as stated.
        controller_file: content of the file that ``controller_kinematics`` names; None for ``nominal``.
        key: hashes of all that a result depends on besides the program. Meshes of a cell are not looked into.
    """

    def __init__(self, path: Path, calibration: Calibration, content: bytes, settings: Settings) -> None:
        """Reads what the settings name.

        Raises:
            InputError: a file that is missing or bad.
        """
        self.calibration_path, self.calibration, self.settings = path, content, settings
        self.heldout_mm = None if calibration.heldout is None else calibration.heldout.calibrated.position_mm
        self.controller_file: bytes | None = None
        if settings.controller_kinematics != NOMINAL:
            controller_of(calibration.model.robot, settings.controller_kinematics)
            self.controller_file = _content(Path(settings.controller_kinematics))

        cell = settings.options(calibration).cell
        stated = {
            **settings.model_dump(),
            "controller_kinematics": _sha256(self.controller_file) if self.controller_file else NOMINAL,
            "cell": None if cell is None else [_sha256(_content(file)) for file in _files_of_the_cell(cell)],
        }
        self.key: Mapping[str, str] = {
            "calibration_sha256": _sha256(content),
            "options_sha256": _sha256(json.dumps(stated, sort_keys=True).encode()),
            "truepath": truepath.__version__,
        }


def _files_of_the_cell(cell: str) -> Iterator[Path]:
    path = plants.resolve(cell)
    yield path
    if path.suffix != ".urdf":
        for _, model in models_of(path):
            yield model


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError("the file cannot be read", file=path, found=error.strerror) from None


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
