"""Rotations by their group axioms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.simulation.kinematics import (
    exponential,
    logarithm,
    pose_of_numbers,
    pose_of_record,
    small_motion,
    undo,
)


def test_exponential_is_the_rotation_about_the_vector() -> None:
    v = np.random.default_rng(1).normal(size=(50, 3)) * 2
    np.testing.assert_allclose(
        exponential(v), Rotation.from_rotvec(v).as_matrix(), atol=1e-14
    )
    np.testing.assert_array_equal(exponential(np.zeros(3)), np.eye(3))


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.1, np.pi - 1e-8])
def test_logarithm_undoes_the_exponential(size: float) -> None:
    axis = np.array([0.48, -0.6, 0.64])
    found = logarithm(exponential(size * axis))
    np.testing.assert_allclose(found, size * axis, atol=2e-8)


def test_logarithm_of_half_a_turn_is_about_either_end_of_the_axis() -> None:
    for axis in np.eye(3):
        R = 2 * np.outer(axis, axis) - np.eye(3)
        np.testing.assert_allclose(np.abs(logarithm(R)), np.pi * axis, atol=1e-9)


def test_record_is_euler_zyz() -> None:
    record = np.array([100.0, -200.0, 300.0, 40.0, 50.0, -60.0])
    T = pose_of_record(record)
    wanted = Rotation.from_euler("ZYZ", record[3:], degrees=True).as_matrix()
    np.testing.assert_allclose(T[:3, :3], wanted, atol=1e-15)
    np.testing.assert_allclose(T[:3, 3], [0.1, -0.2, 0.3])


def test_numbers_are_a_record_or_hold_a_quaternion_of_any_length() -> None:
    record = np.array([100.0, -200.0, 300.0, 40.0, 50.0, -60.0])
    np.testing.assert_array_equal(pose_of_numbers(record), pose_of_record(record))
    for q in (*np.random.default_rng(3).normal(size=(50, 4)), *np.eye(4)):
        T = pose_of_numbers(np.array([100.0, -200.0, 300.0, *q, 0.0, -1.0, 1.0, 0.0]))
        wanted = Rotation.from_quat(q, scalar_first=True).as_matrix()
        np.testing.assert_allclose(T[:3, :3], wanted, atol=1e-14)
        np.testing.assert_allclose(T[:3, 3], [0.1, -0.2, 0.3])


def test_undo_is_the_inverse() -> None:
    T = small_motion(np.random.default_rng(2).normal(size=(20, 6)))
    np.testing.assert_allclose(undo(T) @ T, np.tile(np.eye(4), (20, 1, 1)), atol=1e-14)
