"""What of an effect free kinematics can imitate: nothing is left of it then, and nobody can name it."""

import numpy as np
import pytest
from truepath.context import Context
from truepath.effect_fit import kinematic_prior, linearise
from truepath.effects import EFFECTS
from truepath.effects.base import EffectParameter, Term, basis
from truepath.marginal import Marginal
from truepath.motions import Moves
from truepath.term_set import TermSet

NOTHING = 1e-6  # of a column's square, where the kinematics takes the rest
FIVE = ("x", "y", "z", "rx", "ry")


class Geometry:
    """A calibrated robot, all of whose geometry is free."""

    def __init__(self, robot, kinematic):
        self.robot, self.context, self.fit = robot, kinematic.context, kinematic.fit
        nothing = TermSet.of(robot, self.context, ())
        near = linearise(self.fit.problem, self.fit.free, self.context, nothing, self.fit.p, np.zeros(0))
        self.chain = near.chain
        self.marginal = Marginal.of(near.y, near.kinematics, kinematic_prior(self.fit), self.fit.sigma)

    def columns(self, *terms):
        """Names ``(joint, parameter)`` and raw columns ``(N, 3, K)``."""
        names = [(term.joint, parameter.name) for term in terms for parameter in term.parameters]
        return names, TermSet.of(self.robot, self.context, terms).columns(self.chain, 3)

    def share_left(self, columns):
        """``(K,)`` of the square of columns ``(N, 3, K)`` that no geometry imitates."""
        left, whole = self.marginal.project(columns), columns / self.fit.sigma[:, None]
        return np.sum(left**2, axis=(0, 1)) / np.sum(whole**2, axis=(0, 1))


@pytest.fixture(scope="module")
def geometry(real_ur5, clean_kinematic):
    return Geometry(real_ur5.robot, clean_kinematic)


# Lengths


def test_a_tracker_with_a_wrong_metre_is_imitated_by_other_link_lengths(geometry):
    _, columns = geometry.columns(*EFFECTS["measurement_scale"].terms(geometry.robot, geometry.context))
    assert geometry.share_left(columns) < NOTHING


def test_a_robot_that_is_warmer_all_the_time_is_imitated_by_other_link_lengths(geometry):
    parameter = (EffectParameter("expansion", "1/K", 1e-5, "expansion"),)
    constants = (("reference_c", -1e6),)  # so far away that the temperature of the campaign is as good as constant
    always = Term("thermal_expansion", Moves.ROBOT_LENGTHS, None, ("temperature_c",), constants, parameter)
    assert geometry.share_left(geometry.columns(always)[1]) < NOTHING


def test_growth_with_a_temperature_that_varies_is_imitated_by_nothing(geometry):
    _, columns = geometry.columns(*EFFECTS["thermal_expansion"].terms(geometry.robot, geometry.context))
    assert geometry.share_left(columns) > 0.9


# axis_wobble


@pytest.fixture(scope="module")
def wobble(ur5):
    q = np.random.default_rng(4).uniform(-3, 3, (100, 6))
    return Context(q), EFFECTS["axis_wobble"].terms(ur5, Context(q))


def test_an_axis_tilts_and_shifts_by_waves_of_its_own_angle(ur5, wobble):
    context, terms = wobble
    assert [term.joint for term in terms] == [1, 2, 3, 4, 5, 6]
    for term in terms:
        theta = context.q_rad[:, term.joint - 1]
        found = basis(EFFECTS["axis_wobble"], term, ur5, context)
        for j, parameter in enumerate(term.parameters):
            component, wave, cycles = parameter.name.split(" ")
            expected = np.zeros((100, 5))
            expected[:, FIVE.index(component)] = {"cos": np.cos, "sin": np.sin}[wave](int(cycles) * theta)
            np.testing.assert_allclose(found[:, :, j], expected, atol=1e-12)
            assert parameter.unit == ("rad" if component in ("rx", "ry") else "m")


def test_every_component_of_a_wobble_comes_with_one_two_and_three_cycles_a_turn(wobble):
    for term in wobble[1]:
        names = {parameter.name for parameter in term.parameters}
        assert names == {f"{name} {wave} {k}" for name in FIVE for wave in ("cos", "sin") for k in (1, 2, 3)}


