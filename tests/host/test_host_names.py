"""One arm under other names: a calibration fits the geometry, and files say where the arm's model is."""

import re

import numpy as np
import pytest
from command import is_refused, run
from foreign_host import path, some_joints
from pydrake.multibody.plant import MultibodyPlant
from truepath import plants
from truepath.calibration import load_calibration
from truepath.errors import InputError
from truepath.host import CalibrationPlugin
from truepath.robot import read_robot

JOINT = re.compile(r'(<joint name=")(?!left_)')


def prefixed_text():
    return JOINT.sub(r"\1left_", plants.resolve("ur5").read_text())


def plant_of(text):
    plant = MultibodyPlant(0.0)
    (arm,) = plants.make_parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", arm))
    plant.Finalize()
    return plant


@pytest.fixture
def prefixed():
    """A UR5 whose joints are called left_elbow_joint and so on."""
    return CalibrationPlugin(plant_of(prefixed_text()))


@pytest.fixture
def saved(rigid, tmp_path):
    rigid.save(tmp_path / "calibration.json")
    return tmp_path / "calibration.json"


@pytest.fixture
def program(tmp_path):
    rows = [",".join(f"{value:.9f}" for value in row) for row in path(3)]
    (tmp_path / "path.csv").write_text("\n".join([",".join(f"q{i}_rad" for i in range(1, 7)), *rows]) + "\n")
    return tmp_path / "path.csv"


@pytest.fixture
def truepath(monkeypatch, capsys):
    return lambda *arguments: run(monkeypatch, capsys, *arguments)


def test_a_calibration_fits_the_same_arm_with_prefixed_joints(prefixed, saved, rigid, tmp_path):
    calibration = prefixed.load(saved)
    assert calibration.robot.joint_names[2] == "left_elbow_joint"
    assert np.array_equal(prefixed.correct(path(4)).q_rad, rigid.correct(path(4)).q_rad)
    prefixed.save(tmp_path / "left.json")
    again = load_calibration(tmp_path / "left.json", prefixed.robot)
    assert again.robot.joint_names == calibration.robot.joint_names
    assert load_calibration(tmp_path / "left.json", rigid.robot) == again  # and back
    assert rigid.calibration.robot.joint_names[2] == "elbow_joint"


def test_it_is_applied_to_its_context_and_carried_by_its_systems(prefixed, saved, rigid):
    from truepath.host import JointCorrection

    prefixed.load(saved)
    context = prefixed.plant.CreateDefaultContext()
    assert any("left_elbow_joint" in name for name in prefixed.apply(context).frames)
    system = JointCorrection(prefixed)
    own = system.CreateDefaultContext()
    system.get_input_port(0).FixValue(own, path(1)[0])
    sent = system.GetOutputPort("corrected").Eval(own)
    assert np.abs(sent - rigid.correct(path(1)).q_rad[0]).max() < 1e-7


def test_a_file_that_was_learnt_from_a_urdf_fits_a_urdf_with_other_names(rigid, saved, tmp_path):
    (tmp_path / "left.urdf").write_text(prefixed_text())
    robot = plants.load_robot(tmp_path / "left.urdf")
    assert robot.joint_names[0] == "left_shoulder_pan_joint"
    assert load_calibration(saved, robot) == load_calibration(saved)


def test_what_is_another_robot_is_told_by_its_numbers(saved):
    longer = plants.resolve("ur5").read_text().replace('xyz="-0.425 0 0"', 'xyz="-0.4255 0 0"')
    plugin = CalibrationPlugin(plant_of(longer))
    with pytest.raises(InputError, match="another robot") as caught:
        plugin.load(saved)
    assert "425 mm instead of 425.5 mm" in caught.value.found


# Where the arm's model is


