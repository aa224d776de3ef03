"""Registration of base and probe frame: exact data, noise, gross errors, given frames, hopeless data."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truepath import frames
from truepath.errors import CalibrationError
from truepath.model import nominal_flange_poses
from truepath.poe import flange_poses

NOISE_M, NOISE_RAD = 5e-5, 1e-4


class Setup:
    """A robot in an arbitrary place, seen by a tracker: a reflector (3D) or a probe (6D)."""

    def __init__(self, robot, seed, has_orientation, poses=40, noise=1.0):
        rng = self.rng = np.random.default_rng(seed)
        self.q = rng.uniform(-2, 2, (poses, robot.num_joints))
        self.X_BF = nominal_flange_poses(robot, self.q)
        self.X_MB, self.X_FE = np.eye(4), np.eye(4)
        self.X_MB[:3, :3] = Rotation.random(rng=rng).as_matrix()
        self.X_MB[:3, 3] = rng.uniform(-10, 10, 3)
        self.X_FE[:3, 3] = rng.uniform(-0.4, 0.4, 3)
        if has_orientation:
            self.X_FE[:3, :3] = Rotation.random(rng=rng).as_matrix()
        self.X_ME = self.X_MB @ self.X_BF @ self.X_FE
        self.p_ME = self.X_ME[:, :3, 3] + noise * NOISE_M * rng.normal(size=(poses, 3))
        turn = Rotation.from_rotvec(noise * NOISE_RAD * rng.normal(size=(poses, 3))).as_matrix()
        self.R_ME = turn @ self.X_ME[:, :3, :3] if has_orientation else None

    def spoil(self, share, kind):
        """Makes gross errors of a share of the rows."""
        rows = self.rng.permutation(len(self.q))[: round(share * len(self.q))]
        if kind == "scattered":
            self.p_ME[rows] += self.rng.uniform(-1, 1, (len(rows), 3))
        elif kind == "near":
            self.p_ME[rows] += self.rng.uniform(-0.01, 0.01, (len(rows), 3))
        elif kind == "conspiring":
            self.p_ME[rows] += [0.2, -0.1, 0.15]
        elif kind == "turned":
            self.R_ME[rows] = Rotation.random(len(rows), rng=self.rng).as_matrix()
        return self

    def register(self, **given):
        return frames.register(self.X_BF, self.p_ME, self.R_ME, **given)

    def worst_mm(self, X_MB, X_FE):
        """Largest distance between where the frames found put the probe and where it truly is."""
        return 1e3 * np.linalg.norm((X_MB @ self.X_BF @ X_FE - self.X_ME)[:, :3, 3], axis=1).max()


def given(setup, which):
    return {} if which == "none" else {which: getattr(setup, which)}


@pytest.fixture(params=[False, True], ids=["3D", "6D"])
def has_orientation(request):
    return request.param


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("poses", [10, 50])
def test_both_frames_are_recovered_from_any_placement(ur5, has_orientation, seed, poses):
    setup = Setup(ur5, seed, has_orientation, poses, noise=0)
    X_MB, X_FE = setup.register()
    np.testing.assert_allclose(X_MB, setup.X_MB, atol=1e-6)
    np.testing.assert_allclose(X_FE, setup.X_FE, atol=1e-6)


@pytest.mark.parametrize("axis", [[0, 0, 0], [1, 0, 0], [0, 0, 1], [0.6, 0, 0.8]], ids=str)
def test_a_base_turned_by_exactly_half_a_turn_or_not_at_all_is_no_trap(seven, has_orientation, axis):
    setup = Setup(seven, 1, has_orientation, noise=0)
    setup.X_MB[:3, :3] = Rotation.from_rotvec(np.pi * np.array(axis)).as_matrix()
    X_ME = setup.X_MB @ setup.X_BF @ setup.X_FE
    setup.p_ME, setup.R_ME = X_ME[:, :3, 3], X_ME[:, :3, :3] if has_orientation else None
    X_MB, X_FE = setup.register()
    np.testing.assert_allclose(X_MB, setup.X_MB, atol=1e-6)
    np.testing.assert_allclose(X_FE, setup.X_FE, atol=1e-6)


@pytest.mark.parametrize("poor", ["all in one plane", "all of one orientation", "all turned about one axis"])
@pytest.mark.parametrize("seed", range(4))
def test_poses_that_do_not_tell_both_frames_apart_are_placed_all_the_same(ur5, has_orientation, poor, seed):
    setup = Setup(ur5, seed, has_orientation, poses=30)
    if poor == "all in one plane":
        setup.q[:, [0, 4, 5]] = 0.3  # only the parallel axes move
        setup.X_BF = nominal_flange_poses(ur5, setup.q)
    else:
        turn = setup.rng.uniform(-1, 1, 30) * (poor == "all turned about one axis")
        about_z = Rotation.from_rotvec(turn[:, None] * [0, 0, 1])
        setup.X_BF[:, :3, :3] = (about_z * Rotation.from_matrix(setup.X_BF[0, :3, :3])).as_matrix()
    setup.X_ME = setup.X_MB @ setup.X_BF @ setup.X_FE
    setup.p_ME, setup.R_ME = setup.X_ME[:, :3, 3], setup.X_ME[:, :3, :3] if has_orientation else None
    X_MB, X_FE = setup.register()
    assert np.linalg.det(X_MB[:3, :3]) == pytest.approx(1)
    assert setup.worst_mm(X_MB, X_FE) < 1e-3


@pytest.mark.parametrize("which", ["X_MB", "X_FE"])
@pytest.mark.parametrize("seed", range(4))
def test_a_given_frame_stays_to_the_last_bit_and_the_other_is_recovered(ur5, has_orientation, which, seed):
    setup = Setup(ur5, seed, has_orientation, noise=0)
    found = dict(zip(("X_MB", "X_FE"), setup.register(**given(setup, which)), strict=True))
    other = {"X_MB": "X_FE", "X_FE": "X_MB"}[which]
    np.testing.assert_array_equal(found[which], getattr(setup, which))
    np.testing.assert_allclose(found[other], getattr(setup, other), atol=1e-6)


def test_two_given_frames_are_returned_as_they_are(ur5, has_orientation):
    setup = Setup(ur5, 0, has_orientation)
    X_MB, X_FE = setup.register(X_MB=setup.X_MB, X_FE=setup.X_FE)
    assert X_MB is setup.X_MB
    assert X_FE is setup.X_FE


GROSS_ERRORS = [(kind, six) for kind in ("scattered", "near", "conspiring") for six in (False, True)] + [
    ("turned", True)
]


@pytest.mark.parametrize("which", ["none", "X_MB", "X_FE"])
@pytest.mark.parametrize(("kind", "has_orientation"), GROSS_ERRORS)
@pytest.mark.parametrize("seed", range(3))
def test_one_row_in_five_that_is_grossly_wrong_costs_little(ur5, has_orientation, which, kind, seed):
    clean = Setup(ur5, seed, has_orientation, poses=60)
    spoilt = Setup(ur5, seed, has_orientation, poses=60).spoil(0.2, kind)
    best = clean.worst_mm(*clean.register(**given(clean, which)))
    worst = spoilt.worst_mm(*spoilt.register(**given(spoilt, which)))
    assert best < 0.15
    assert worst < 2 * best + 0.02


def test_both_kinds_of_gross_error_at_once_cost_little(ur10):
    setup = Setup(ur10, 0, True, poses=100).spoil(0.1, "scattered").spoil(0.1, "turned")
    assert setup.worst_mm(*setup.register()) < 0.15


def test_a_robot_that_deviates_by_millimetres_is_still_placed(ur5, has_orientation):
    setup = Setup(ur5, 4, has_orientation, poses=100)
    p = 2e-3 * np.random.default_rng(0).normal(size=36)
    setup.X_BF = flange_poses(ur5, p, setup.q)
    X_MB, X_FE = setup.register()
    assert 0.5 < setup.worst_mm(X_MB, X_FE) < 30
    np.testing.assert_allclose(X_MB, setup.X_MB, atol=0.03)


def test_without_orientation_the_reflector_frame_is_not_turned(ur5):
    _, X_FE = Setup(ur5, 0, False).register()
    np.testing.assert_array_equal(X_FE[:3, :3], np.eye(3))


def test_what_is_found_are_rigid_frames(ur5, has_orientation):
    for X in Setup(ur5, 0, has_orientation).spoil(0.2, "scattered").register():
        np.testing.assert_allclose(X[:3, :3] @ X[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(X[:3, :3]) == pytest.approx(1)
        np.testing.assert_array_equal(X[3], [0, 0, 0, 1])


def test_the_same_data_gives_the_same_frames(ur5, has_orientation):
    first, second = (Setup(ur5, 0, has_orientation).spoil(0.2, "scattered").register() for _ in range(2))
    np.testing.assert_array_equal(first, second)


MIX_UPS = {
    "degrees read as radians": lambda q, p: (np.degrees(q), p),
    "radians read as degrees": lambda q, p: (np.radians(q), p),
    "millimetres read as metres": lambda q, p: (q, 1000 * p),
    "joints in another order": lambda q, p: (q[:, ::-1], p),
    "joints of the other sign": lambda q, p: (-q, p),
    "rows in another order": lambda q, p: (np.roll(q, 1, axis=0), p),
}


@pytest.mark.parametrize("mix_up", MIX_UPS)
def test_data_that_fits_nowhere_is_refused_with_the_likely_causes(ur5, has_orientation, mix_up):
    setup = Setup(ur5, 3, has_orientation, poses=60)
    q, setup.p_ME = MIX_UPS[mix_up](setup.q, setup.p_ME)
    setup.X_BF = nominal_flange_poses(ur5, q)
    with pytest.raises(CalibrationError, match="radians and degrees or mm and m mixed up") as caught:
        setup.register()
    assert "expected: within 100 mm" in str(caught.value)


def test_another_robot_is_refused(ur5, ur10, has_orientation):
    setup = Setup(ur10, 3, has_orientation, poses=60)
    setup.X_BF = nominal_flange_poses(ur5, setup.q)
    with pytest.raises(CalibrationError, match="another robot"):
        setup.register()


@pytest.mark.parametrize("which", ["X_MB", "X_FE", "both"])
def test_a_given_frame_that_is_far_off_is_refused(ur5, has_orientation, which):
    setup = Setup(ur5, 0, has_orientation)
    wrong = np.eye(4)
    wrong[:3, 3] = 20  # metres
    frames_given = {"X_MB": setup.X_MB, "X_FE": setup.X_FE} if which == "both" else {}
    frames_given["X_MB" if which != "X_FE" else "X_FE"] = wrong
    with pytest.raises(CalibrationError, match="wrong nominal frames"):
        setup.register(**frames_given)
