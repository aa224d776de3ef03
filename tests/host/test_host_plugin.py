"""The plugin on a host that truepath has never seen. The truth is Drake's, on a plant with frames that were moved."""

import subprocess
import sys
from importlib.metadata import entry_points

import numpy as np
import pytest
import truepath.host
from foreign_host import CORNERS, JOINTS, X_GT, X_WM, arm_instance, build_plant, path, some_joints
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, SpatialInertia
from pydrake.trajectories import PiecewisePolynomial
from truepath import plants
from truepath.errors import CorrectionError, InputError
from truepath.host import CalibrationPlugin
from truepath.model import nominal_flange_poses
from truepath.plants import load_robot


def distances_mm(poses, wanted):
    return 1e3 * np.linalg.norm(poses[:, :3, 3] - wanted[:, :3, 3], axis=1)


def numbers_of(context):
    """All numbers of a context, to the bit: state and parameters."""
    parameters = context.get_parameters()
    numeric = [
        parameters.get_numeric_parameter(k).CopyToVector() for k in range(parameters.num_numeric_parameter_groups())
    ]
    return np.concatenate([context.get_continuous_state_vector().CopyToVector(), *numeric]).tobytes()


# Found and set up


def test_drake_is_imported_when_it_is_used_and_not_before():
    code = "import sys, truepath.host; truepath.host.CalibrationPlugin; print('pydrake' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert run.stdout.strip() == "False"
    with pytest.raises(AttributeError, match="no attribute"):
        truepath.host.Nothing  # noqa: B018


def test_a_host_finds_it_by_its_entry_point(plant):
    (entry,) = [each for each in entry_points(group="drake_olp.plugins") if each.name == "truepath"]
    plugin = entry.load()(plant, model_instance=arm_instance(plant, "right"))
    assert plugin.robot.num_joints == 6


def test_joints_are_found_wherever_they_are_in_the_plant(plant, fresh):
    by_name = [plant.GetJointByName(f"{name}_joint", arm_instance(plant, "right")).position_start() for name in JOINTS]
    assert fresh.arm.tolist() == by_name
    assert np.diff(by_name).max() > 1  # the camera is between them
    assert by_name[0] > 0
    other = CalibrationPlugin(plant, model_instance="left::ur5")
    assert not set(other.arm) & set(fresh.arm)


def test_the_arm_is_the_same_robot_wherever_its_base_is_welded(fresh, ur5, drawn):
    assert fresh.robot.model_sha256 == ur5.model_sha256
    q = some_joints(3, 0)
    assert np.abs(fresh.robot.X_WB - X_WM.GetAsMatrix4()).max() < 1e-12
    expected = fresh.robot.X_WB @ nominal_flange_poses(fresh.robot, q) @ fresh.place.X_FT
    assert np.abs(drawn.poses(q) - expected).max() < 1e-12


def test_of_several_arms_one_must_be_named(plant):
    with pytest.raises(InputError, match="cannot tell which model"):
        CalibrationPlugin(plant)
    with pytest.raises(InputError, match="right::ur5"):
        CalibrationPlugin(plant, model_instance="middle")


def test_a_tool_must_be_fixed_to_this_flange(plant):
    with pytest.raises(InputError, match="no frame 'camera'"):
        CalibrationPlugin(plant, model_instance="right::ur5", tool_frame="camera")
    others = plant.GetFrameByName("tcp", plant.GetModelInstanceByName("left_tool"))
    with pytest.raises(InputError, match="gripper"):
        CalibrationPlugin(plant, model_instance="right::ur5", tool_frame=others)


def test_a_base_that_moves_is_refused():
    plant = MultibodyPlant(0.0)
    (arm,) = plants.make_parser(plant).AddModels(str(plants.resolve("ur5")))
    slide = plant.AddRigidBody("slide", plant.AddModelInstance("rail"), SpatialInertia.SolidCubeWithDensity(900.0, 0.1))
    plant.AddJoint(PrismaticJoint("rail", plant.world_frame(), slide.body_frame(), [1, 0, 0]))
    plant.WeldFrames(slide.body_frame(), plant.GetFrameByName("base_link", arm))
    plant.Finalize()
    with pytest.raises(InputError, match=r"the base .* moves"):
        CalibrationPlugin(plant, model_instance=arm)


# The whole flow


def test_it_calibrates_and_corrects_the_right_arm(rigid, rigid_cell, drawn):
    q = path(60)
    wanted = drawn.poses(q)
    correction = rigid.correct(q)
    before, after = (distances_mm(rigid_cell.poses(joints), wanted) for joints in (q, correction.q_rad))
    heldout = rigid.calibration.heldout
    assert before.mean() > 0.8
    assert after.mean() < heldout.calibrated.position_mm.mean
    assert after.max() < heldout.calibrated.position_mm.max
    assert heldout.calibrated.position_mm.mean < 0.05 < 0.5 * heldout.nominal.position_mm.mean
    assert not correction.outside.any()


