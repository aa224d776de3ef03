"""Correction with a neural residual: the networks count where the data reached, fade beyond, and the user is told."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hand_made_networks import residual_about
from truepath import console_programs
from truepath.correct import correct
from truepath.model import nominal_model
from truepath.networks_along import NetworksAlong
from truepath.region import cover

HOME = np.array([0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
OUTWARDS = np.array([1.0, 0.4, -0.5, 0.3, 0.4, 0.6])
FIRST_LINE = 2


@pytest.fixture(scope="module")
def model(ur5):
    """A robot that is perfect but for what the networks say."""
    return replace(nominal_model(ur5), residual=residual_about(HOME))


@pytest.fixture(scope="module")
def leaving():
    """A path of 200 waypoints from the middle of what was measured to far outside."""
    return HOME + np.linspace(0, 1.2, 200)[:, None] * OUTWARDS


@pytest.fixture(scope="module")
def corrected(model, leaving):
    return correct(model, leaving, line=np.arange(len(leaving)) + FIRST_LINE)


@pytest.fixture(scope="module")
def within(model):
    """A path that stays where the data was."""
    return correct(model, HOME + np.linspace(0, 0.1, 50)[:, None] * OUTWARDS)


@pytest.fixture(scope="module")
def beyond(model):
    """A path on which no network says anything."""
    return correct(model, HOME + np.linspace(1.0, 1.2, 50)[:, None] * OUTWARDS)


def about_networks(corrected):
    return [warning for warning in corrected.warnings if "networks" in warning]


def printed(corrected, capsys):
    console_programs.print_networks(corrected)
    return capsys.readouterr().out


# Where the networks count


def test_the_weight_is_full_where_the_data_was_and_falls_to_nothing_outside(corrected):
    weight = corrected.networks.weight
    assert (weight[:20] == 1.0).all()
    assert (weight[-20:] == 0.0).all()
    assert np.diff(weight).max() <= 1e-12


def test_weight_and_spread_are_those_of_the_joints_that_the_robot_is_sent_to(corrected, model):
    np.testing.assert_array_equal(corrected.networks.weight, model.residual.weight(corrected.q_rad))
    np.testing.assert_array_equal(corrected.networks.spread_mm, 1e3 * model.residual.spread(corrected.q_rad))


def test_the_correction_stays_continuous_while_the_networks_fade(corrected, leaving):
    """No step between neighbours changes the correction by more than a seventh of the largest correction."""
    change = corrected.q_rad - leaving
    assert np.abs(np.diff(change, axis=0)).max() < np.abs(change).max() / 7


def test_half_the_step_changes_the_correction_by_half_as_much(model, corrected, leaving):
    """So there is no jump anywhere: one would stay as large, however close the waypoints are."""
    closer = HOME + np.linspace(0, 1.2, 399)[:, None] * OUTWARDS
    fine, coarse = (
        np.abs(np.diff(q - programmed, axis=0)).max()
        for q, programmed in ((correct(model, closer).q_rad, closer), (corrected.q_rad, leaving))
    )
    assert fine < 0.55 * coarse


def test_where_the_networks_are_silent_the_correction_is_the_one_without_them(corrected, model, leaving):
    without = correct(replace(model, residual=None), leaving)
    silent = corrected.networks.silent
    assert silent.any()
    np.testing.assert_allclose(corrected.q_rad[silent], without.q_rad[silent], atol=1e-9)
    assert np.abs(corrected.q_rad - without.q_rad)[corrected.networks.weight == 1.0].max() > 1e-5


def test_many_waypoints_say_the_same_as_few(model):
    swing = np.sin(np.linspace(0, 40, 20_001))[:, None]
    q = HOME + 0.8 * swing * OUTWARDS
    residual = model.residual
    whole, part = NetworksAlong.of(residual, q), NetworksAlong.of(residual, q[19_990:])
    assert len(whole.weight) == len(whole.spread_mm) == len(q)
    np.testing.assert_allclose(whole.weight[19_990:], part.weight, atol=1e-12)
    np.testing.assert_allclose(whole.spread_mm[19_990:], part.spread_mm, atol=1e-12)


# What a machine reads


def test_the_summary_tells_spread_and_weight_as_plain_json(corrected):
    networks = corrected.networks
    summary = json.loads(json.dumps(corrected.summary(), allow_nan=False))["network"]
    assert summary["spread_mm"]["max"] == pytest.approx(networks.spread_mm.max())
    assert summary["spread_mm"]["mean"] == pytest.approx(networks.spread_mm[networks.weight > 1e-6].mean())
    assert summary["faded_out"] == (networks.weight < 1e-6).sum()
    assert summary["faded_partly"] + summary["faded_out"] == (networks.weight < 1.0 - 1e-6).sum()
    assert summary["weight"] == pytest.approx(networks.weight, abs=1e-6)


def test_where_nothing_is_said_there_is_no_spread_in_the_summary(beyond):
    assert beyond.summary()["network"]["spread_mm"] is None


def test_without_networks_there_is_nothing_about_them(model, leaving, capsys):
    plain = correct(replace(model, residual=None), leaving)
    assert plain.networks is None
    assert plain.summary()["network"] is None
    assert about_networks(plain) == []
    assert "network" not in printed(plain, capsys)


# What a person reads


def test_faded_waypoints_are_counted_and_the_first_is_named(corrected):
    (warning,) = about_networks(corrected)
    networks = corrected.networks
    first = FIRST_LINE + int(np.argmax(networks.faded))
    assert f"faded at {networks.faded.sum()} of 200 waypoints (first in line {first})" in warning
    assert f"at {networks.silent.sum()} of them to nothing" in warning
    assert "in part or not at all" in warning


def test_a_path_that_only_comes_near_the_edge_is_said_to_be_corrected_in_part(model, leaving, corrected):
    edge = corrected.networks.faded & ~corrected.networks.silent
    (warning,) = about_networks(correct(model, leaving[edge]))
    assert f"faded at {edge.sum()} of {edge.sum()} waypoints" in warning
    assert "in part only" in warning
    assert "nothing" not in warning


def test_a_path_beyond_all_data_is_said_not_to_be_corrected_by_the_networks(beyond):
    (warning,) = about_networks(beyond)
    assert "faded out at 50 of 50 waypoints (first in line 1)" in warning
    assert "not corrected there" in warning


def test_where_the_networks_speak_in_full_nobody_is_warned(within):
    assert within.networks.weight.min() == 1.0
    assert within.warnings == []


def test_the_region_and_the_networks_are_spoken_of_once_each(model, leaving):
    region = cover(HOME + np.random.default_rng(0).uniform(-0.35, 0.35, (400, 6)))
    outside, faded = correct(model, leaving, region=region).warnings[:2]
    assert "outside the joints that were measured" in outside
    assert "network" not in outside
    assert "outside" not in faded


def test_the_spread_is_printed_where_there_is_one(corrected, beyond, capsys):
    spread = corrected.networks.spoken_mm
    line = f"networks: spread {spread.mean():.3f} mm on average, {spread.max():.3f} mm at most"
    assert line in printed(corrected, capsys)
    assert "spread" not in printed(beyond, capsys)


def test_a_correction_without_networks_needs_no_torch():
    program = (
        "import sys, truepath.correct, truepath.console, truepath.verdict, truepath.cli_programs, truepath.preview, "
        "truepath.report; print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
