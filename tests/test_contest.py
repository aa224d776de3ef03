"""How terms come together in one model."""

from dataclasses import replace

from truepath.contest import merged
from truepath.effects.base import EffectParameter, Term
from truepath.motions import Moves


def parameter(name):
    return EffectParameter(name, "rad", 1e-5, "any")


def test_parameters_of_one_effect_at_one_place_come_together():
    place = Term("transmission_error", Moves.JOINT, 3, ("theta",), (), ())
    old, new = place.with_parameters((parameter("cos 1"),)), place.with_parameters((parameter("cos 9"),))
    elsewhere = replace(new, joint=4)
    assert merged([old], [new, elsewhere]) == (
        place.with_parameters((parameter("cos 1"), parameter("cos 9"))),
        elsewhere,
    )


def test_the_same_effect_at_two_moments_is_two_things():
    early = Term("tool_shift", Moves.PROBE, None, ("row",), (("moment", 3.5),), (parameter("x"),))
    late = replace(early, constants=(("moment", 9.5),))
    assert merged([early], [late]) == (early, late)