def test_gravity_comes_from_where_the_host_has_it(soft, soft_cell, drawn):
    q = path(60)
    after = distances_mm(soft_cell.poses(soft.correct(q).q_rad), drawn.poses(q))
    assert {effect.name for effect in soft.calibration.effects} == {"joint_compliance"}
    assert after.mean() < soft.calibration.heldout.calibrated.position_mm.mean < 0.05


def test_nothing_of_the_host_changes(rigid_cell):
    plant = build_plant()
    context, fresh_default = plant.CreateDefaultContext(), plant.CreateDefaultContext()
    plant.SetPositions(context, np.random.default_rng(0).normal(size=plant.num_positions()))
    before, default = numbers_of(context), numbers_of(fresh_default)
    plugin, q = CalibrationPlugin(plant, model_instance="right::ur5", tool_frame="tcp"), some_joints(60, 7)
    plugin.calibrate(plugin.measurements(q, rigid_cell.measure(q, 8)), effects=())
    plugin.correct(path(10))
    assert numbers_of(context) == before
    assert numbers_of(plant.CreateDefaultContext()) == default


def test_a_diagnosis_names_the_joints_that_bend_and_is_used_only_when_told(fresh, soft_cell):
    q = some_joints(150, 7)
    diagnosis = fresh.diagnose(fresh.measurements(q, soft_cell.measure(q, 8)), plan=False)
    assert [(finding.effect, finding.joints) for finding in diagnosis.findings] == [("joint_compliance", (2, 3))]
    assert fresh.calibration is None
    fresh.use(diagnosis.calibration)
    assert fresh.calibration.heldout == diagnosis.calibration.heldout


def test_saved_and_loaded_it_corrects_the_same(rigid, fresh, tmp_path):
    rigid.save(tmp_path / "calibration.json")
    fresh.load(tmp_path / "calibration.json")
    assert np.array_equal(fresh.correct(path(5)).q_rad, rigid.correct(path(5)).q_rad)


def test_a_calibration_of_another_robot_is_refused_and_the_one_in_use_stays(rigid, tmp_path):
    plant = MultibodyPlant(0.0)
    plants.add_model(plant, "ur10")
    plant.Finalize()
    other = CalibrationPlugin(plant)
    rigid.save(tmp_path / "ur5.json")
    with pytest.raises(InputError, match="another robot"):
        other.load(tmp_path / "ur5.json")
    with pytest.raises(InputError, match="another robot"):
        other.use(rigid.calibration)
    assert other.calibration is None


def test_a_calibration_from_elsewhere_gets_limits_gravity_and_place_of_the_host(rigid, tmp_path):
    rigid.save(tmp_path / "calibration.json")
    plant = plants.load_plant("ur5")
    plant_limits = plant.GetJointByName("elbow_joint")
    plant_limits.set_position_limits([-2.0], [1.5])
    upright = CalibrationPlugin(plant)
    loaded = upright.load(tmp_path / "calibration.json").model.robot
    assert np.allclose(loaded.gravity_B, [0, 0, -9.81])
    assert loaded.upper_rad[2] == 1.5
    assert np.array_equal(loaded.X_WB, np.eye(4))
    with pytest.raises(CorrectionError, match="limit"):
        upright.correct(path(60))
    assert rigid.calibration.model.robot.upper_rad[2] > 6


def test_the_probe_may_sit_elsewhere_and_the_tracker_stand_anywhere(fresh, rigid_cell, drawn):
    """What the base is off in the world is then unknown, so only distances between points come right."""
    q, X_MW = some_joints(150, 7), RigidTransform(RollPitchYaw(0.3, 0.1, 2.0), [2.0, 1.0, -0.3])
    seen = np.array([X_MW @ p for p in rigid_cell.measure(q, 8)])
    fresh.calibrate(fresh.measurements(q, seen, measured_in="tracker", probe="unknown"), effects=())
    assert not fresh.calibration.model.base_is_given
    assert not fresh.calibration.model.tool_is_given
    joints = path(60)
    wanted = drawn.poses(joints)[:, :3, 3]
    real = rigid_cell.poses(fresh.correct(joints).q_rad)[:, :3, 3]

    def lengths(points):
        return np.linalg.norm(np.diff(points, axis=0), axis=1)

    assert np.abs(lengths(real) - lengths(wanted)).mean() < 5e-5
    assert np.linalg.norm(real - wanted, axis=1).mean() > 0.3e-3


def test_measured_orientations_are_used(fresh, rigid_cell):
    q = some_joints(80, 7)
    poses = rigid_cell.poses(q)
    fresh.calibrate(fresh.measurements(q, poses[:, :3, 3], poses[:, :3, :3]), effects=())
    assert fresh.calibration.heldout.calibrated.orientation_mrad.mean < 1e-3


