"""Single readings that have nothing to do with the robot. ``robust_fit.inliers`` finds them."""

from __future__ import annotations

from truepath.effects.base import Cause


class Outlier(Cause):
    """A reading further from the model than noise ever brings one: it takes no part in any fit."""

    name = "outlier"
    cause = "the beam was broken, the wrong pose was taken, or the robot had not settled"
    remedy = "look at the rows named, and measure them again"


EFFECT = Outlier()