@pytest.mark.parametrize(("first", "second"), [("x", "y"), ("rx", "ry")])
@pytest.mark.parametrize("joint", [1, 2, 3, 4, 5, 6])
def test_a_run_out_that_turns_with_the_body_is_a_body_mounted_off_centre(geometry, joint, first, second):
    """A step a that is constant in the turned body is (a_x cos - a_y sin, a_x sin + a_y cos) before the turn."""
    terms = EFFECTS["axis_wobble"].terms(geometry.robot, geometry.context)
    names, columns = geometry.columns(*terms)

    def column(name):
        return columns[:, :, names.index((joint, name))]

    along_x = column(f"{first} cos 1") + column(f"{second} sin 1")
    along_y = column(f"{second} cos 1") - column(f"{first} sin 1")
    assert (geometry.share_left(np.stack([along_x, along_y], axis=2)) < 1e-4).all()
    # The same run-out turning against the body is a wobble indeed.
    against = column(f"{first} cos 1") - column(f"{second} sin 1")
    assert geometry.share_left(against[:, :, None]) > 0.01


def test_the_last_axis_that_slides_once_a_turn_is_a_probe_mounted_off_its_axis(geometry):
    names, columns = geometry.columns(*EFFECTS["axis_wobble"].terms(geometry.robot, geometry.context))
    last = [names.index((6, f"z {wave} 1")) for wave in ("cos", "sin")]
    assert (geometry.share_left(columns[:, :, last]) < NOTHING).all()


def test_what_wobbles_two_or_three_times_a_turn_no_geometry_does(geometry):
    names, columns = geometry.columns(*EFFECTS["axis_wobble"].terms(geometry.robot, geometry.context))
    often = [k for k, (_, name) in enumerate(names) if name[-1] in "23"]
    assert (geometry.share_left(columns[:, :, often]) > 0.3).all()


# Joints


def test_a_joint_that_is_always_off_by_the_same_angle_is_a_matter_of_geometry(geometry):
    """It takes no parameter of its own: deviations of the next axes, or the frames, are the same."""
    for joint in range(1, 7):
        constant = geometry.chain.displacement(Moves.JOINT, joint)[:, :3]
        assert geometry.share_left(constant) < 1e-4


@pytest.mark.parametrize("name", ["encoder_scale", "joint_compliance", "backlash", "warmup_drift"])
def test_errors_of_joints_that_change_are_seen_beside_the_geometry(geometry, name):
    _, columns = geometry.columns(*EFFECTS[name].terms(geometry.robot, geometry.context))
    assert (geometry.share_left(columns) > 0.01).all()


def test_waves_of_tens_of_cycles_are_hardly_touched_by_geometry(geometry):
    names, columns = geometry.columns(*EFFECTS["transmission_error"].terms(geometry.robot, geometry.context))
    fast = [k for k, (_, name) in enumerate(names) if int(name.split(" ")[1]) > 40]
    assert fast
    assert (geometry.share_left(columns[:, :, fast]) > 0.6).all()


# Time


def test_a_tool_that_slips_and_a_frame_that_drifts_are_seen_beside_the_geometry(geometry):
    effects, context = EFFECTS, geometry.context
    middle = effects["tool_shift"].alternatives(geometry.robot, context)[24]
    names, columns = geometry.columns(*middle)
    shifts = [k for k, (_, name) in enumerate(names) if name in ("x", "y", "z")]
    assert (geometry.share_left(columns[:, :, shifts]) > 0.3).all()
    _, columns = geometry.columns(*effects["frame_drift"].terms(geometry.robot, context))
    assert (geometry.share_left(columns) > 0.8).all()


def test_a_reflector_that_is_turned_about_itself_shows_nothing(geometry):
    names, columns = geometry.columns(*EFFECTS["tool_shift"].terms(geometry.robot, geometry.context))
    turns = [k for k, (_, name) in enumerate(names) if name in ("rx", "ry", "rz")]
    assert not columns[:, :, turns].any()
