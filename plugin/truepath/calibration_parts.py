"""The parts of a calibration file, each checked when it is read: types, finite numbers, shapes, rotations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from typing_extensions import Self

from truepath import lie
from truepath.lie import Array
from truepath.region import Region
from truepath.robot import NominalRobot

if TYPE_CHECKING:
    from truepath.effects.base import FittedTerm

Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Pose(Part):
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


class RobotPart(Part):
    """The nominal robot, as it was read from its Drake plant. Limits are null where the model has none.

    ``source`` is the built-in name or file that it was read from; ``plants.HOSTS_PLANT`` where there was no file.
    """

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


class Parameter(Part):
    """One estimated or held quantity. Frame parameters tell about a small step from the frame's estimate."""

    name: str
    joint: int | None
    value: Finite
    sigma: Annotated[Finite, Field(ge=0)]
    unit: str
    status: Literal["estimated", "held"]
    reason: str | None


class EffectParameterPart(Part):
    """One number of a named effect."""

    name: str
    value: Finite
    sigma: Annotated[Finite, Field(ge=0)]
    unit: str


class EffectPart(Part):
    """A named effect at one place: what it moves, on which joint (from 1) if on one, and what it depends on.

    ``constants`` are no parameters but belong to the formula: ``lower_rad`` and ``upper_rad``, the angles that the
    data covered and beyond which it fades; a moment, a time constant, a reference temperature; ``default ...``, what
    is assumed where nobody knows better.
    """

    name: str
    moves: str
    joint: Annotated[int, Field(ge=1)] | None
    inputs: list[str]
    constants: dict[str, Finite]
    cause: str
    remedy: str
    parameters: Annotated[list[EffectParameterPart], Field(min_length=1)]

    @classmethod
    def of(cls, fitted: FittedTerm) -> EffectPart:
        from truepath.effects import effect_named

        term, effect = fitted.term, effect_named(fitted.term.effect)
        return cls(
            name=term.effect,
            moves=term.moves.value,
            joint=term.joint,
            inputs=list(term.inputs),
            constants=dict(term.constants),
            cause=effect.cause,
            remedy=effect.remedy,
            parameters=[
                EffectParameterPart(name=parameter.name, value=float(value), sigma=float(sigma), unit=parameter.unit)
                for parameter, value, sigma in zip(term.parameters, fitted.values, fitted.sigma, strict=True)
            ],
        )

    @model_validator(mode="after")
    def _is_known(self) -> Self:
        from truepath.effects import EFFECTS, is_understood
        from truepath.motions import Moves

        if self.name not in EFFECTS:
            raise ValueError(f"this truepath knows no effect {self.name!r}")
        if self.moves not in {kind.value for kind in Moves}:
            raise ValueError(f"nothing called {self.moves!r} can be moved by an effect")
        if not is_understood(self.fitted().term):
            raise ValueError(f"effect {self.name!r} is not built in a way that this truepath knows")
        return self

    def fitted(self) -> FittedTerm:
        from truepath.effects.base import EffectParameter, FittedTerm, Term
        from truepath.motions import Moves

        parameters = tuple(EffectParameter(p.name, p.unit, 0.0, "") for p in self.parameters)
        constants = tuple(self.constants.items())
        term = Term(self.name, Moves(self.moves), self.joint, tuple(self.inputs), constants, parameters)
        values, sigma = ([getattr(p, which) for p in self.parameters] for which in ("value", "sigma"))
        return FittedTerm(term, np.array(values), np.array(sigma))


class FramePart(Part):
    """A frame as estimated, and as it is for the nominal robot: stated by the user, or fitted to it."""

    estimated: Pose
    nominal: Pose
    nominal_source: Literal["given", "registered"]


class RegionPart(Part):
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


class StatisticsPart(Part):
    mean: Finite
    rms: Finite
    p95: Finite
    max: Finite


class AccuracyPart(Part):
    position_mm: StatisticsPart
    distance_mm: StatisticsPart | None
    orientation_mrad: StatisticsPart | None


class HeldOutPart(Part):
    """Errors on data that neither the fit nor the choice of the model had seen.

    ``kinematic`` is the calibration without named effects and networks, where there are any; ``named`` the one without
    networks, where there are both.
    """

    method: str
    poses: Annotated[int, Field(gt=0)]
    nominal: AccuracyPart
    kinematic: AccuracyPart | None
    named: AccuracyPart | None = None
    calibrated: AccuracyPart


class NoisePart(Part):
    """Noise per axis that the fit found, including what the model cannot explain."""

    position_mm: Annotated[Finite, Field(ge=0)]
    orientation_mrad: Annotated[Finite, Field(ge=0)] | None


class DataPart(Part):
    """Where the calibration comes from. Outliers are line numbers of that file; the payload is the usual one there."""

    file: str
    sha256: str
    poses: Annotated[int, Field(gt=0)]
    has_orientation: bool
    payload_kg: Annotated[Finite, Field(ge=0)] = 0.0
    outlier_lines: list[int]
