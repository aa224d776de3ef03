"""The calibration file: the one artefact between measuring and correcting. Schema, save, load.

Plain JSON, nothing in it is executed. Everything is checked when it is read: types, finite numbers,
shapes, rotations, the hash of the nominal model, and a checksum over the whole content.
"""

from __future__ import annotations

import json
import math
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator
from typing_extensions import Self

from truepath.calibration_parts import (
    DataPart,
    EffectPart,
    FramePart,
    HeldOutPart,
    NoisePart,
    Parameter,
    Part,
    RegionPart,
    RobotPart,
)
from truepath.calibration_residual import ResidualPart
from truepath.checksum import checksum
from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.model import CalibratedModel
from truepath.poe import parameter_names
from truepath.robot import NominalRobot
from truepath.same_robot import require_same_robot

SCHEMA: Literal["truepath.calibration/1"] = "truepath.calibration/1"
MAX_BYTES = 256 << 20


class Calibration(Part):
    """The content of ``calibration.json``."""

    schema_: Literal["truepath.calibration/1"] = Field(alias="schema", default=SCHEMA)
    created_utc: str
    software: dict[str, str]
    robot: RobotPart
    base: FramePart
    tool: FramePart
    parameters: list[Parameter]
    effects: list[EffectPart]
    residual: ResidualPart | None = None
    region: RegionPart
    noise: NoisePart
    heldout: HeldOutPart | None
    data: DataPart

    @model_validator(mode="after")
    def _fits_the_robot(self) -> Self:
        n = len(self.robot.joint_names)
        expected = [(str(name), name.joint, name.unit) for name in parameter_names(n)]
        if [(p.name, p.joint, p.unit) for p in self.parameters] != expected:
            raise ValueError(f"the parameters are not those of a robot with {n} joints")
        if not all(effect.fitted().term.fits(n) for effect in self.effects):
            raise ValueError(f"an effect at a place that a robot with {n} joints does not have")
        if self.residual is not None and not self.residual.fits(n):
            raise ValueError(f"a neural residual that is not for a robot with {n} joints")
        shapes = (len(self.region.lower_rad), len(self.region.upper_rad), len(self.region.mean_rad))
        if shapes != (n, n, n) or np.shape(self.region.whitening) != (n, n):
            raise ValueError(f"the region is not that of a robot with {n} joints")
        return self

    @cached_property
    def model(self) -> CalibratedModel:
        """The calibrated robot, ready to predict."""
        return CalibratedModel(
            robot=self.robot.robot(),
            p=np.array([parameter.value for parameter in self.parameters]),
            X_MB=self.base.estimated.matrix(),
            X_FE=self.tool.estimated.matrix(),
            X_MB_nominal=self.base.nominal.matrix(),
            X_FE_nominal=self.tool.nominal.matrix(),
            base_is_given=self.base.nominal_source == "given",
            tool_is_given=self.tool.nominal_source == "given",
            effects=tuple(effect.fitted() for effect in self.effects),
            payload_kg=self.data.payload_kg,
            residual=None if self.residual is None else self.residual.residual(),
        )

    def carrying(self, payload_kg: float | None) -> Calibration:
        """For a program with another payload on the flange than there was during the measurements; None: the same."""
        if payload_kg is None:
            return self
        if not (math.isfinite(payload_kg) and payload_kg >= 0):
            raise InputError("this is no payload", expected="0 kg or more", found=str(payload_kg))
        content = self.model_dump(by_alias=True)
        content["data"]["payload_kg"] = payload_kg
        return Calibration.model_validate(content)

    def to_json(self) -> str:
        """Text of the file: indented JSON that ends with a checksum over all that stands before it."""
        content = self.model_dump(by_alias=True)
        return json.dumps({**content, "checksum": checksum(content)}, indent=1, allow_nan=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Writes the file as a whole or not at all."""
        write_atomically(path, self.to_json())


def load_calibration(path: str | Path, robot: NominalRobot | None = None) -> Calibration:
    """Reads and checks a calibration file.

    Args:
        path: the file.
        robot: if given, the calibration must be one of this robot, by its geometry: see ``same_robot``.

    Raises:
        InputError: missing, truncated, tampered with, of a newer schema, or of another robot.
    """
    path = Path(path)
    content = _read_json(path)
    schema = content.get("schema")
    if schema != SCHEMA:
        newer = isinstance(schema, str) and schema.startswith("truepath.calibration/")
        raise InputError(
            "the calibration was written by another version of truepath" if newer else "this is no calibration file",
            file=path,
            expected=f"schema {SCHEMA!r}",
            found=repr(schema)[:80] + (" (update truepath to read it)" if newer else ""),
        )
    stated = content.pop("checksum", None)
    if stated != checksum(content):
        raise InputError(
            "the calibration was changed after truepath wrote it",
            file=path,
            expected="the checksum of its content",
            found="no checksum" if stated is None else "another one",
        )
    try:
        calibration = Calibration.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError(f"the calibration is not valid at {place or 'top level'}: {first['msg']}", file=path) from None
    if robot is not None:
        require_same_robot(robot, calibration.model.robot, file=path)
    return calibration


def _read_json(path: Path) -> dict:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError("the file is too large for a calibration", file=path, expected="256 MiB at most")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        found = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise InputError("the calibration cannot be read", file=path, found=found) from None
    try:
        content = json.loads(text, object_pairs_hook=_without_doubles)
    except (ValueError, RecursionError) as error:  # ValueError alone: an integer of thousands of digits
        line = getattr(error, "lineno", None)
        raise InputError(
            "the calibration is cut off or no JSON",
            file=path,
            line=line,
            expected="a calibration file, as truepath calibrate or diagnose writes it",
            found=getattr(error, "msg", str(error)),
        ) from None
    if not isinstance(content, dict):
        raise InputError("this is no calibration file", file=path, expected=f"an object with schema {SCHEMA!r}")
    return content


def _without_doubles(pairs: list[tuple[str, object]]) -> dict:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a name appears twice in one object")
    return content
