"""The neural residual in a calibration file: networks, scaling, where they may speak, what they proved."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import Self

from truepath.calibration_parts import Finite, Part
from truepath.residual.limits import SIGNIFICANT

if TYPE_CHECKING:
    from truepath.residual.ensemble import NetworkResidual
    from truepath.residual.network import Network
    from truepath.residual.proof import Proof

LARGEST = 1e12  # no error is beyond it; sums and products of larger numbers may be no numbers
Weight = Annotated[float, Field(ge=-1e6, le=1e6)]  # of scaled inputs and outputs
Rows = list[list[Weight]]
MOST_NEURONS, MOST_NETWORKS, MOST_POSES = 1000, 100, 500  # the last as ``Reach.of`` has it
Angle = Annotated[float, Field(ge=-100.0, le=100.0)]  # rad: no arm turns so often
Distance = Annotated[float, Field(ge=1e-6, le=10.0)]  # half ranges of joints: poses of one arm are not further apart
Scale = Annotated[float, Field(gt=0, le=0.1)]  # m or rad: more is no residual
Place = Annotated[float, Field(ge=-10.0, le=10.0)]  # m from the flange
KINDS = (3, 6)  # outputs: a position, or a position and a turn


class NetworkPart(Part):
    """A network: ``hidden`` neuron by neuron with the threshold last, ``output`` output by output, ``bias``."""

    hidden: Annotated[Rows, Field(min_length=1, max_length=MOST_NEURONS)]
    output: Annotated[Rows, Field(min_length=1, max_length=max(KINDS))]
    bias: list[Weight]

    @classmethod
    def of(cls, network: Network) -> NetworkPart:
        return cls(hidden=network.hidden.tolist(), output=network.output.tolist(), bias=network.bias.tolist())

    @model_validator(mode="after")
    def _is_rectangular(self) -> Self:
        if len({len(row) for row in self.hidden}) != 1 or len(self.hidden[0]) < 2:
            raise ValueError("the hidden neurons do not have the same number of inputs")
        if any(len(row) != len(self.hidden) for row in self.output) or len(self.bias) != len(self.output):
            raise ValueError("the outputs do not fit the hidden neurons")
        return self

    @property
    def inputs(self) -> int:
        return len(self.hidden[0]) - 1

    @property
    def outputs(self) -> int:
        return len(self.bias)

    def network(self) -> Network:
        from truepath.residual.network import Network

        return Network(np.array(self.hidden), np.array(self.output), np.array(self.bias))


class ReachPart(Part):
    """Where the data was: see ``residual.reach.Reach``."""

    lower_rad: list[Angle]
    upper_rad: list[Angle]
    poses_rad: Annotated[list[list[Angle]], Field(min_length=1, max_length=MOST_POSES)]
    median: Distance
    spacing: Distance


class ProofPart(Part):
    """Mean error on held-out poses without and with the networks, and the p value of there being no gain."""

    p_value: Annotated[Finite, Field(ge=0, le=1)]
    before_mm: Annotated[Finite, Field(ge=0)]
    after_mm: Annotated[Finite, Field(ge=0)]

    @model_validator(mode="after")
    def _is_one(self) -> Self:
        if self.p_value >= SIGNIFICANT or self.after_mm >= self.before_mm:
            raise ValueError("it proves nothing")
        return self

    @classmethod
    def of(cls, proof: Proof) -> ProofPart:
        return cls(p_value=proof.p_value, before_mm=proof.before_mm, after_mm=proof.after_mm)


class ResidualPart(Part):
    """Networks from joints, scaled to the reach of the data, to misses in units of ``scale`` (m; rad).

    ``probe_m`` is where the probe sat on the flange when they learnt.
    """

    networks: Annotated[list[NetworkPart], Field(min_length=2, max_length=MOST_NETWORKS)]
    scale: Annotated[list[Scale], Field(min_length=3, max_length=6)]
    reach: ReachPart
    probe_m: Annotated[list[Place], Field(min_length=3, max_length=3)] | None
    proof: ProofPart

    @classmethod
    def of(cls, residual: NetworkResidual, proof: Proof) -> ResidualPart:
        reach = residual.reach
        return cls(
            networks=[NetworkPart.of(network) for network in residual.networks],
            scale=residual.scale.tolist(),
            reach=ReachPart(
                lower_rad=reach.lower_rad.tolist(),
                upper_rad=reach.upper_rad.tolist(),
                poses_rad=reach.poses_rad.tolist(),
                median=reach.median,
                spacing=reach.spacing,
            ),
            probe_m=None if residual.p_FE is None else residual.p_FE.tolist(),
            proof=ProofPart.of(proof),
        )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        n = len(self.reach.lower_rad)
        if len(self.reach.upper_rad) != n or any(len(pose) != n for pose in self.reach.poses_rad):
            raise ValueError("the reach is not that of one robot")
        if any(low > high for low, high in zip(self.reach.lower_rad, self.reach.upper_rad, strict=True)):
            raise ValueError("the reach ends before it begins")
        if len(self.scale) not in KINDS or any((p.inputs, p.outputs) != (n, len(self.scale)) for p in self.networks):
            raise ValueError("a network that does not fit its scaling")
        return self

    def fits(self, num_joints: int) -> bool:
        """Whether it is for a robot of so many joints."""
        return len(self.reach.lower_rad) == num_joints

    def residual(self) -> NetworkResidual:
        from truepath.residual.ensemble import NetworkResidual
        from truepath.residual.reach import Reach

        reach = self.reach
        lower, upper, poses = np.array(reach.lower_rad), np.array(reach.upper_rad), np.array(reach.poses_rad)
        networks = tuple(part.network() for part in self.networks)
        return NetworkResidual(
            networks,
            np.array(self.scale),
            Reach(lower, upper, poses, reach.median, reach.spacing),
            None if self.probe_m is None else np.array(self.probe_m),
        )
