"""A program that carries another payload than the robot did while it was measured."""

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable
from truepath import plants
from truepath.calibration import Calibration
from truepath.calibration_parts import EffectPart
from truepath.effects import EFFECTS
from truepath.effects.base import FittedTerm
from truepath.learn import learn
from truepath.programs.toolpath_csv import read_toolpath

WELD_PATH = plants.models_dir() / "ur5" / "weld_path.csv"
COMPLIANCE, PAYLOAD_KG = 3e-5, 5.0


@pytest.fixture(scope="module")
def file(real_ur5, clean, clean_kinematic, tmp_path_factory):
    """A calibration of a robot whose joint 2 is soft."""
    plain, *_ = learn(real_ur5.robot, clean, source="ur5_cell")
    terms = EFFECTS["joint_compliance"].terms(real_ur5.robot, clean_kinematic.context)
    (term,) = (term for term in terms if term.joint == 2)
    soft = EffectPart.of(FittedTerm(term, np.array([COMPLIANCE]), np.array([1e-7])))
    content = plain.model_dump(by_alias=True) | {"effects": [soft.model_dump()]}
    content["data"]["payload_kg"] = 0.0
    path = tmp_path_factory.mktemp("soft") / "soft.json"
    Calibration.model_validate(content).save(path)
    return path


@pytest.fixture(scope="module")
def weight_on_joint_2():
    """Function: joints ``(N, 6)`` to the torque ``(N,)`` that the payload puts on joint 2, by Drake."""
    plant = plants.load_plant("ur5")
    context, world = plant.CreateDefaultContext(), plant.world_frame()
    flange = plant.GetFrameByName("flange")

    def torque(q):
        rows = []
        for angles in q:
            plant.SetPositions(context, angles)
            J = plant.CalcJacobianTranslationalVelocity(
                context, JacobianWrtVariable.kV, flange, np.zeros(3), world, world
            )
            rows.append(J[:, 1] @ (PAYLOAD_KG * plant.gravity_field().gravity_vector()))
        return np.array(rows)

    return torque


def corrected(truepath, file, output, *options):
    outcome = truepath("correct", WELD_PATH, "-c", file, "-o", output, *options)
    assert outcome.code == 0, outcome.err
    return read_toolpath(output, 6).q_rad


def test_a_heavier_payload_is_made_up_for_by_what_the_soft_joint_gives_way_more(
    truepath, file, weight_on_joint_2, tmp_path
):
    empty = corrected(truepath, file, tmp_path / "a.csv")
    loaded = corrected(truepath, file, tmp_path / "b.csv", "--payload-kg", PAYLOAD_KG)
    sag = COMPLIANCE * weight_on_joint_2(empty)
    assert np.abs(sag).max() > 5e-4
    np.testing.assert_allclose((loaded - empty)[:, 1], -sag, rtol=0.02, atol=1e-6)
    np.testing.assert_allclose(np.delete(loaded - empty, 1, axis=1), 0.0, atol=2e-6)


def test_without_a_word_the_payload_is_that_of_the_measurements(truepath, file, tmp_path):
    unsaid = corrected(truepath, file, tmp_path / "a.csv")
    said = corrected(truepath, file, tmp_path / "b.csv", "--payload-kg", 0)
    np.testing.assert_array_equal(said, unsaid)


def test_the_preview_is_drawn_with_the_payload_too(truepath, file, tmp_path):
    for name, options in (("a.html", []), ("b.html", ["--payload-kg", PAYLOAD_KG])):
        outcome = truepath("preview", WELD_PATH, "-c", file, "-o", tmp_path / name, *options)
        assert outcome.code == 0, outcome.err
    assert (tmp_path / "a.html").read_bytes() != (tmp_path / "b.html").read_bytes()


@pytest.mark.parametrize("command", ["correct", "preview"])
@pytest.mark.parametrize("payload", ["-1", "nan", "inf", "heavy"])
def test_a_payload_that_nobody_can_carry_is_refused_and_nothing_is_written(truepath, file, tmp_path, command, payload):
    outcome = truepath(command, WELD_PATH, "-c", file, "-o", tmp_path / "out", f"--payload-kg={payload}")
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    assert list(tmp_path.iterdir()) == []
