"""What became of the effects that somebody asked for by name is said for each of them."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from truepath.asked_effects import became_of
from truepath.errors import InputError
from truepath.virtual.simulate import to_csv


@pytest.fixture(scope="module")
def bare(clean):
    """Sixty poses with joints and positions alone."""
    few = clean.subset(range(60))
    return replace(few, time_s=None, temperature_c=None, approach=None, payload_kg=None)


def test_what_needs_a_column_that_nobody_recorded_is_said_not_to_be_tried(ur5, bare):
    told = became_of(["warmup_drift", "thermal_expansion"], ur5, bare, [])
    assert told == {
        "warmup_drift": "not tried: nobody recorded t_s",
        "thermal_expansion": "not tried: nobody recorded temperature_c",
    }


def test_what_was_tried_in_vain_is_told_from_what_is_in_the_model(ur5, clean):
    told = became_of(["encoder_scale", "warmup_drift"], ur5, clean, [SimpleNamespace(name="warmup_drift")])
    assert told == {"encoder_scale": "tried: the data do not speak for it", "warmup_drift": "in the model"}


def test_what_poses_show_in_part_only_says_what_they_cannot_show(ur5, bare):
    told = became_of(["backlash"], ur5, bare, [])["backlash"]
    assert told.startswith("tried: the data do not speak for it (the direction of arrival was not recorded")


def test_an_unknown_effect_is_refused(ur5, bare):
    with pytest.raises(InputError, match="unknown effect 'rust'"):
        became_of(["rust"], ur5, bare, [])


# The command


@pytest.fixture(scope="module")
def asked(real_ur5, bare, tmp_path_factory):
    folder = tmp_path_factory.mktemp("asked")
    (folder / "data.csv").write_text(to_csv(bare))
    return folder


def test_calibrate_says_what_became_of_each_and_that_no_other_was_tried(truepath, asked):
    arguments = ("calibrate", asked / "data.csv", "--robot", "ur5", "-o", asked / "c.json")
    outcome = truepath(*arguments, "--effects", "warmup_drift,encoder_scale")
    assert outcome.code == 0, outcome.err
    assert "  warmup_drift: not tried: nobody recorded t_s\n" in outcome.out
    assert "  encoder_scale: tried: the data do not speak for it\n" in outcome.out
    assert "no other cause was tried" in outcome.out
    assert truepath(*arguments, "--effects", "warmup_drift", "--json").json()["asked"] == {
        "warmup_drift": "not tried: nobody recorded t_s"
    }


def test_where_nothing_was_asked_for_nothing_is_said_of_it(truepath, asked):
    outcome = truepath("calibrate", asked / "data.csv", "--robot", "ur5", "-o", asked / "c.json", "--effects", "none")
    assert "effects asked for" not in outcome.out
    assert "no other cause" not in outcome.out
