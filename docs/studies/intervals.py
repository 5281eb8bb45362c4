"""Write intervals.md: whether 95 % intervals of a reading hold 95 % of readings.

PYTHONPATH=. python docs/studies/intervals.py [--seeds 20] [--shared ../shared]
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.calibration.fit import fit_measurements, into_base_frame
from postproc.calibration.measurements import Measurements, read_survey_file
from postproc.calibration.registration import predict_registered
from postproc.calibration.tables import TableFormat
from postproc.exceptions import PostprocError
from postproc.model.kinematics import ArmStates
from postproc.model.model import PredictedReading
from postproc.robot.cell import Cell, load_cell

Splits = tuple[tuple[str, Callable[[int, int], np.ndarray]], ...]
Frames = tuple[str, ...]
OUT = Path(__file__).parent / "intervals.md"
WITHIN = 1.96
UR5 = """name = "ur5"
repeatability_mm = 0.1
[dh]
a_mm = [0.0, -425.0, -392.25, 0.0, 0.0, 0.0]
d_mm = [89.159, 0.0, 0.0, 109.15, 94.65, 82.3]
alpha_deg = [90.0, 0.0, 0.0, 90.0, -90.0, 0.0]
[joints]
lower_deg = [-360.0, -360.0, -360.0, -360.0, -360.0, -360.0]
upper_deg = [360.0, 360.0, 360.0, 360.0, 360.0, 360.0]
velocity_deg_s = [180.0, 180.0, 180.0, 180.0, 180.0, 180.0]
acceleration_deg_s2 = [450.0, 450.0, 450.0, 450.0, 450.0, 450.0]
jerk_deg_s3 = [4500.0, 4500.0, 4500.0, 4500.0, 4500.0, 4500.0]
"""
HEAD = [
    "| rows held out | frame | intervals hold | at least, at most | coordinates | std "
    "of a reading, mm | error, mm |",
    "|---|---|---|---|---|---|---|",
]
BETWEEN = [
    "| fitted | rows | intervals hold | std of a reading, mm | term between campaigns, "
    "mm | with it | error, mm |",
    "|---|---|---|---|---|---|---|",
]
TEXT = """# Intervals of a reading

Written by `make intervals`, which is
`PYTHONPATH=. python docs/studies/intervals.py --seeds {n}`, from measurements of two
real arms, a UR10 (series A, B and D) and a UR5 (`grid` and `random`).

A *reading* is what the tracker shows for one arrival at a pose. Its 95 % interval is
1.96 times the standard deviation that `postproc predict` writes where the frame of the
measurements is stated (`reading_sx_mm` ..): uncertain parameters of all effects, of the
set-up among them, the arm's repeatability, the tracker, and heavy tails. How heavy they
are, a fit asks each of its rows, predicted without itself; no row that is counted below
was seen by the fit that predicts it. *At least, at most* are the lowest and the highest
of the {n} splits. The seeds draw the splits; nothing else is random.

What nobody can know apart, such as the places of the base and of the tracker, is known
of their sum, which is read, and does not widen its interval.

"""
LATER = """
## Other series and last quarters

Here there is no promise: a set-up drifts, and an arm changes. The registration is found
again from the rows where the series is another one
(`measurements.refit_registration`). The *term
between campaigns* is the further standard deviation of every coordinate with which
squared residuals are as large as stated, root(mean(r^2) - mean(s^2)); `predict` tells
it under every file for which it is not 0.

"""


@dataclass(frozen=True)
class Series:
    """A series of readings of one arm, with the probe's place not known."""

    name: str
    rows: Measurements
    cell: Cell


@dataclass(frozen=True)
class Outcome:
    """Residuals of rows that no fit has seen, and their stated deviations [m]."""

    left: np.ndarray
    std: np.ndarray

    @property
    def hold(self) -> float:
        """Share of coordinates inside."""
        return float((np.abs(self.left) < WITHIN * self.std).mean())

    @property
    def between(self) -> float:
        """Further standard deviation that is missing [m]."""
        return float(np.sqrt(max((self.left**2).mean() - (self.std**2).mean(), 0.0)))

    @property
    def error(self) -> float:
        """Mean distance [m]."""
        return float(np.linalg.norm(self.left, axis=1).mean())


def held_out(series: Series, test: np.ndarray, frame: str) -> Outcome:
    """Fit the other rows, and judge these."""
    left, read, _ = predict_rows(series, test, frame)
    return Outcome(left, read.std)


def predict_rows(
    series: Series, test: np.ndarray, frame: str
) -> tuple[np.ndarray, PredictedReading, np.ndarray]:
    """Fit the other rows, and predict these.

    Returns:
        What is left of the readings, (n, 3) [m]; the prediction; and which states the
        model calls outside of what was surveyed, (n,).

    In the base frame the rows are as a user registers them: by the fitted rows and the
    nominal arm, before and without the fit.
    """
    train = series.rows[np.setdiff1d(np.arange(len(series.rows)), test)]
    rows, arm = series.rows[test], series.cell.arm
    if frame == "base":
        train, placed = into_base_frame(train, arm)
        model = fit_measurements(train, series.cell).model
    else:
        model = fit_measurements(train, series.cell, frame="tracker").model
        assert model.registration is not None
        placed = model.registration
    states = placed.on_probes(rows.states)
    read = model.reading(arm, states)
    tcp = ArmStates(arm, states).walk.tcp
    outside = model.predict(arm, states).any_outside
    return placed.to_base(rows.position) - tcp - read.error, read, outside


def random_rows(n: int, seed: int) -> np.ndarray:
    """Draw 30 % of the rows."""
    return np.sort(np.random.default_rng(seed).permutation(n)[int(0.7 * n) :])


