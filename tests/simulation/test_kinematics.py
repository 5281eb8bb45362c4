"""The chain against the checks that are known of the NJ 220-2.7."""

import numpy as np
import pytest

from postproc.simulation.kinematics import NJ220, pose_of_record


def test_flange_points_forward_in_the_calibration_pose() -> None:
    T = NJ220.flange(np.radians([[0, 0, -90, 0, 0, 0]]))[0]
    np.testing.assert_allclose(T[:3, 3], [1.7553, 0.0, 2.255], atol=1e-12)
    np.testing.assert_allclose(T[:3, 2], [1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("q_deg", "record", "tolerance"),
    [
        ([0, 0, -90, 0, 90, 0], [1525.3, 0, 2025, 0, 180, 0], 1e-12),
        (
            [20, 10, -100, 40, 50, -60],
            [1690.056, -735.651, 1659.802, -70.680, 140.469, -11.619],
            2e-5,
        ),
    ],
)
def test_known_positions(q_deg, record, tolerance) -> None:
    T = NJ220.flange(np.radians([q_deg]))[0]
    np.testing.assert_allclose(T, pose_of_record(np.array(record)), atol=tolerance)


def test_positive_joint_1_turns_clockwise_seen_from_above() -> None:
    T = NJ220.flange(np.radians([[30.0, 0, -90, 0, 0, 0]]))[0]
    assert T[1, 3] == pytest.approx(-1.7553 * 0.5)


def test_frames_are_rigid_and_end_in_the_flange() -> None:
    q = np.random.default_rng(0).uniform(-2, 2, (30, 6))
    frames = NJ220.frames(q)
    R = frames[..., :3, :3]
    np.testing.assert_allclose(
        np.swapaxes(R, -1, -2) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-14
    )
    np.testing.assert_array_equal(frames[:, 6], NJ220.flange(q))


def test_growth_of_every_link_stretches_the_whole_arm() -> None:
    q = np.random.default_rng(0).uniform(-2, 2, (30, 6))
    grown = NJ220.grow(np.full((30, 6), 1e-3)).flange(q)
    np.testing.assert_allclose(grown[:, :3, 3], 1.001 * NJ220.flange(q)[:, :3, 3])


def test_dh_angles_round_trip() -> None:
    q = np.random.default_rng(0).uniform(-2, 2, (30, 6))
    np.testing.assert_allclose(NJ220.controller_angles(NJ220.dh_angles(q)), q)
