"""The calibration file: the one artefact between measuring and correcting. Schema, save, load.

Plain JSON, nothing in it is executed. Everything is checked when it is read: types, finite numbers,
shapes, rotations, the hash of the nominal model, and a checksum over the whole content.
"""

from __future__ import annotations

import hashlib
import json
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from typing_extensions import Self

from truepath import lie
from truepath.errors import InputError
from truepath.files import write_atomically
from truepath.lie import Array
from truepath.model import CalibratedModel
from truepath.poe import parameter_names
from truepath.region import Region
from truepath.robot import NominalRobot

SCHEMA = "truepath.calibration/1"
MAX_BYTES = 256 << 20

Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Pose(_Part):
    """A rigid transform: translation in m, rotation matrix row by row."""

    translation_m: Vector3
    rotation: Annotated[list[Vector3], Field(min_length=3, max_length=3)]

    @classmethod
    def of(cls, X: Array) -> Pose:
        return cls(translation_m=X[:3, 3].tolist(), rotation=X[:3, :3].tolist())

    @model_validator(mode="after")
    def _is_rotation(self) -> Self:
        R = np.array(self.rotation)
        # Sizes first: the product of huge numbers is no number, and that would pass every comparison.
        if np.abs(R).max() > 2 or np.abs(R @ R.T - np.eye(3)).max() > 1e-9 or np.linalg.det(R) < 0:
            raise ValueError("the matrix is no rotation")
        return self

    def matrix(self) -> Array:
        return lie.make_pose(np.array(self.rotation), np.array(self.translation_m))


class RobotPart(_Part):
    """The nominal robot, as it was read from its Drake plant. Limits are null where the model has none."""

    name: str
    source: str
    model_sha256: str
    joint_names: Annotated[list[str], Field(min_length=2)]
    axes: list[Pose]
    zero_pose: Pose
    lower_rad: list[Finite | None]
    upper_rad: list[Finite | None]
    velocity_rad_s: list[Finite | None]
    acceleration_rad_s2: list[Finite | None]
    link_mass_kg: list[Finite]
    link_centre_m: list[Vector3]
    gravity_m_s2: Vector3
    world_base: Pose
    reflector: Pose | None

    @classmethod
    def of(cls, robot: NominalRobot, source: str) -> RobotPart:
        def limits(values: Array) -> list[float | None]:
            return [float(v) if np.isfinite(v) else None for v in values]

        return cls(
            name=robot.name,
            source=source,
            model_sha256=robot.model_sha256,
            joint_names=list(robot.joint_names),
            axes=[Pose.of(X) for X in robot.X_BA],
            zero_pose=Pose.of(robot.X_BF),
            lower_rad=limits(robot.lower_rad),
            upper_rad=limits(robot.upper_rad),
            velocity_rad_s=limits(robot.velocity_rad_s),
            acceleration_rad_s2=limits(robot.acceleration_rad_s2),
            link_mass_kg=robot.link_mass_kg.tolist(),
            link_centre_m=robot.p_BoLcm_B.tolist(),
            gravity_m_s2=robot.gravity_B.tolist(),
            world_base=Pose.of(robot.X_WB),
            reflector=None if robot.X_FR is None else Pose.of(robot.X_FR),
        )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        per_joint = ("axes", "lower_rad", "upper_rad", "velocity_rad_s", "acceleration_rad_s2")
        for name in (*per_joint, "link_mass_kg", "link_centre_m"):
            if len(getattr(self, name)) != len(self.joint_names):
                raise ValueError(f"{name} has {len(getattr(self, name))} entries for {len(self.joint_names)} joints")
        if self.robot().model_sha256 != self.model_sha256:
            raise ValueError("model_sha256 does not belong to this nominal model")
        return self

    def robot(self) -> NominalRobot:
        def limits(values: list[float | None], missing: float) -> Array:
            return np.array([missing if v is None else v for v in values])

        return NominalRobot(
            name=self.name,
            joint_names=tuple(self.joint_names),
            X_BA=np.stack([axis.matrix() for axis in self.axes]),
            X_BF=self.zero_pose.matrix(),
            lower_rad=limits(self.lower_rad, -np.inf),
            upper_rad=limits(self.upper_rad, np.inf),
            velocity_rad_s=limits(self.velocity_rad_s, np.inf),
            acceleration_rad_s2=limits(self.acceleration_rad_s2, np.inf),
            link_mass_kg=np.array(self.link_mass_kg),
            p_BoLcm_B=np.array(self.link_centre_m),
            gravity_B=np.array(self.gravity_m_s2),
            X_WB=self.world_base.matrix(),
            X_FR=None if self.reflector is None else self.reflector.matrix(),
        )


