"""A small arm with errors of its own, to check the fits against.

Its chain multiplies 4 x 4 matrices and shares no code with the package.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from postproc.calibration.measurements import Measurements
from postproc.robot.arm import Arm, load_arm
from postproc.robot.state import States, make_states
from postproc.simulation.laws import HOLLOW_WRIST, MOTOR_TURNS

NJ = load_arm("nj220-2.7")
GEARED = replace(NJ, gear_ratio=np.array(MOTOR_TURNS))
COUPLED = replace(GEARED, coupling=HOLLOW_WRIST)  # drive 6 turns through q6 - q5 - ..
TOOL = np.array([0.08, -0.04, 0.15])
PLATE = np.array([[0.08, -0.04, 0.15], [-0.06, 0.10, 0.20], [0.05, 0.09, 0.32]])
LOW = np.deg2rad([-90.0, -45, -170, -150, -110, -150])
HIGH = np.deg2rad([90.0, 60, -40, 150, 110, 150])


def rot(axis: int, angle: float | np.ndarray) -> np.ndarray:
    """Turn about an axis, (4, 4), or by each of n angles, (n, 4, 4)."""
    T = np.zeros((*np.shape(angle), 4, 4))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    T[..., a, a] = T[..., b, b] = np.cos(angle)
    T[..., b, a] = np.sin(angle)
    T[..., a, b] = -np.sin(angle)
    T[..., axis, axis] = T[..., 3, 3] = 1.0
    return T


def move(place: Iterable[float] | np.ndarray) -> np.ndarray:
    """Move by a vector, (4, 4), or by each of n vectors, (n, 4, 4)."""
    T = np.zeros((*np.shape(place)[:-1], 4, 4))
    T[..., np.arange(4), np.arange(4)] = 1.0
    T[..., :3, 3] = place
    return T


def apart(six: np.ndarray) -> np.ndarray:
    """Move by three lengths, then turn by three angles about x, y and z."""
    a, b, c = six[3:]
    return move(six[:3]) @ rot(0, a) @ rot(1, b) @ rot(2, c)


@dataclass
class Simulated:
    """True errors of one arm; lengths in m, angles in rad."""

    link: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    dh_d: np.ndarray = field(default_factory=lambda: np.zeros(6))
    dh_theta: np.ndarray = field(default_factory=lambda: np.zeros(6))
    base: np.ndarray = field(default_factory=lambda: np.zeros(6))
    tool: np.ndarray = field(default_factory=lambda: np.zeros(3))
    backlash: np.ndarray = field(default_factory=lambda: np.zeros((6, 3)))
    tracker: float = 2.5e-5
    joint: float = 4e-6
    arm: Arm = NJ

    def joint_error(self, q: np.ndarray, side: np.ndarray) -> np.ndarray:
        b0, s, c = self.backlash.T
        return side * (b0 + s * np.sin(q) + c * np.cos(q))

    def tcp(self, q: np.ndarray, side: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """True TCP positions."""
        out: np.ndarray = self.pose(q, side, tool)[:, :3, 3]
        return out

    def pose(self, q: np.ndarray, side: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """True TCP poses (n, 4, 4); the tool is not turned."""
        dh = self.arm.dh
        actual = q + self.joint_error(q, side)
        theta = dh.offset + dh.sense * (actual @ dh.mix.T) + self.dh_theta
        T = np.broadcast_to(apart(self.base), (len(q), 4, 4))
        for j in range(6):
            link = move((dh.a[j], 0.0, dh.d[j] + self.dh_d[j])) @ rot(0, dh.alpha[j])
            T = T @ rot(2, theta[:, j]) @ (link @ apart(self.link[j]))
        out: np.ndarray = T @ move(tool + self.tool)
        return out

    def measure(
        self, states: States, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Noisy measurement and the noise-free truth of every state."""
        truth = self.tcp(states.q, states.direction, states.tool)
        shaken = states.q + self.joint * rng.standard_normal(states.q.shape)
        noisy = self.tcp(shaken, states.direction, states.tool)
        noisy = noisy + self.tracker * rng.standard_normal(noisy.shape)
        return noisy, truth


def random_arm(rng: np.random.Generator, tool: bool = True) -> Simulated:
    """Draw geometry (1 mm, 1 mrad), tool and angle-dependent backlash errors."""
    link = np.zeros((6, 6))
    link[:, :3] = 5e-4 * rng.standard_normal((6, 3))
    link[:, 3:] = 5e-4 * rng.standard_normal((6, 3))
    backlash = np.zeros((6, 3))
    backlash[:, 0] = rng.uniform(5e-5, 2e-4, 6) * rng.choice([-1, 1], 6)
    backlash[:, 1:] = 5e-5 * rng.standard_normal((6, 2))
    return Simulated(
        link=link,
        tool=5e-4 * rng.standard_normal(3) if tool else np.zeros(3),
        backlash=backlash,
    )


def random_states(
    n: int, rng: np.random.Generator, tools: np.ndarray = TOOL[None]
) -> States:
    """Draw poses with known random directions; tools take turns."""
    q = rng.uniform(LOW, HIGH, (n, 6))
    which = np.arange(n) % len(tools)
    side = rng.choice([-1.0, 1.0], (n, 6))
    return make_states(q, side, tools[which], tool_id=which)


def survey_of(states: States, position: np.ndarray) -> Measurements:
    """Wrap states and positions as a survey."""
    n = len(states)
    return Measurements(
        path=Path("survey.csv"),
        states=states,
        position=position,
        ids=tuple(str(k + 1) for k in range(n)),
        line=np.arange(n) + 2,
        inferred=np.zeros(n, dtype=bool),
        sha256="0" * 64,
    )


def covariates(states: States, rng: np.random.Generator) -> States:
    """Fill in what effects may depend on."""
    n = len(states)
    return states.with_(
        travel=rng.uniform(0.0, 0.3, (n, 6)),
        speed=rng.uniform(0.05, 0.4, n),
        time=np.cumsum(rng.uniform(5.0, 15.0, n)),
        temperature=np.linspace(20.0, 30.0, n),
        payload=rng.choice([40.0, 120.0], n),
    )