def test_measurements_come_from_a_file_too(fresh, rigid_cell, tmp_path):
    q, rows = some_joints(60, 7), []
    for joints, position in zip(q, rigid_cell.measure(q, 8), strict=True):
        rows.append(",".join(repr(float(value)) for value in (*joints, *position)))
    header = ",".join([*(f"q{i}_rad" for i in range(1, 7)), "x_m", "y_m", "z_m"])
    (tmp_path / "data.csv").write_text("\n".join([header, *rows]) + "\n")
    from_file = fresh.read_measurements(tmp_path / "data.csv")
    in_memory = fresh.measurements(q, rigid_cell.measure(q, 8))
    assert np.array_equal(from_file.p_ME, in_memory.p_ME)
    assert np.array_equal(from_file.X_MB_nominal, in_memory.X_MB_nominal)
    assert np.array_equal(from_file.X_FE_nominal, in_memory.X_FE_nominal)


def test_a_program_is_corrected_as_the_joints_in_it_are(rigid, tmp_path):
    q = path(4)
    header, rows = ",".join(f"q{i}_rad" for i in range(1, 7)), [",".join(f"{v:.9f}" for v in row) for row in q]
    (tmp_path / "path.csv").write_text("\n".join([header, *rows]) + "\n")
    rewritten = rigid.correct(tmp_path / "path.csv")
    assert np.abs(rewritten.correction.q_rad - rigid.correct(np.round(q, 9)).q_rad).max() < 1e-9
    assert rewritten.changed == 4
    assert list(tmp_path.iterdir()) == [tmp_path / "path.csv"]


def test_a_trajectory_is_corrected_as_the_joints_in_it_are(rigid, rigid_cell, drawn):
    trajectory = PiecewisePolynomial.CubicShapePreserving(np.linspace(0.0, 4.0, len(CORNERS)), CORNERS.T, True)
    corrected = rigid.correct(trajectory).trajectory
    times = np.linspace(0.0, 4.0, 50)
    wanted = drawn.poses(trajectory.vector_values(times).T)
    after = distances_mm(rigid_cell.poses(corrected.vector_values(times).T), wanted)
    assert after.max() < rigid.calibration.heldout.calibrated.position_mm.max
    whole = PiecewisePolynomial.ZeroOrderHold([0.0, 1.0], np.zeros((rigid.plant.num_positions(), 2)))
    with pytest.raises(InputError, match=r"in the order of plugin\.arm"):
        rigid.correct(whole)


# What does not make sense


def test_without_a_calibration_nothing_is_corrected(fresh, tmp_path, plant):
    for attempt in (
        lambda: fresh.correct(path(3)),
        lambda: fresh.save(tmp_path / "none.json"),
        lambda: fresh.preview(path(3)),
        lambda: fresh.apply(plant.CreateDefaultContext()),
    ):
        with pytest.raises(InputError, match="no calibration"):
            attempt()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"q_rad": np.zeros((10, 7))}, "q_rad have the wrong shape"),
        ({"positions_m": np.zeros((9, 3))}, "positions have the wrong shape"),
        ({"positions_m": np.full((10, 3), np.nan)}, "no numbers in row 1"),
        ({"q_rad": np.full((10, 6), 90.0)}, "beyond the joint limits"),
        ({"rotations": np.zeros((10, 3, 3))}, "no rotation"),
        ({"measured_in": "room"}, "world or tracker"),
        ({"probe": "somewhere"}, "unknown probe"),
        ({"probe": np.zeros(2)}, "place of the probe"),
        ({"time_s": np.arange(10.0)[::-1]}, "time runs backwards"),
        ({"approach": np.zeros((10, 5))}, "approach have the wrong shape"),
        ({"positions_m": "here"}, "positions are no numbers"),
    ],
)
def test_measurements_that_make_no_sense_are_refused(fresh, change, says):
    good = {"q_rad": some_joints(10, 0), "positions_m": np.ones((10, 3))}
    with pytest.raises(InputError, match=says):
        fresh.measurements(**(good | change))


def test_the_tool_as_probe_needs_a_tool(plant):
    plain = CalibrationPlugin(plant, model_instance="right::ur5")
    q = some_joints(10, 0)
    with pytest.raises(InputError, match="no tool frame"):
        plain.measurements(q, np.ones((10, 3)), probe="tool")
    assert plain.measurements(q, np.ones((10, 3))).X_FE_nominal is None
    assert np.array_equal(plain.measurements(q, np.ones((10, 3)), probe=[1, 2, 3]).X_FE_nominal[:3, 3], [1, 2, 3])


def test_a_tool_may_be_a_frame_on_the_flange_itself():
    plant = MultibodyPlant(0.0)
    plants.add_model(plant, "ur5")
    plant.AddFrame(FixedOffsetFrame("pen", plant.GetFrameByName("flange"), X_GT))
    plant.Finalize()
    assert np.abs(CalibrationPlugin(plant, tool_frame="pen").place.X_FT - X_GT.GetAsMatrix4()).max() < 1e-12
    assert load_robot("ur5").model_sha256 == CalibrationPlugin(plant).robot.model_sha256
