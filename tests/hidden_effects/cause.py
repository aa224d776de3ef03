"""A cause: parts with sizes. Every motion is proportional to its sizes, so that a cause can be made larger."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hidden_effects.scene import Motion, Scene, field


@dataclass(frozen=True)
class Part:
    """One joint's share of a cause, or the whole of a cause that belongs to no joint.

    Attributes:
        motion: of the robot in a scene, for the sizes as drawn.
        sizes: ``(value, least, most)`` that are plausible, all of which scale with the part.
        stated: parameters by name that scale likewise; what a diagnosis should find.
        joint: from 1, or None.
        rivals: motions that an honest model could mistake for this one.
    """

    motion: Callable[[Scene], Motion]
    sizes: tuple[tuple[float, float, float], ...]
    stated: dict[str, float]
    joint: int | None = None
    rivals: Callable[[Scene], list[Motion]] = lambda _: []

    def scaled(self, factor):
        return replace(
            self,
            motion=lambda scene: self.motion(scene) * factor,
            sizes=tuple((value * factor, least, most) for value, least, most in self.sizes),
            stated={name: value * factor for name, value in self.stated.items()},
        )

    @property
    def is_plausible(self):
        return all(0.999 * least <= abs(value) <= 1.001 * most for value, least, most in self.sizes)


@dataclass(frozen=True)
class Cause:
    """What was hidden.

    Attributes:
        effect: name in the vocabulary of the design document, or of an outside cause.
        parts: one for each joint.
        needs: columns without which nobody could find it.
        columns_left_out: that must not be recorded in this case.
    """

    effect: str
    parts: tuple[Part, ...]
    needs: tuple[str, ...] = ()
    columns_left_out: tuple[str, ...] = ()
    pose_only: bool = False

    @property
    def joints(self):
        return tuple(sorted({part.joint for part in self.parts if part.joint is not None}))

    def motion(self, scene):
        return sum((part.motion(scene) for part in self.parts), scene.still())

    def scaled(self, factor):
        return replace(self, parts=tuple(part.scaled(factor) for part in self.parts))

    @property
    def is_plausible(self):
        return all(part.is_plausible for part in self.parts)


PART_AT_LEAST = 0.7  # sigmas of its own, or nobody can be asked to name that joint
RIVALS_LEAVE_AT_LEAST = 0.5


def visible_rms(cause, scene, visible, beside=()):
    """Of the whole cause and of each of its parts, in sigmas, geometry, frames and causes ``beside`` it put off."""
    rivals = [field(scene, part.motion(scene)) for other in beside for part in other.parts]
    parts = [field(scene, part.motion(scene)) for part in cause.parts]
    alone = [visible.rms(part, rivals + parts[:k] + parts[k + 1 :]) for k, part in enumerate(parts)]
    return visible.rms(sum(parts), rivals), alone


def fit_into(cause, scene, visible, rng, least, most, beside=()):
    """The cause made so large that it is seen with ``least`` to ``most`` sigmas; None if that is not plausible."""
    total, _ = visible_rms(cause, scene, visible, beside)
    if total == 0:
        return None
    if not least <= total <= most:
        cause = cause.scaled(np.exp(rng.uniform(np.log(least), np.log(most))) / total)
    _, alone = visible_rms(cause, scene, visible, beside)
    if not cause.is_plausible or min(alone) < PART_AT_LEAST:
        return None
    for part in cause.parts:
        rivals = [field(scene, motion) for motion in part.rivals(scene)]
        if rivals and visible.rms(field(scene, part.motion(scene)), rivals) < RIVALS_LEAVE_AT_LEAST:
            return None
    return cause
