"""Rigid-body algebra, against formulas typed here and scipy's general matrix functions."""

import numpy as np
import pytest
from scipy.linalg import expm, logm, polar
from truepath import lie


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def random_rotation(rng):
    return expm(skew(rng.uniform(-1.7, 1.7, 3)))


def rotation_of(w, x, y, z):
    """The textbook formula for a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_a_pose_is_made_of_a_rotation_and_a_translation_and_either_may_be_left_out(rng):
    R, p = random_rotation(rng), rng.normal(size=3)
    np.testing.assert_array_equal(lie.make_pose(R, p), np.block([[R, p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]))
    np.testing.assert_array_equal(lie.make_pose(), np.eye(4))
    np.testing.assert_array_equal(lie.make_pose(rotation=R)[:3, 3], np.zeros(3))
    np.testing.assert_array_equal(lie.make_pose(translation=p)[:3, :3], np.eye(3))


def test_one_rotation_and_many_translations_make_many_poses(rng):
    R, p = random_rotation(rng), rng.normal(size=(5, 2, 3))
    X = lie.make_pose(R, p)
    assert X.shape == (5, 2, 4, 4)
    np.testing.assert_array_equal(X[3, 1], lie.make_pose(R, p[3, 1]))


def test_the_inverse_of_a_pose_is_the_inverse_of_its_matrix(rng):
    X = np.stack([lie.make_pose(random_rotation(rng), rng.normal(size=3)) for _ in range(6)]).reshape(2, 3, 4, 4)
    np.testing.assert_allclose(lie.invert(X), np.linalg.inv(X), atol=1e-14)


def test_skew_is_the_cross_product(rng):
    a, b = rng.normal(size=(2, 7, 3))
    np.testing.assert_allclose(np.einsum("kij,kj->ki", lie.skew(a), b), np.cross(a, b), atol=1e-15)


def test_a_rotation_vector_is_the_matrix_exponential_and_its_inverse_the_logarithm(rng):
    vectors = rng.uniform(-1.7, 1.7, (4, 5, 3))  # at most 2.94 rad long
    R = lie.from_rotation_vector(vectors)
    assert R.shape == (4, 5, 3, 3)
    for k, i in np.ndindex(4, 5):
        np.testing.assert_allclose(R[k, i], expm(skew(vectors[k, i])), atol=1e-13)
        log = np.real(logm(R[k, i]))
        np.testing.assert_allclose(skew(lie.rotation_vector(R)[k, i]), log, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, np.pi - 1e-9, np.pi])
def test_tiny_and_half_turns_survive_the_way_to_a_matrix_and_back(angle):
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3
    back = lie.rotation_vector(lie.from_rotation_vector(vector))
    # At half a turn both signs are the same rotation.
    off = min(np.abs(back - vector).max(), np.abs(back + vector).max() if angle > 3 else np.inf)
    assert off < 1e-15 + 1e-8 * angle


def test_quaternions_are_scalar_first_and_mean_the_textbook_rotation(rng):
    q = rng.normal(size=(8, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    np.testing.assert_allclose(lie.from_quaternion(q), [rotation_of(*row) for row in q], atol=1e-14)
    np.testing.assert_allclose(lie.from_quaternion(5.0 * q), lie.from_quaternion(q), atol=1e-14)


def test_a_quaternion_made_from_a_rotation_has_unit_length_and_a_scalar_that_is_not_negative(rng):
    R = np.stack([random_rotation(rng) for _ in range(50)])
    q = lie.to_quaternion(R)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-14)
    assert np.all(q[:, 0] >= 0)
    np.testing.assert_allclose([rotation_of(*row) for row in q], R, atol=1e-13)


def test_the_pose_error_leads_from_the_wanted_to_the_actual_pose_in_their_common_frame(rng):
    wanted = lie.make_pose(random_rotation(rng), rng.normal(size=3))
    turn, shift = np.array([0.3, -0.2, 0.5]), np.array([0.01, -0.02, 0.03])
    actual = lie.make_pose(expm(skew(turn)) @ wanted[:3, :3], wanted[:3, 3] + shift)
    np.testing.assert_allclose(lie.pose_error(actual, wanted), [*turn, *shift], atol=1e-13)
    stack = lie.pose_error(np.stack([actual, wanted]), np.stack([wanted, wanted]))
    np.testing.assert_allclose(stack, [[*turn, *shift], np.zeros(6)], atol=1e-13)


def test_the_nearest_rotation_is_the_polar_factor_of_a_matrix_that_does_not_reflect(rng):
    for _ in range(20):
        m = random_rotation(rng) + 0.2 * rng.normal(size=(3, 3))
        assert np.linalg.det(m) > 0
        np.testing.assert_allclose(lie.nearest_rotation(m), polar(m)[0], atol=1e-12)


def test_the_nearest_rotation_of_a_reflecting_matrix_is_a_rotation_and_none_is_nearer(rng):
    m = np.diag([3.0, 2.0, -0.5]) @ random_rotation(rng)
    best = lie.nearest_rotation(m)
    np.testing.assert_allclose(best @ best.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(best) == pytest.approx(1)
    distance = np.linalg.norm(best - m)
    for scale in (1e-3, 1e-2, 0.1, 1, 3):
        for _ in range(100):
            assert np.linalg.norm(best @ expm(skew(scale * rng.normal(size=3))) - m) >= distance - 1e-12