def blocks(n: int, seed: int) -> np.ndarray:
    """Draw 9 of 30 blocks of consecutive rows."""
    chosen = np.random.default_rng(seed).permutation(30)[:9]
    return np.flatnonzero(np.isin(np.arange(n) * 30 // n, chosen))


SPLITS = (("random 30 %", random_rows), ("9 of 30 blocks", blocks))
FRAMES = ("tracker", "base")


def pooled(
    series: Series, seeds: int, splits: Splits = SPLITS, frames: Frames = FRAMES
) -> Iterator[str]:
    """Judge rows of one series that were drawn, over the seeds."""
    for title, draw in splits:
        for frame in frames:
            found = [
                held_out(series, draw(len(series.rows), seed), frame)
                for seed in range(seeds)
            ]
            shares = [f.hold for f in found]
            left, std = (np.concatenate([getattr(f, k) for f in found])
                         for k in ("left", "std"))  # fmt: skip
            every = Outcome(left, std)
            yield (
                f"| {series.name}, {title} | {frame} | {100 * every.hold:.1f} % "
                f"| {100 * min(shares):.1f} to {100 * max(shares):.1f} % "
                f"| {left.size} | {std.mean() * 1e3:.3f} | {every.error * 1e3:.3f} |"
            )


def told(fitted: str, rows: str, found: Outcome) -> str:
    """Write one row of the second table."""
    wide = Outcome(found.left, np.hypot(found.std, found.between))
    return (
        f"| {fitted} | {rows} | {100 * found.hold:.0f} % "
        f"| {found.std.mean() * 1e3:.3f} "
        f"| {found.between * 1e3:.3f} | {100 * wide.hold:.0f} % "
        f"| {found.error * 1e3:.3f} |"
    )


def last_quarter(series: Series) -> Iterator[str]:
    """Fit three quarters of a series, and judge the last."""
    n = len(series.rows)
    for frame in ("tracker", "base"):
        found = held_out(series, np.arange(3 * n // 4, n), frame)
        yield told(f"{series.name}, first 75 %, {frame}", "the last quarter", found)


def another(fitted: Series, series: Series) -> Iterator[str]:
    """Fit one series and judge another, registered anew."""
    arm = fitted.cell.arm
    model = fit_measurements(fitted.rows, fitted.cell, frame="tracker").model
    rows = series.rows
    placed, read = predict_registered(model, arm, rows.states, rows.position)
    tcp = ArmStates(arm, placed.on_probes(rows.states)).walk.tcp
    left = placed.to_base(rows.position) - tcp - read.error
    yield told(fitted.name, series.name, Outcome(left, read.std))


def loaded(shared: Path, folder: Path) -> dict[str, Series]:
    """Read all series; the UR5's arm file is written to a folder."""
    (folder / "ur10.toml").write_text('[robot]\narm = "ur10"\n')
    (folder / "ur5arm.toml").write_text(UR5)
    (folder / "ur5.toml").write_text('[robot]\narm = "ur5arm.toml"\n')
    found = {}
    for name, file in (
        ("A", "grid"),
        ("B", "joint_configurations"),
        ("D", "iso_cubes"),
    ):
        path = shared / "data" / "ipa-ur10" / f"measurements_{file}.csv"
        found[name] = _series(f"UR10 {name}", path, folder / "ur10.toml")
    for name in ("grid", "random"):
        path = _difference(shared / "data" / "ur5" / f"{name}.csv", folder)
        found[name] = _series(f"UR5 {name}", path, folder / "ur5.toml")
    return found


def _series(name: str, path: Path, cell_path: Path) -> Series:
    cell = load_cell(cell_path)
    rows = read_survey_file(path, cell.arm, cell.probes, reading=TableFormat())
    return Series(name, rows, cell)


def _difference(path: Path, folder: Path) -> Path:
    """Write the UR5's readings: target less difference, the sign that fits better."""
    import pandas as pd

    given = pd.read_csv(path)
    ours = {"id": given["step_order"]}
    ours |= {f"q{j}_deg": given[f"joint_{j}"] for j in range(1, 7)}
    ours |= {f"{a}_mm": given[f"{a}_t"] - given[f"{a}_dif"] for a in "xyz"}
    pd.DataFrame(ours).to_csv(folder / path.name, index=False)
    return folder / path.name


def main() -> None:
    """Run the study and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    default = os.environ.get("POSTPROC_SHARED", "../shared")
    parser.add_argument("--shared", type=Path, default=Path(default))
    given = parser.parse_args()
    lines = TEXT.format(n=given.seeds).splitlines()
    with tempfile.TemporaryDirectory() as name:
        try:
            data = loaded(given.shared, Path(name))
        except PostprocError as exc:  # the data are not there
            raise SystemExit(f"not run: {exc}") from None
        lines += study(data, given.seeds)
    OUT.write_text("\n".join([*lines, ""]))


def study(data: dict[str, Series], seeds: int) -> list[str]:
    """Run both parts, and print rows as they come."""
    lines = ["## Rows of the same series", "", *HEAD]
    for name in ("B", "grid", "D"):
        lines += map(_shown, pooled(data[name], seeds))
    # Every fit of A's 8,300 rows takes half a minute: one split, one frame.
    lines += map(_shown, pooled(data["A"], seeds, SPLITS[:1], FRAMES[:1]))
    lines += [*LATER.splitlines(), *BETWEEN]
    for name in ("B", "grid", "D", "A"):
        lines += map(_shown, last_quarter(data[name]))
    for fitted, other in (("B", "D"), ("D", "B"), ("B", "A"), ("grid", "random")):
        lines += map(_shown, another(data[fitted], data[other]))
    return lines


def _shown(line: str) -> str:
    print(line, flush=True)
    return line


if __name__ == "__main__":
    main()