def test_without_a_source_the_commands_say_what_to_do_and_robot_does_it(truepath, rigid, saved, program, tmp_path):
    for command in (("export",), ("preview", program)):
        output = tmp_path / ("out.urdf" if command[0] == "export" else "out.html")
        refused = truepath(*command, "-c", saved, "-o", output)
        assert is_refused(refused, "host's own plant in memory", "--robot with the URDF", "robot_source=")
        assert not output.exists()
        done = truepath(*command, "-c", saved, "-o", output, "--robot", "ur5")
        assert done.code == 0, done.err
        assert output.stat().st_size > 1e4
    model = rigid.calibration.model
    written = read_robot(plants.load_plant(tmp_path / "out.urdf"))
    assert np.abs(written.X_BA[3, :3, 2] - model.robot.X_BA[3, :3, 2]).max() > 1e-5


def test_a_host_that_names_the_source_has_it_in_the_file(truepath, rigid, saved, prefixed, program, tmp_path):
    urdf = tmp_path / "left.urdf"
    urdf.write_text(prefixed_text())
    plugin = CalibrationPlugin(prefixed.plant, robot_source=urdf)
    plugin.load(saved)
    plugin.save(tmp_path / "named.json")
    assert load_calibration(tmp_path / "named.json").robot.source == str(urdf.resolve())
    done = truepath("export", "-c", tmp_path / "named.json", "-o", tmp_path / "out.urdf")
    assert done.code == 0, done.err
    assert 'name="left_elbow_joint"' in (tmp_path / "out.urdf").read_text()
    learnt = CalibrationPlugin(rigid.plant, model_instance="left::ur5", robot_source="ur5")
    q = some_joints(60, 7)
    learnt.calibrate(learnt.measurements(q, positions_of(rigid, q), measured_in="tracker"), effects="none")
    assert learnt.calibration.robot.source == "ur5"


def positions_of(plugin, q):
    return plugin.calibration.model.flange_poses(q)[:, :3, 3]


def test_a_source_without_this_arm_is_refused(prefixed):
    with pytest.raises(InputError, match="no such arm") as caught:
        CalibrationPlugin(prefixed.plant, robot_source="ur5")
    assert "left_elbow_joint" in caught.value.expected
    with pytest.raises(InputError, match="no robot"):
        CalibrationPlugin(prefixed.plant, robot_source="elsewhere.urdf")


def test_a_source_of_another_geometry_is_refused_with_its_numbers(rigid):
    with pytest.raises(InputError, match="another robot") as caught:
        CalibrationPlugin(rigid.plant, model_instance="left::ur5", robot_source="ur10")
    assert "612.7 mm instead of 425 mm" in caught.value.found or "612 mm instead of 425 mm" in caught.value.found
    at_the_link = CalibrationPlugin(
        rigid.plant, model_instance="left::ur5", flange_frame="wrist_3_link", robot_source="ur5"
    )
    assert at_the_link.source == "ur5"


def test_the_source_can_be_named_later(prefixed, saved, tmp_path):
    (tmp_path / "left.urdf").write_text(prefixed_text())
    prefixed.load(saved)
    prefixed.name_source(tmp_path / "left.urdf")
    assert prefixed.calibration.robot.source.endswith("left.urdf")


# Effects in words


@pytest.mark.parametrize("stated", ["none", (), []])
def test_no_effects_in_words_are_none(fresh, soft_cell, stated):
    assert fitted(fresh, soft_cell, stated) == set()


@pytest.mark.parametrize("stated", ["joint_compliance", ("joint_compliance",), "encoder_scale, joint_compliance"])
def test_effects_are_stated_as_on_the_command_line_or_as_a_list(fresh, soft_cell, stated):
    assert fitted(fresh, soft_cell, stated) - {"encoder_scale"} == {"joint_compliance"}


@pytest.mark.parametrize("stated", ["compliance", ("joint_compliance", "slop"), 3, None, ""])
def test_what_is_no_effect_is_refused_and_the_known_ones_are_told(fresh, soft_cell, stated):
    with pytest.raises(InputError, match=r"unknown effect|no effects") as caught:
        fitted(fresh, soft_cell, stated)
    assert any(word in caught.value.expected for word in ("joint_compliance", "auto, none"))


def fitted(plugin, cell, stated):
    q = some_joints(70, 7)
    calibration = plugin.calibrate(plugin.measurements(q, cell.measure(q, 8)), effects=stated)
    return {effect.name for effect in calibration.effects}
