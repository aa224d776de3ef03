"""Numbers as a person reads them."""

import math

import pytest
from truepath.report import words
from truepath.report.stage_strip import stage_names


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (143.23, "143"),
        (1.984, "1.98"),
        (0.0523, "0.0523"),
        (-0.5, "\N{MINUS SIGN}0.500"),
        (0.0, "0"),
        (float("nan"), "unknown"),
    ],
)
def test_three_significant_digits(value, text):
    assert words.significant(value) == text


@pytest.mark.parametrize(
    ("p", "text"),
    [
        (0.43, "p = 0.43"),
        (3.2e-9, "p = 3 \N{MULTIPLICATION SIGN} 10⁻⁹"),
        (9.7e-6, "p = 1 \N{MULTIPLICATION SIGN} 10⁻⁵"),
        (1.2e-12, "p = 1 \N{MULTIPLICATION SIGN} 10⁻¹²"),
        (0.9e-12, "p < 10⁻¹²"),
        (1e-300, "p < 10⁻¹²"),
        (0.0, "p < 10⁻¹²"),
    ],
)
def test_probabilities(p, text):
    assert words.probability(p) == text


@pytest.mark.parametrize(
    ("odds", "text"),
    [
        (math.log(150), "150 to 1"),
        (9.5 * math.log(10), "10⁹ to 1"),
        (-math.log(20), "1 to 20"),
        (11.9 * math.log(10), "10¹¹ to 1"),
        (12.1 * math.log(10), "more than 10¹² to 1"),
        (4e3, "more than 10¹² to 1"),
        (-4e3, "less than 1 to 10¹²"),
    ],
)
def test_odds(odds, text):
    assert words.odds(odds) == text


@pytest.mark.parametrize(
    ("value", "sigma", "unit", "text"),
    [
        (1.432e-4, 2.1e-6, "rad", ("143.2", "2.1", "µrad")),
        (-5.0e-4, 1.3e-5, "m", ("\N{MINUS SIGN}500", "13", "µm")),
        (3.04e-6, 1.1e-7, "rad/(N m)", ("3.04", "0.11", "µrad/(N m)")),
        (2.31e-5, 0.0, "1/K", ("23.1", "", "ppm/K")),
        (1.0, None, "furlong", ("1.00", "", "furlong")),
        (0.0, 3.3e-6, "rad", ("0.0", "3.3", "µrad")),
    ],
)
def test_values_have_the_digits_that_their_sigma_leaves_them(value, sigma, unit, text):
    assert words.in_readable_unit(value, sigma, unit) == text


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("in the model (p = 3e-40)", "in the model (p < 10⁻¹²)"),
        ("in the model (p = 2.6e-05)", "in the model (p = 2.6 \N{MULTIPLICATION SIGN} 10⁻⁵)"),
        ("left out; p = 0.25 proves no gain", "left out; p = 0.25 proves no gain"),
        ("a gain of 3e-5 mm", "a gain of 3 \N{MULTIPLICATION SIGN} 10⁻⁵ mm"),
    ],
)
def test_powers_within_a_sentence(text, read):
    assert words.with_powers(text) == read


def test_lists_and_joints():
    assert words.joints_phrase([]) == ""
    assert words.joints_phrase([3]) == "joint 3"
    assert words.joints_phrase([1, 2, 5]) == "joints 1, 2 and 5"


def test_stages_are_named_by_what_they_add():
    models = ["nominal", "kinematic", "kinematic+backlash", "kinematic+backlash+a_new_cause", "kinematic+tool_shift"]
    assert stage_names(models) == [
        "Nominal",
        "Kinematic",
        "+ backlash",
        "+ a new cause",
        "Geometry of the robot + slipped tool or reflector",
    ]
