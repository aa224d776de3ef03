"""What the command line prints about a neural residual. The rest of it is seen in the tests of the commands."""

from types import SimpleNamespace

import numpy as np
import pytest
from hand_made_networks import residual_about
from truepath import console
from truepath.calibration_residual import ResidualPart
from truepath.iso9283 import Accuracy, ErrorStatistics
from truepath.learn import learn
from truepath.residual.proof import Proof


def accuracy(mm):
    return Accuracy(ErrorStatistics.of(np.array([mm])), None, None)


@pytest.fixture(scope="module")
def plain(real_ur5, clean):
    return learn(real_ur5.robot, clean.subset(np.arange(60)), source="ur5").calibration


@pytest.fixture(scope="module")
def networked(plain):
    """The same with three networks of eight neurons."""
    part = ResidualPart.of(residual_about(np.zeros(6)), Proof(1.3e-9, 0.08, 0.04))
    return plain.model_copy(update={"residual": part})


def printed(calibration, capsys):
    console.print_calibration(calibration)
    return capsys.readouterr().out


def test_a_calibration_with_networks_says_how_many_and_how_large_they_are(networked, capsys):
    assert "networks: 3 of 8 hidden neurons\n" in printed(networked, capsys)


def test_networks_of_different_size_are_said_to_be_from_the_smallest_to_the_largest(networked, capsys):
    small = networked.residual.networks[0].model_copy(update={"hidden": networked.residual.networks[0].hidden[:5]})
    part = networked.residual.model_copy(update={"networks": [*networked.residual.networks[1:], small]})
    assert "networks: 3 of 5 to 8 hidden neurons" in printed(networked.model_copy(update={"residual": part}), capsys)


def test_a_calibration_without_networks_says_nothing_of_them(plain, capsys):
    assert "network" not in printed(plain, capsys)


def test_accuracy_on_poses_not_seen_says_how_they_came_to_be_unseen(plain, capsys):
    assert "on 60 poses that the fit had not seen (cross-validated)" in printed(plain, capsys)
    kept = plain.heldout.model_copy(update={"method": "a fifth of the poses, drawn at random, kept away", "poses": 12})
    assert "on 12 poses that the fit had not seen (kept away)" in printed(
        plain.model_copy(update={"heldout": kept}), capsys
    )


def test_what_proved_networks_is_told_from_what_the_table_shows(plain, networked, capsys):
    told = []
    for calibration in (plain, networked):
        console.print_network(calibration, "the mean error falls from 0.1 to 0.09 mm")
        told.append(capsys.readouterr().out)
    assert all("neural residual: the mean error falls from 0.1 to 0.09 mm\n" in text for text in told)
    assert ["cross-validated" in text for text in told] == [False, True]


@pytest.mark.parametrize("asked", [{}, {"backlash": "in the model"}])
def test_causes_that_were_asked_for_by_name_are_not_printed_as_proved_against_others(plain, asked, capsys):
    effects = [SimpleNamespace(name="backlash", joint=j, cause="play", remedy="adjust it") for j in (2, 3)]
    console.print_calibration(plain.model_copy(update={"effects": effects}), asked)
    text = capsys.readouterr().out
    assert f"backlash on joints 2 and 3{' (as asked)' if asked else ''}: play; adjust it\n" in text
    assert ("no other cause was tried" in text) == ("repair nothing on this alone" in text) == bool(asked)


def test_a_probe_far_from_its_stated_place_is_warned_of(plain, capsys):
    assert "warning" not in printed(plain, capsys)
    stated = plain.tool.nominal.model_copy(update={"translation_m": [0.5, 0.0, 0.0]})
    tool = plain.tool.model_copy(update={"nominal": stated, "nominal_source": "given"})
    text = printed(plain.model_copy(update={"tool": tool}), capsys)
    assert "from where it was stated\nwarning: the probe is" in text


def test_the_table_has_a_row_for_each_model_that_there_is(capsys):
    models = [accuracy(mm) for mm in (2.5, 0.05, 0.11, 0.06)]
    rows = {}
    for count in (2, 3, 4):
        console.print_accuracy("title", *models[:count])
        rows[count] = capsys.readouterr().out
    assert "kinematics" not in rows[2]
    assert "kinematics" in rows[3]
    assert "named causes" not in rows[3]
    order = [rows[4].index(text) for text in ("nominal", "2.500", "kinematics", "0.110", "named causes", "0.060")]
    assert order == sorted(order)
    assert order[-1] < rows[4].index("calibrated") < rows[4].index("0.050")


@pytest.mark.parametrize("asked", [True, False])
def test_a_diagnosis_says_what_became_of_networks_that_were_asked_for(plain, asked, capsys):
    diagnosis = SimpleNamespace(
        calibration=plain,
        verdict="All is well.",
        stages=(),
        findings=(),
        ambiguous=(),
        unexplained=SimpleNamespace(hints=()),
        not_testable=(),
        network=SimpleNamespace(why="left out: it gains nothing", model=None) if asked else None,
        to_dict=lambda: {"data": {"outliers": [], "unseen_poses": 0}},
    )
    console.print_diagnosis(diagnosis)
    text = capsys.readouterr().out
    assert ("left out: it gains nothing" in text) == asked
    assert ("neural residual" in text) == asked
    assert "base found at" in text
    assert "mm on the flange" in text
