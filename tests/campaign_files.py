"""Campaigns as files: what somebody writes of what was measured, and what he could."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.calibration.fit import Frame
from postproc.calibration.measurements import Measurements
from postproc.calibration.survey_files import read_measurements
from postproc.robot.cell import Cell, load_cell
from tests.calibration.simulator import PLATE

FLOOR = (0.0, 0.0, -1.0)
PLACES = (((3.6, -2.4, 1.5), 2.0), ((-2.6, 2.9, 1.1), -0.7))  # trackers: m, rad


@dataclass(frozen=True)
class Setup:
    """How an arm stands, where trackers stand, and what the files say of it.

    Attributes:
        weight: Direction in which weight pulls, (3,), base frame.
        said: Where the cell has it: "mounting", "base" or nowhere, "".
        soft: Softness of joints 2, 3 and 5 [rad/(N m)].
        stations: Places of the tracker, a file each; 0: the file is of the base frame.
        rows: "as measured", "newest first" or "shuffled".
        directions: Whether the file has them; without, the arm goes from pose to pose.
    """

    weight: tuple[float, float, float] = FLOOR
    said: str = ""
    soft: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stations: int = 0
    rows: str = "as measured"
    directions: bool = True

    @property
    def tilted(self) -> bool:
        """Whether the arm does not stand on a floor."""
        return self.weight != FLOOR

    @property
    def yields(self) -> bool:
        """Whether joints yield to the weight."""
        return any(self.soft)

    @property
    def frame(self) -> Frame:
        """Frame of the positions in the files."""
        return "tracker" if self.stations else "base"

    def __str__(self) -> str:
        x, y, z = self.weight
        weight = f"weight {x:.2f},{y:.2f},{z:.2f} in {self.said or 'nothing'}"
        parts = [weight] if self.tilted else []
        parts += ["yields"] if self.yields else []
        parts += [f"{self.stations} stations"] if self.stations else []
        parts += [self.rows] if self.rows != "as measured" else []
        parts += [] if self.directions else ["no lambda"]
        return ", ".join(parts)


def draw_setup(rng: np.random.Generator, poses: int, sides: int, clock: bool) -> Setup:
    """Draw how an arm of a campaign stands and what its files say."""
    angle, lean = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(30.0, 60.0))
    incline = np.r_[np.sin(lean) * np.cos(angle), np.sin(lean) * np.sin(angle), 0.0]
    incline[2] = -np.cos(lean)
    x, y, z = (float(v) for v in np.round(incline, 4))
    number = int(rng.choice(4, p=[0.5, 0.15, 0.15, 0.2]))
    weight = (FLOOR, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (x, y, z))[number]
    softest = rng.uniform([2e-8, 1e-7, 5e-7], [8e-8, 3e-7, 2e-6])
    k2, k3, k5 = (float(v) for v in softest)
    soft = rng.random() < 0.5 or weight != FLOOR
    said = str(rng.choice(["mounting", "base", ""])) if weight != FLOOR else ""
    stations = int(rng.choice([0, 0, 0, 1, 2]))
    rows = str(rng.choice(["as measured", "as measured", "newest first", "shuffled"]))
    return Setup(
        weight, said, (k2, k3, k5) if soft else (0.0, 0.0, 0.0),
        min(stations, 1) if poses < 40 else stations,
        rows if clock else "as measured",
        sides == 2 or rng.random() < 0.6,
    )  # fmt: skip


def placed(station: int) -> np.ndarray:
    """Return the transform of a station's coordinates into the base frame, (4, 4)."""
    at, turn = PLACES[station]
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", [turn, 0.02, -0.03]).as_matrix()
    T[:3, 3] = at
    return T


def seen_from(station: int, position: np.ndarray) -> np.ndarray:
    """Convert positions (n, 3) [m] of the base frame to a station's."""
    T = placed(station)
    return np.asarray((position - T[:3, 3]) @ T[:3, :3])


