"""Drawn robots: errors of their own, and a tracker that is set up anew each time."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.calibration.measurements import Measurements
from postproc.calibration.monuments import ReferenceRows
from postproc.robot.state import make_states
from tests.calibration.simulator import HIGH, LOW, PLATE, Simulated, random_arm

PROGRAMS = Path(__file__).parents[2] / "programs"
NESTS = 2  # read in a check; a survey reads all
MONUMENTS = np.array([[2.2, -1.6, -0.3], [2.4, 1.5, 0.2], [0.4, -2.3, 0.8]])
POSES = 5  # of a check, each from both sides


@dataclass
class Robot(Simulated):
    """An arm whose gears have waves.

    Attributes:
        waves: Joint from 0, order, amplitude [rad] and phase of each.
    """

    waves: list[tuple[int, float, float, float]] = field(default_factory=list)

    def joint_error(self, q: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Add the waves."""
        error = np.array(super().joint_error(q, side))
        for j, order, size, phase in self.waves:
            error[:, j] += size * np.sin(order * q[:, j] + phase)
        return error


def draw_robot(rng: np.random.Generator) -> Robot:
    """Draw an arm: waves of most joints, two of them of the motor's side."""
    drawn = random_arm(rng)
    own = {name: getattr(drawn, name) for name in drawn.__dataclass_fields__}
    waves = [
        (j, float(order), float(rng.uniform(2e-5, 8e-5)), float(rng.uniform(0, 6.28)))
        for j, order in ((0, 2), (1, 2), (2, 1), (3, 8), (3, 2), (4, 2), (5, 1))
    ]
    own |= {"tracker": float(rng.uniform(1e-5, 2.5e-5)), "waves": waves}
    own["joint"] = float(rng.uniform(3e-6, 8e-6))
    return Robot(**own)


def placed(rng: np.random.Generator) -> np.ndarray:
    """Draw where a tracker is set up: base frame to its own, (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler(
        "ZYX", [rng.uniform(-3, 3), *rng.normal(0, 0.02, 2)]
    ).as_matrix()
    T[:3, 3] = rng.normal(0, [2.0, 2.0, 0.3])
    return T


def measure(
    robot: Robot, q: np.ndarray, side: np.ndarray, rng: np.random.Generator,
    nests: int = NESTS,
) -> Measurements:  # fmt: skip
    """Read the nests at poses, and the monuments first and last, from a new place."""
    T = placed(rng)

    def read(points: np.ndarray) -> np.ndarray:
        noisy = points + robot.tracker * rng.standard_normal(points.shape)
        return np.asarray(noisy @ T[:3, :3].T + T[:3, 3])

    rows = np.repeat(np.arange(len(q)), nests)
    nest = np.tile(np.arange(nests), len(q))
    shaken = q + robot.joint * rng.standard_normal(q.shape)
    at = robot.tcp(shaken[rows], side[rows], PLATE[nest])
    n, m = len(rows), len(MONUMENTS)
    fixed = ReferenceRows(
        Path("check.csv"), tuple(f"m{k}" for k in range(m)) * 2,
        np.concatenate([read(MONUMENTS), read(MONUMENTS)]), np.full(2 * m, np.nan),
        np.concatenate([np.full(m, -0.5), np.full(m, n - 0.5)]), np.arange(2 * m) + 2,
    )  # fmt: skip
    states = make_states(q[rows], side[rows], PLATE[nest], tool_id=nest)
    return Measurements(
        Path("check.csv"), states, read(at), tuple(str(k + 1) for k in range(n)),
        np.arange(n) + 2 + 2 * m, np.zeros(n, dtype=bool), "0" * 64, references=fixed,
        visit=rows,
    )  # fmt: skip


def check_poses(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw poses of a check: far apart, each from both sides."""
    q = rng.uniform(LOW, HIGH, (POSES, 6))
    return np.repeat(q, 2, axis=0), np.tile([[1.0] * 6, [-1.0] * 6], (POSES, 1))


def draw_poses(count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw poses of a survey, each from any side."""
    q = rng.uniform(LOW, HIGH, (count, 6))
    return q, rng.choice([-1.0, 1.0], (count, 6))


def write_readings(path: Path, rows: Measurements) -> None:
    """Write readings as a file: monuments first, the nests of every stop, monuments."""
    names = [*(f"q{j}_deg" for j in range(1, 7)), *(f"lambda{j}" for j in range(1, 7))]
    fixed, states = rows.references, rows.states
    assert fixed is not None
    points = [["m", *[""] * 13, name, *p * 1e3]
              for name, p in zip(fixed.name, fixed.position, strict=True)]  # fmt: skip
    half = len(points) // 2
    arm = [
        [rows.ids[k], *np.rad2deg(states.q[k]).round(6), *states.direction[k],
         states.tool_id[k], "", *(rows.position[k] * 1e3).round(5)]
        for k in range(len(rows))
    ]  # fmt: skip
    with path.open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["id", *names, "tool_id", "reference", "x_mm", "y_mm", "z_mm"])
        out.writerows([*points[:half], *arm, *points[half:]])


def write_cell(path: Path, serial: str) -> Path:
    """Write the cell of a drawn robot: that of the programs, with nests of its own."""
    text = (PROGRAMS / "cell.toml").read_text()
    robot = f'[robot]\nserial_number = "{serial}"\n'
    nests = f"points_mm = {(PLATE * 1e3).tolist()}"
    text = re.sub(r"points_mm = \[.*?\n\]", nests, text, flags=re.S)
    measured = '[measurements]\nframe = "tracker"\nlambda_sign = 1\n'
    path.write_text(text.replace("[robot]\n", robot, 1) + "\n" + measured)
    return path
