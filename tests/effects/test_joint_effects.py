"""Effects that turn a joint: each against its formula, written here a second time, gravity by Drake."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from truepath.context import Context
from truepath.effects import EFFECTS, joint_errors
from truepath.effects.base import FittedTerm, basis
from truepath.plants import load_plant

POSES = 200


@pytest.fixture(scope="module")
def joints():
    return np.random.default_rng(0).uniform(-3, 3, (POSES, 6))


def term_of(name, joint, robot, context):
    """The term of an effect on one joint."""
    (term,) = (term for term in EFFECTS[name].terms(robot, context) if term.joint == joint)
    return term


def turned(name, joint, value, robot, context):
    """``(N,)`` rad by which the joint stands off, for an effect with a single parameter."""
    fitted = FittedTerm(term_of(name, joint, robot, context), np.array([value]))
    return joint_errors(robot, context, [fitted])[:, joint - 1]


def column(name, term, parameter, robot, context):
    """``(N,)`` motion per unit of a parameter."""
    names = [each.name for each in term.parameters]
    return basis(EFFECTS[name], term, robot, context)[:, 0, names.index(parameter)]


@pytest.fixture(scope="module")
def gravity_by_drake():
    """Function: joints ``(N, 6)`` to torques of gravity ``(N, 6)``, with so many kg on the flange."""
    plant = load_plant("ur5")
    context, flange = plant.CreateDefaultContext(), plant.GetFrameByName("flange")
    from pydrake.multibody.tree import JacobianWrtVariable

    def torques(q, payload_kg=0.0):
        rows = []
        for angles, kg in zip(q, np.broadcast_to(payload_kg, len(q)), strict=True):
            plant.SetPositions(context, angles)
            world = plant.world_frame()
            J = plant.CalcJacobianTranslationalVelocity(
                context, JacobianWrtVariable.kV, flange, np.zeros(3), world, world
            )
            weight = kg * plant.gravity_field().gravity_vector()
            rows.append(plant.CalcGravityGeneralizedForces(context) + J.T @ weight)
        return np.array(rows)

    return torques


# transmission_error


def test_waves_over_a_full_turn_are_sines_and_cosines(ur5, joints):
    context = Context(joints)
    term = term_of("transmission_error", 3, ur5, context)
    assert np.allclose(column("transmission_error", term, "cos 7", ur5, context), np.cos(7 * joints[:, 2]))
    assert np.allclose(column("transmission_error", term, "sin 2", ur5, context), np.sin(2 * joints[:, 2]))


def test_waves_over_part_of_a_turn_are_half_waves_that_fit_it(ur5):
    q = np.tile(np.linspace(0.2, 1.4, 100)[:, None], (1, 6))
    term = term_of("transmission_error", 1, ur5, Context(q))
    columns = basis(EFFECTS["transmission_error"], term, ur5, Context(q))[:, 0]
    for m in (1, 2, 5):
        assert np.allclose(columns[:, m - 1], np.cos(np.pi * m * (q[:, 0] - 0.2) / 1.2))


@pytest.mark.parametrize("poses", [60, 200, 1000])
def test_there_are_more_readings_than_waves_that_are_offered_whatever_the_form(ur5, poses):
    q = np.random.default_rng(1).uniform(-3, 3, (poses, 6))
    for form in EFFECTS["transmission_error"].alternatives(ur5, Context(q)):
        assert form
        for term in form:
            assert 0 < len(term.parameters) < 3 * poses


def test_every_wave_of_every_form_is_the_one_that_its_name_says(ur5):
    """Joint 1 over a full turn, joint 2 over part of one."""
    q = np.random.default_rng(1).uniform([-3.1, 0.2, 0, 0, 0, 0], [3.1, 1.4, 1, 1, 1, 1], (100, 6))
    for form in EFFECTS["transmission_error"].alternatives(ur5, Context(q)):
        for term in form[:2]:
            theta = q[:, term.joint - 1]
            share = (theta - theta.min()) / np.ptp(theta)
            x = (2 * theta - term.constant("lower_rad") - term.constant("upper_rad")) / (
                term.constant("upper_rad") - term.constant("lower_rad")
            )
            found = basis(EFFECTS["transmission_error"], term, ur5, Context(q))[:, 0]
            for j, parameter in enumerate(term.parameters):
                kind, order = parameter.name.split(" ")
                expected = {
                    "cos": np.cos(int(order) * theta),
                    "sin": np.sin(int(order) * theta),
                    "half-wave": np.cos(np.pi * int(order) * share),
                    "chebyshev": chebyshev.chebval(x, np.eye(int(order) + 1)[int(order)]),
                }[kind]
                np.testing.assert_allclose(found[:, j], expected, atol=1e-11)


def test_with_many_poses_tens_of_cycles_a_turn_are_offered(ur5):
    q = np.random.default_rng(1).uniform(-3.1, 3.1, (1000, 6))
    term = term_of("transmission_error", 4, ur5, Context(q))
    assert {"cos 60", "sin 100"} <= {parameter.name for parameter in term.parameters}


def test_angles_that_were_visited_again_and_again_resolve_no_more_waves(ur5):
    q = np.random.default_rng(1).uniform(-3, 3, (60, 6))
    once, often = Context(q), Context(np.tile(q, (10, 1)))
    for joint in (1, 6):
        one, other = (term_of("transmission_error", joint, ur5, each) for each in (once, often))
        assert one.parameters == other.parameters


def test_a_joint_that_hardly_moved_tells_nothing_of_its_transmission(ur5, joints):
    still = joints.copy()
    still[:, 4] = 0.3
    assert {t.joint for t in EFFECTS["transmission_error"].terms(ur5, Context(still))} == {1, 2, 3, 4, 6}


# joint_compliance


@pytest.mark.parametrize("payload", [None, 0.0, 3.0])
def test_a_soft_joint_gives_way_as_drake_weighs_the_arm(ur5, joints, gravity_by_drake, payload):
    torque = gravity_by_drake(joints, payload or 0.0)
    for joint in (2, 3, 4):
        found = turned("joint_compliance", joint, 2e-5, ur5, Context(joints, payload))
        np.testing.assert_allclose(found, 2e-5 * torque[:, joint - 1], atol=1e-12)


def test_compliance_follows_a_payload_that_changes_from_pose_to_pose(ur5, joints, gravity_by_drake):
    payload = np.random.default_rng(2).uniform(0, 5, POSES)
    found = turned("joint_compliance", 2, 1e-5, ur5, Context(joints, payload))
    np.testing.assert_allclose(found, 1e-5 * gravity_by_drake(joints, payload)[:, 1], atol=1e-12)


def test_a_vertical_joint_axis_tells_nothing_of_its_compliance(ur5, joints):
    assert 1 not in {term.joint for term in EFFECTS["joint_compliance"].terms(ur5, Context(joints))}


# backlash


def test_with_recorded_directions_play_puts_a_joint_half_its_width_to_either_side(ur5, joints):
    approach = np.random.default_rng(3).choice([-1.0, 0.0, 1.0], (POSES, 6))
    for joint in range(1, 7):
        found = turned("backlash", joint, 3e-4, ur5, Context(joints, approach=approach))
        np.testing.assert_allclose(found, 1.5e-4 * approach[:, joint - 1], atol=1e-15)


def test_without_directions_the_joint_rests_on_the_side_to_which_gravity_pulls(ur5, joints, gravity_by_drake):
    torque = gravity_by_drake(joints)[:, 1]
    found = turned("backlash", 2, 3e-4, ur5, Context(joints))
    clear = np.abs(torque) > 0.1 * np.abs(torque).max()
    np.testing.assert_allclose(found[clear], 1.5e-4 * np.sign(torque[clear]), rtol=0.01)
    assert np.abs(found).max() <= 1.5e-4


def test_where_gravity_changes_sides_play_goes_from_one_side_to_the_other_without_a_jump(ur5, joints):
    term = term_of("backlash", 2, ur5, Context(joints))
    path = np.tile(joints[0], (20001, 1))
    path[:, 1] = np.linspace(joints[:, 1].min(), joints[:, 1].max(), 20001)
    found = joint_errors(ur5, Context(path), [FittedTerm(term, np.array([3e-4]))])[:, 1]
    assert found.min() < -1.4e-4
    assert found.max() > 1.4e-4
    assert np.abs(np.diff(found)).max() < 1e-5


def test_where_the_directions_of_a_joint_never_changed_gravity_is_asked_instead(ur5, joints):
    approach = np.random.default_rng(3).choice([-1.0, 1.0], (POSES, 6))
    approach[:, [0, 1]] = 1.0
    inputs = {t.joint: t.inputs for t in EFFECTS["backlash"].terms(ur5, Context(joints, approach=approach))}
    assert 1 not in inputs  # gravity never turns it
    assert inputs[2] == ("gravity_torque",)
    assert all(inputs[joint] == ("approach",) for joint in (3, 4, 5, 6))


def test_a_program_that_does_not_say_from_where_its_joints_come_is_corrected_for_no_side(ur5, joints):
    approach = np.random.default_rng(3).choice([-1.0, 1.0], (POSES, 6))
    term = term_of("backlash", 3, ur5, Context(joints, approach=approach))
    assert not joint_errors(ur5, Context(joints), [FittedTerm(term, np.array([3e-4]))]).any()


# encoder_scale


def test_a_wrong_gear_ratio_turns_a_joint_in_proportion_to_its_angle(ur5, joints):
    for joint in range(1, 7):
        found = turned("encoder_scale", joint, 2e-4, ur5, Context(joints))
        np.testing.assert_allclose(found, 2e-4 * joints[:, joint - 1], atol=1e-15)


def test_errors_of_several_effects_add_up_joint_by_joint(ur5, joints, gravity_by_drake):
    context = Context(joints)
    both = [
        FittedTerm(term_of("encoder_scale", 2, ur5, context), np.array([1e-4])),
        FittedTerm(term_of("joint_compliance", 2, ur5, context), np.array([1e-5])),
        FittedTerm(term_of("encoder_scale", 5, ur5, context), np.array([-3e-4])),
    ]
    found, torque = joint_errors(ur5, context, both), gravity_by_drake(joints)
    np.testing.assert_allclose(found[:, 1], 1e-4 * joints[:, 1] + 1e-5 * torque[:, 1], atol=1e-12)
    np.testing.assert_allclose(found[:, 4], -3e-4 * joints[:, 4], atol=1e-15)
    assert not found[:, [0, 2, 3, 5]].any()


@pytest.mark.parametrize(
    ("name", "inputs"), [("joint_compliance", ("gravity_torque",)), ("backlash", ("gravity_torque",))]
)
def test_nothing_gives_way_or_rests_against_gravity(name, inputs, ur5):
    context = Context(np.random.default_rng(0).uniform(-3, 3, (200, 6)))
    term = next(term for term in EFFECTS[name].terms(ur5, context) if term.joint == 2)
    assert term.inputs == inputs
    assert EFFECTS[name].makes_sense(term, np.array([1e-5]))
    assert not EFFECTS[name].makes_sense(term, np.array([-1e-5]))
