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
def test_a_diagnosis_says_what_became_of_networks_that_were_asked_for(asked, capsys):
    diagnosis = SimpleNamespace(
        verdict="All is well.",
        stages=(),
        findings=(),
        ambiguous=(),
        unexplained=SimpleNamespace(hints=()),
        not_testable=(),
        network=SimpleNamespace(why="left out: it gains nothing") if asked else None,
        to_dict=lambda: {"data": {"outliers": []}},
    )
    console.print_diagnosis(diagnosis)
    text = capsys.readouterr().out
    assert ("left out: it gains nothing" in text) == asked
    assert ("neural residual" in text) == asked
