"""The spectrum of a joint against scipy's, against waves that were put in, and against chance; and the trend lines."""

import numpy as np
import pytest
from scipy.signal import lombscargle
from truepath.report.canvas import moving_median
from truepath.report.spectrum import CLIP_SIGMAS, spectrum


@pytest.fixture(scope="module")
def angle():
    return np.random.default_rng(4).uniform(-2.5, 2.8, 500)


def test_it_is_the_spectrum_of_lomb_and_scargle(angle):
    values = np.random.default_rng(5).uniform(-1, 1, len(angle))  # nothing far off, so nothing is clipped
    found = spectrum(angle, values)
    y = values - values.mean()
    assert np.abs(y - np.median(y)).max() < CLIP_SIGMAS * np.median(np.abs(y - np.median(y))) / 0.6745
    expected = np.sqrt(4 * lombscargle(angle, y, found.cycles) / len(y))
    assert np.allclose(found.amplitude, expected, atol=1e-9)


@pytest.mark.parametrize("cycles", [2.0, 23.0, 61.0])
def test_it_finds_a_wave_and_its_size(angle, cycles):
    noise = np.random.default_rng(6).normal(scale=20.0, size=len(angle))
    found = spectrum(angle, 40.0 * np.sin(cycles * angle + 0.3) + noise)
    at, amplitude = found.strongest()
    assert at == pytest.approx(cycles, abs=0.3)
    assert amplitude == pytest.approx(40.0, rel=0.1)
    assert amplitude > found.chance


def test_chance_passes_its_line_about_once_in_a_hundred(angle):
    rng = np.random.default_rng(7)
    spectra = [spectrum(angle, rng.normal(size=len(angle))) for _ in range(200)]
    passed = sum(each.amplitude.max() > each.chance for each in spectra)
    assert passed <= 8


def test_a_few_wild_readings_do_not_hide_a_wave(angle):
    values = 40.0 * np.sin(7 * angle) + np.random.default_rng(8).normal(scale=10.0, size=len(angle))
    values[::50] += 5000.0
    values[1::50] = np.nan
    assert spectrum(angle, values).strongest()[0] == pytest.approx(7.0, abs=0.3)


def test_too_little_to_say_anything():
    assert spectrum(np.linspace(0, 1, 20), np.zeros(20)) is None
    assert spectrum(np.full(100, 0.4), np.zeros(100)) is None
    assert spectrum(np.linspace(0, 1, 100), np.full(100, np.nan)) is None


def test_a_joint_without_any_error_has_a_flat_spectrum(angle):
    found = spectrum(angle, np.zeros(len(angle)))
    assert found.amplitude.max() == found.chance == 0.0


def test_a_trend_does_not_bridge_a_gap():
    x = np.concatenate([np.linspace(0, 1, 100), np.linspace(5, 6, 100)])
    at, trend = moving_median(x, np.where(x < 3, 1.0, -1.0), 60)
    assert np.isnan(trend).sum() == 1
    assert set(trend[~np.isnan(trend)]) == {1.0, -1.0}
    assert not ((at > 1) & (at < 5)).any()


def test_a_coarse_thermometer_gets_a_median_for_each_reading():
    x = np.repeat([20.0, 20.5, 21.0, 21.5], 50)
    at, trend = moving_median(x, 2 * x, 60)
    assert at.tolist() == [20.0, 20.5, 21.0, 21.5]
    assert trend.tolist() == [40.0, 41.0, 42.0, 43.0]


def test_few_points_have_no_trend():
    assert len(moving_median(np.arange(20.0), np.arange(20.0), 60)[0]) == 0
