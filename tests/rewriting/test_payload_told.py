"""A program that carries something else than its correction was made for."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from truepath import plants
from truepath.calibration import Calibration
from truepath.calibration_parts import EffectPart
from truepath.effects import EFFECTS
from truepath.effects.base import FittedTerm
from truepath.learn import learn
from truepath.rewriting.options import RewriteOptions
from truepath.rewriting.rewrite import rewrite_program

NOWHERE = RewriteOptions(cell="none")


@pytest.fixture(scope="module")
def rigid(real_ur5, clean):
    return learn(real_ur5.robot, clean, source="ur5_cell", effects=()).calibration


@pytest.fixture(scope="module")
def soft(rigid, real_ur5, clean_kinematic):
    """The same with a soft joint 2, whose sag depends on the load."""
    terms = EFFECTS["joint_compliance"].terms(real_ur5.robot, clean_kinematic.context)
    (term,) = (term for term in terms if term.joint == 2)
    part = EffectPart.of(FittedTerm(term, np.array([3e-5]), np.array([1e-7])))
    return Calibration.model_validate(rigid.model_dump(by_alias=True) | {"effects": [part.model_dump()]})


@pytest.fixture(scope="module")
def tool_kg():
    """Mass of the tool of the cell with its reflector, by Drake."""
    plant: MultibodyPlant = plants.load_plant("ur5_cell")
    return sum(plant.GetBodyByName(name).default_mass() for name in ("tool", "reflector"))


@pytest.fixture
def warned(tmp_path):
    """Function: what is said of the payload of a program, by line."""

    def warned(calibration, *statements):
        file = tmp_path / "p.script"
        lines = ["def p():", *statements, "movej([0, -1.6, 1.7, -1.6, -1.5, 0])", "end", ""]
        file.write_text("\n".join(lines))
        findings = rewrite_program(file, calibration, NOWHERE).findings
        assert all(each.level == "warning" for each in findings)
        return {each.line: each.message for each in findings if each.guard.startswith("payload")}

    return warned


def test_another_payload_is_told_with_what_would_fit(warned, soft, tool_kg):
    said = warned(soft, "set_payload(4.5)")
    assert list(said) == [2]
    assert "sets a payload of 4.50 kg, the correction is for 1.03 kg at (30, 0, 36) mm" in said[2]
    assert f"--payload-kg {4.5 - tool_kg:.2f} fits" in said[2]


def test_what_is_said_to_fit_does(warned, soft, tool_kg):
    fitting = soft.carrying(round(4.5 - tool_kg, 2))
    assert warned(fitting, "set_payload(4.5)") == {}
    assert "--payload-kg 0.00 fits" in warned(fitting, f"set_payload({tool_kg})")[2]


@pytest.mark.parametrize(
    "statement",
    [
        "set_payload(1.03, [0.030, 0.0, 0.036])",
        "set_payload(0.86, [0.05, 0, 0.037])  # the reflector taken off",
        "set_tcp(get_target_tcp_pose())",
        "# set_payload(4.5)",
    ],
)
def test_the_payload_of_the_calibration_is_no_matter(warned, soft, statement):
    assert warned(soft, statement) == {}


def test_where_nothing_depends_on_the_load_every_payload_is_right(warned, rigid):
    assert warned(rigid, "set_payload(4.5)", "set_payload(m)") == {}


def test_no_option_makes_the_tool_of_the_model_lighter_or_moves_a_centre(warned, soft):
    assert "the tool of the model alone is 1.03 kg, so no --payload-kg fits" in warned(soft, "set_payload(0.1)")[2]
    said = warned(soft.carrying(2.0), "set_payload(3.03, [0, 0, 0.2])")[2]
    assert "the weights are the same, but not their centres, which --payload-kg cannot state" in said


def test_every_payload_that_is_set_counts(warned, soft):
    assert list(warned(soft, "set_payload(1.03)", "set_payload(2)", "set_target_payload(3, [0, 0, 0])")) == [3, 4]


def test_a_payload_that_is_computed_cannot_be_compared(warned, soft):
    said = warned(soft, "m = 4", "set_payload(m)", "set_tcp(tool)")
    assert list(said) == [3]
    assert "computes the payload that it sets" in said[3]


@pytest.mark.parametrize(("beyond_kg", "is_told"), [(3.9, False), (4.0, True), (40.0, True)])
def test_more_than_the_arm_is_built_for_is_told(warned, rigid, beyond_kg, is_told):
    """5 kg, by the data sheet of the UR5; the tool of the cell is 1.03 kg of them."""
    said = warned(rigid.carrying(beyond_kg))
    assert bool(said) is is_told
    if is_told:
        assert f"{beyond_kg:.2f} kg beyond it: --payload-kg), and a UR5 is built for 5 kg" in said[None]
