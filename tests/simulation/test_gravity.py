"""Gravity torques against the gradient of the potential energy."""

import numpy as np

from postproc.simulation.kinematics import (
    NJ220,
    LinkMasses,
    link_torque,
    payload_torque,
)
from postproc.simulation.reference import working_angles

G = 9.80665
Q = working_angles(np.random.default_rng(0), 20)
BODY = LinkMasses(NJ220, NJ220.mass, NJ220.centre)


def gradient(energy, q: np.ndarray, step: float = 1e-5) -> np.ndarray:
    out = np.empty_like(q)
    for j in range(6):
        d = step * (np.arange(6) == j)
        out[:, j] = (energy(q + d) - energy(q - d)) / (2 * step)
    return out


def test_links_pull_down_the_gradient_of_their_energy() -> None:
    def energy(q: np.ndarray) -> np.ndarray:
        total = 0.0
        for i, T in enumerate(np.moveaxis(NJ220.frames(q)[:, 1:], 1, 0)):
            height = T[:, 2, :3] @ NJ220.centre[i] + T[:, 2, 3]
            total = total + NJ220.mass[i] * G * height
        return total

    np.testing.assert_allclose(link_torque(BODY, Q), -gradient(energy, Q), atol=1e-3)


def test_payload_pulls_down_the_gradient_of_its_energy() -> None:
    mass, com = np.full(20, 80.0), np.tile([0.05, -0.02, 0.3], (20, 1))

    def energy(q: np.ndarray) -> np.ndarray:
        T = NJ220.flange(q)
        return mass * G * (np.sum(T[:, 2, :3] * com, axis=1) + T[:, 2, 3])

    found = payload_torque(BODY, Q, mass, com)
    np.testing.assert_allclose(found, -gradient(energy, Q), atol=1e-3)


def test_the_upright_axis_carries_no_weight() -> None:
    np.testing.assert_allclose(link_torque(BODY, Q)[:, 0], 0.0, atol=1e-9)


def test_a_stretched_arm_weighs_what_its_lever_says() -> None:
    # Upper arm horizontal, a payload alone: torque = m g times the way out from axis 2.
    q = np.radians([[0.0, 90.0, -90.0, 0.0, 0.0, 0.0]])
    out = NJ220.flange(q)[0, 0, 3] - 0.4
    found = payload_torque(BODY, q, np.array([100.0]), np.zeros((1, 3)))
    np.testing.assert_allclose(found[0, 1], 100 * G * out, rtol=1e-12)
