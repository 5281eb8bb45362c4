"""ZYZ poses as group axioms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from postproc.robot.pose import (
    cross,
    has_unknown,
    inverse,
    is_unknown,
    lengths,
    pose_from_record,
    products,
    record_from_pose,
    rotation_from_vector,
    rotation_vector,
)

angle = st.floats(-180, 180)
record = st.tuples(*[st.floats(-3000, 3000)] * 3, angle, angle, angle).map(np.array)


@given(record)
def test_rotation_is_intrinsic_zyz(r):
    expected = Rotation.from_euler("ZYZ", r[3:], degrees=True).as_matrix()
    np.testing.assert_allclose(pose_from_record(r)[:3, :3], expected, atol=1e-12)


@given(record)
def test_record_and_back(r):
    T = pose_from_record(r)
    np.testing.assert_allclose(pose_from_record(record_from_pose(T)), T, atol=1e-8)


@given(record, record)
def test_inverse_of_a_product(r, s):
    A, B = pose_from_record(r), pose_from_record(s)
    np.testing.assert_allclose(inverse(A @ B), inverse(B) @ inverse(A), atol=1e-9)
    np.testing.assert_allclose(A @ inverse(A), np.eye(4), atol=1e-9)


@given(record)
def test_one_pose_for_all_rows_is_inverted_once(r):
    T = pose_from_record(r)
    found = inverse(np.broadcast_to(T, (5, 4, 4)))
    np.testing.assert_array_equal(found, inverse(np.tile(T, (5, 1, 1))))
    assert found.strides[0] == 0


@pytest.mark.parametrize("e", [0.0, 180.0])
def test_degenerate_split_puts_a_to_zero(e):
    T = pose_from_record(np.array([1, 2, 3, 25, e, 40]))
    r = record_from_pose(T)
    assert r[3] == 0.0 and r[4] == e
    np.testing.assert_allclose(pose_from_record(r), T, atol=1e-9)


def test_rotation_vector_of_many():
    R = Rotation.random(12, random_state=0)
    found = rotation_vector(R.as_matrix().reshape(3, 4, 3, 3))
    np.testing.assert_allclose(found.reshape(-1, 3), R.as_rotvec(), atol=1e-12)


@pytest.mark.parametrize("angle", [0, 1e-9, 9e-4, 1.1e-3, 0.5, 2.5, np.pi - 1e-9])
def test_rotations_about_vectors_are_those_of_scipy(angle):
    axes = Rotation.random(60, random_state=1).as_matrix().reshape(-1, 3)
    axes[:6] = [*np.eye(3), *-np.eye(3)]  # each of the formulas is the best for some
    vectors = angle * axes
    R = rotation_from_vector(vectors)
    expected = Rotation.from_rotvec(vectors).as_matrix()
    np.testing.assert_allclose(R, expected, rtol=0, atol=1e-15)
    given = Rotation.from_matrix(R).as_rotvec()
    np.testing.assert_allclose(rotation_vector(R), given, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(rotation_from_vector(vectors[7]), R[7])


def test_half_a_turn_is_kept_and_more_goes_round_the_other_way():
    half = rotation_vector(np.diag([-1.0, 1.0, -1.0]))
    np.testing.assert_allclose(half, [0.0, np.pi, 0.0])
    back = rotation_vector(rotation_from_vector(np.array([0.0, 0.0, 4.0])))
    np.testing.assert_allclose(back, [0.0, 0.0, 4.0 - 2 * np.pi])
    assert rotation_vector(np.empty((0, 3, 3))).shape == (0, 3)


def test_products_of_few_poses_for_many_pairs():
    rng = np.random.default_rng(4)
    few = pose_from_record(rng.uniform(-90, 90, (5, 6)))
    few[4] = np.nan
    i, j = rng.integers(-1, 4, 40), rng.integers(-5, 5, 40)
    found = products(inverse(few), few, i, j)
    np.testing.assert_array_equal(found, inverse(few)[i] @ few[j])
    unknown = (i == -1) | np.isin(j, (-1, 4))
    np.testing.assert_array_equal(is_unknown(found), unknown)


def test_cross_is_that_of_numpy():
    a, b = np.random.default_rng(5).normal(size=(2, 7, 6, 3))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
    np.testing.assert_array_equal(cross(a[0, 0], b), np.cross(a[0, 0], b))


def test_lengths_are_those_of_numpy_to_the_last_digit():
    vectors = np.random.default_rng(3).standard_normal((1000, 3))
    np.testing.assert_array_equal(lengths(vectors), np.linalg.norm(vectors, axis=1))
    assert np.isnan(lengths(np.array([[1.0, np.nan, 0.0]]))).all()


def test_a_row_with_one_unknown_number_is_unknown():
    rows = np.zeros((3, 6))
    rows[1, 5] = np.nan
    assert has_unknown(rows).tolist() == [False, True, False]
