"""Two independent descriptions of one arm must agree where nothing is in error."""

import numpy as np

from postproc.robot.arm import load_arm
from postproc.robot.state import make_states
from postproc.virtual import NJ220, arrivals_of_states, virtual_arm
from postproc.virtual.gravity import Body, link_torque, payload_torque
from postproc.virtual.inverse import solve_branch
from postproc.virtual.reference import working_angles

ARM = load_arm("nj220-2.7")
Q = working_angles(np.random.default_rng(0), 50)


def test_flanges() -> None:
    np.testing.assert_allclose(NJ220.flange(Q), ARM.flange(Q), atol=1e-12)


def test_inverse_kinematics_branch_by_branch() -> None:
    flange = NJ220.flange(Q)
    theirs = ARM.inverse(flange).q
    for branch in range(8):
        ours = solve_branch(NJ220, flange, branch)
        gap = np.exp(1j * ours) - np.exp(1j * theirs[:, branch])
        both = ~np.isnan(gap).any(axis=1)
        assert both.sum() > 10
        np.testing.assert_allclose(np.abs(gap[both]), 0.0, atol=1e-8)


def test_gravity_torques() -> None:
    mass, com = np.full(50, 60.0), np.tile([0.02, 0.1, 0.2], (50, 1))
    ours = link_torque(Body(NJ220, NJ220.mass, NJ220.centre), Q)
    ours = ours + payload_torque(NJ220, Q, mass, com)
    np.testing.assert_allclose(ours, ARM.gravity_torque(Q, mass, com), atol=0.5)


def test_limits_and_speeds() -> None:
    np.testing.assert_allclose(NJ220.lower, ARM.lower)
    np.testing.assert_allclose(NJ220.upper, ARM.upper)
    np.testing.assert_allclose(NJ220.speed, ARM.velocity)


def test_a_perfect_arm_has_no_error_at_the_models_states() -> None:
    states = make_states(Q, np.ones((50, 6)), np.array([0.08, -0.04, 0.15]))
    perfect = virtual_arm(1, "")
    error = perfect.error(arrivals_of_states(states))
    np.testing.assert_allclose(error, 0.0, atol=1e-14)
