"""Group axioms and agreement with SciPy (whose quaternions are x y z w)."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from flight import frames, rotations

unit = st.floats(-1.0, 1.0)
rotation_vectors = arrays(np.float64, 3, elements=st.floats(-3.0, 3.0)).filter(
    lambda r: np.linalg.norm(r) < np.pi - 1e-3
)
quaternions = rotation_vectors.map(rotations.exp)
vectors = arrays(np.float64, 3, elements=st.floats(-100.0, 100.0))


@given(quaternions, quaternions, quaternions)
def test_multiplication_is_associative(a, b, c):
    left = rotations.multiply(rotations.multiply(a, b), c)
    right = rotations.multiply(a, rotations.multiply(b, c))
    np.testing.assert_allclose(left, right, atol=1e-14)


@given(quaternions)
def test_the_conjugate_is_the_inverse(q):
    np.testing.assert_allclose(rotations.multiply(q, rotations.conjugate(q)), rotations.IDENTITY, atol=1e-14)


@given(rotation_vectors)
def test_log_undoes_exp(r):
    np.testing.assert_allclose(rotations.log(rotations.exp(r)), r, atol=1e-9)


@given(st.floats(0.0, 1e-7))
def test_log_undoes_exp_for_tiny_angles(angle):
    r = np.array([0.6, -0.8, 0.0]) * angle
    np.testing.assert_allclose(rotations.log(rotations.exp(r)), r, rtol=1e-9, atol=1e-25)


@given(quaternions, vectors)
def test_three_ways_to_rotate_agree(q, v):
    expected = Rotation.from_quat(q[[1, 2, 3, 0]]).apply(v)
    np.testing.assert_allclose(rotations.rotate(q, v), expected, atol=1e-11)
    np.testing.assert_allclose(rotations.matrix(q) @ v, expected, atol=1e-11)


@given(quaternions, quaternions)
def test_matrices_and_quaternions_compose_alike(a, b):
    product = rotations.matrix(a) @ rotations.matrix(b)
    np.testing.assert_allclose(rotations.matrix(rotations.multiply(a, b)), product, atol=1e-13)


@given(quaternions)
def test_from_matrix_undoes_matrix(q):
    back = rotations.from_matrix(rotations.matrix(q))
    assert rotations.angle_between(q, back) < 1e-7
    assert back[0] >= 0.0


def test_half_turns_survive_the_matrix():
    turns = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(rotations.from_matrix(rotations.matrix(turns)), turns, atol=1e-15)


@given(quaternions, quaternions, st.floats(0.0, 1.0))
def test_slerp_moves_at_a_constant_rate(a, b, fraction):
    middle = rotations.slerp(a, b, np.array(fraction))
    whole = rotations.angle_between(a, b)
    np.testing.assert_allclose(rotations.angle_between(a, middle), fraction * whole, atol=1e-6)


@given(st.floats(-3.1, 3.1))
def test_yaw_reads_back_what_from_yaw_wrote(angle):
    np.testing.assert_allclose(rotations.yaw(rotations.from_yaw(angle)), angle, atol=1e-12)


@given(vectors, vectors)
def test_hat_is_the_cross_product(a, b):
    np.testing.assert_allclose(rotations.hat(a) @ b, np.cross(a, b), atol=1e-9)


@given(quaternions, vectors, vectors)
def test_a_transform_and_its_inverse_cancel(q, t, p):
    T_world_body = frames.transform(q, t)
    np.testing.assert_allclose(frames.invert(T_world_body) @ T_world_body, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(frames.apply(frames.invert(T_world_body), frames.apply(T_world_body, p)), p, atol=1e-11)


@given(quaternions, vectors)
def test_flipping_to_mavlink_commutes_with_rotation(q_world_body, v_body):
    """Rotating in our frames then flipping is flipping both and rotating in MAVLink's: NED = q_flipped * FRD."""
    ned = rotations.rotate(frames.flip_attitude(q_world_body), frames.flip_vector(v_body))
    np.testing.assert_allclose(ned, frames.flip_vector(rotations.rotate(q_world_body, v_body)), atol=1e-11)
    np.testing.assert_array_equal(frames.flip_attitude(frames.flip_attitude(q_world_body)), q_world_body)


def test_level_flight_is_level_in_mavlink_too():
    np.testing.assert_array_equal(frames.flip_vector([1.0, 2.0, 3.0]), [1.0, -2.0, -3.0])
    np.testing.assert_allclose(frames.flip_attitude(rotations.from_yaw(0.5)), rotations.from_yaw(-0.5), atol=1e-15)


@given(quaternions, quaternions, st.floats(0.0, 1.0))
def test_the_two_quaternions_of_an_attitude_mean_the_same(a, b, fraction):
    np.testing.assert_allclose(rotations.log(-a), rotations.log(a), atol=1e-9)
    assert np.linalg.norm(rotations.log(-a)) <= np.pi + 1e-9
    assert rotations.angle_between(rotations.slerp(a, -b, fraction), rotations.slerp(a, b, fraction)) < 1e-6


@given(quaternions, quaternions)
def test_continuous_attitudes_are_the_same_and_never_turn_the_long_way(a, b):
    given_ = np.stack([a, -a, b, -b, -a])
    found = rotations.continuous(given_)
    np.testing.assert_array_equal(np.abs(found), np.abs(given_))
    assert ((found[1:] * found[:-1]).sum(axis=1) >= 0.0).all()
    np.testing.assert_array_equal(found[0], a)
    assert rotations.continuous(given_[:0]).shape == (0, 4)