class Parameter(_Part):
    """One estimated or held quantity. Frame parameters tell about a small step from the frame's estimate."""

    name: str
    joint: int | None
    value: Finite
    sigma: Annotated[Finite, Field(ge=0)]
    unit: str
    status: Literal["estimated", "held"]
    reason: str | None


class FramePart(_Part):
    """A frame as estimated, and as it is for the nominal robot: stated by the user, or fitted to it."""

    estimated: Pose
    nominal: Pose
    nominal_source: Literal["given", "registered"]


class RegionPart(_Part):
    """The region of joint space that the data covered: see ``region.Region``."""

    lower_rad: list[Finite]
    upper_rad: list[Finite]
    mean_rad: list[Finite]
    whitening: list[list[Finite]]
    radius: Annotated[Finite, Field(gt=0)]

    @classmethod
    def of(cls, region: Region) -> RegionPart:
        arrays = {name: getattr(region, name).tolist() for name in ("lower_rad", "upper_rad", "mean_rad", "whitening")}
        return cls(**arrays, radius=region.radius)

    def region(self) -> Region:
        return Region(
            np.array(self.lower_rad),
            np.array(self.upper_rad),
            np.array(self.mean_rad),
            np.array(self.whitening),
            self.radius,
        )


class StatisticsPart(_Part):
    mean: Finite
    rms: Finite
    p95: Finite
    max: Finite


class AccuracyPart(_Part):
    position_mm: StatisticsPart
    distance_mm: StatisticsPart | None
    orientation_mrad: StatisticsPart | None


class HeldOutPart(_Part):
    """Errors on data that the fit had not seen."""

    method: str
    nominal: AccuracyPart
    calibrated: AccuracyPart


class NoisePart(_Part):
    """Noise per axis that the fit found, including what the model cannot explain."""

    position_mm: Annotated[Finite, Field(ge=0)]
    orientation_mrad: Annotated[Finite, Field(ge=0)] | None


class DataPart(_Part):
    """Where the calibration comes from. Outliers are line numbers of that file."""

    file: str
    sha256: str
    poses: Annotated[int, Field(gt=0)]
    has_orientation: bool
    outlier_lines: list[int]


class Calibration(_Part):
    """The content of ``calibration.json``."""

    schema_: Literal["truepath.calibration/1"] = Field(alias="schema", default=SCHEMA)
    created_utc: str
    software: dict[str, str]
    robot: RobotPart
    base: FramePart
    tool: FramePart
    parameters: list[Parameter]
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
        )

    def to_json(self) -> str:
        """Text of the file: indented JSON that ends with a checksum over all that stands before it."""
        content = self.model_dump(by_alias=True)
        return json.dumps({**content, "checksum": _checksum(content)}, indent=1, allow_nan=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Writes the file as a whole or not at all."""
        write_atomically(path, self.to_json())


def load_calibration(path: str | Path, robot: NominalRobot | None = None) -> Calibration:
    """Reads and checks a calibration file.

    Args:
        path: the file.
        robot: if given, the calibration must be one of this robot.

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
    checksum = content.pop("checksum", None)
    if checksum != _checksum(content):
        raise InputError(
            "the calibration was changed after truepath wrote it",
            file=path,
            expected="the checksum of its content",
            found="no checksum" if checksum is None else "another one",
        )
    try:
        calibration = Calibration.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError(f"the calibration is not valid at {place or 'top level'}: {first['msg']}", file=path) from None
    if robot is not None and robot.model_sha256 != calibration.robot.model_sha256:
        raise InputError(
            "the calibration belongs to another robot",
            file=path,
            expected=f"{robot.name} with nominal model {robot.model_sha256[:12]}",
            found=f"{calibration.robot.name} with nominal model {calibration.robot.model_sha256[:12]}",
        )
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


def _checksum(content: dict) -> str:
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()