def write_cell(path: Path, weight: Sequence[float], said: str) -> Cell:
    """Write a cell file that says how the arm stands in one of three ways."""
    points = (PLATE * 1e3).tolist()
    lines = ["[robot]", 'arm = "nj220-2.7"']
    if said == "mounting":
        lines.append(f"mounting = {list(weight)}")
    if said == "base":
        down = -np.array(weight) / np.linalg.norm(weight)
        lean = float(np.arccos(np.clip(down[2], -1.0, 1.0)))
        last = float(np.arctan2(down[1], -down[0]))  # third row: -sin e cos r, ..
        angles = np.rad2deg([0.3, lean, last]).tolist()
        lines += ["[base]", "xyz_mm = [0.0, 0.0, 450.0]", f"euler_zyz_deg = {angles}"]
    lines += ["[measurements]", "lambda_sign = 1"]  # gaps are drawn with either sign
    lines += ["[survey]", f"points_mm = {points}"]
    path.write_text("\n".join(lines) + "\n")
    return load_cell(path)


def write_files(
    folder: Path, survey: Measurements, setup: Setup, written: Sequence[str], order: str
) -> list[Path]:
    """Write a campaign, a file for each station.

    Args:
        folder: Where to.
        survey: Rows in the order of visits, base frame.
        setup: What the files say.
        written: Further columns: "time_s", "visit".
        order: Of the rows: "as measured", "newest first" or "shuffled".
    """
    paths = []
    rng = np.random.default_rng(len(survey))
    for s in range(max(setup.stations, 1)):
        rows = np.flatnonzero(survey.states.station == s)
        if order == "newest first":
            rows = rows[::-1]
        if order == "shuffled":
            rows = rng.permutation(rows)
        paths.append(folder / f"measured{s + 1}.csv")
        _write(paths[-1], survey, rows, setup, written)
    return paths


def _write(
    path: Path, survey: Measurements, rows: np.ndarray, setup: Setup,
    written: Sequence[str],
) -> None:  # fmt: skip
    """Write some of the rows."""
    states, n = survey.states, len(survey)
    degrees = np.rad2deg(states.q)
    position = survey.position[rows]
    if setup.stations:
        position = seen_from(int(states.station[rows[0]]), position)
    assert survey.visit is not None
    columns: dict[str, Sequence[object]] = {
        "id": [f"P{k + 1}" for k in rows],
        **{f"q{j + 1}_deg": [f"{v:.5f}" for v in degrees[rows, j]] for j in range(6)},
        **{f"{a}_mm": [f"{v * 1e3:.4f}" for v in position[:, k]]
           for k, a in enumerate("xyz")},
        "tool_id": states.tool_id[rows].tolist(),
    }  # fmt: skip
    if setup.directions:
        columns |= {
            f"lambda{j + 1}": [f"{v:.0f}" for v in states.direction[rows, j]]
            for j in range(6)
        }
    if "time_s" in written:
        columns["time_s"] = [f"{v:.1f}" for v in states.time[rows]]
    if "visit" in written:
        columns["visit"] = [f"v{v:0{len(str(n))}d}" for v in survey.visit[rows]]
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(zip(*columns.values(), strict=True))


def as_filed(
    folder: Path, survey: Measurements, setup: Setup, clock: bool
) -> tuple[Measurements, Cell]:
    """Write a campaign as somebody does, and read it."""
    cell = write_cell(folder / "cell.toml", setup.weight, setup.said)
    written = ("time_s",) if clock else ()
    paths = write_files(folder, survey, setup, written, setup.rows)
    return read_measurements(*paths, cell=cell), cell


def as_informed(
    folder: Path, survey: Measurements, setup: Setup
) -> tuple[Measurements, Cell]:
    """Write it with visits, times and mounting, rows as measured, and read it."""
    cell = write_cell(folder / "cell.toml", setup.weight, "mounting")
    written = ("time_s", "visit")
    paths = write_files(folder, survey, setup, written, "as measured")
    return read_measurements(*paths, cell=cell), cell
