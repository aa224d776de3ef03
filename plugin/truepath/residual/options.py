"""How a network is learnt: size and length of the evolution, of the training after it, and how many there are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from truepath.errors import InputError
from truepath.residual.limits import Limits, Settings

if TYPE_CHECKING:
    from truepath.residual.checkpoint import Checkpoint

DEVICES = ("cpu", "cuda")


@dataclass(frozen=True)
class Options:
    """What a user may choose about networks; the defaults suit a residual.

    Attributes:
        evolution: of the start.
        limits: of the gradient training.
        members: networks in the ensemble.
        seed: of all chance.
        device: ``cpu`` or ``cuda``.
        checkpoint: where to keep what has been learnt so far, to go on after an interruption; None keeps nothing.
    """

    evolution: Settings = field(default_factory=Settings)
    limits: Limits = field(default_factory=Limits)
    members: int = 5
    seed: int = 0
    device: str = "cpu"
    checkpoint: Checkpoint | None = None

    def __post_init__(self) -> None:
        if self.device not in DEVICES:
            raise InputError(f"unknown device {self.device!r}", expected="cpu or cuda")
        if self.seed < 0:
            raise InputError("a seed cannot be negative", found=str(self.seed))
        if self.members < 2:
            raise InputError("an ensemble of one has no spread", expected="2 members or more", found=str(self.members))


def require_device(device: str) -> None:
    """Raises InputError where a device is not there."""
    if device == "cuda":
        import torch

        if not torch.cuda.is_available():
            raise InputError("there is no CUDA device here", expected="--device cpu, or a GPU and torch built for it")
