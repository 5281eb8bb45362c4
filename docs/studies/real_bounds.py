"""How many readings of real arms are within the bound of a true error.

    PYTHONPATH=. python docs/studies/real_bounds.py [--seeds 5] [--shared ../shared]

A fit of some rows predicts the others: 30 % of the poses, 9 of 30 blocks of consecutive
rows, or each of six regions of joint space. All rows of a pose are on one side. The
first columns count readings whose states the model calls surveyed; others never get the
verdict *pass*. real-bounds.md has the results.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from intervals import Series, blocks, loaded, predict_rows, random_rows

from postproc.calibration.cross_validation import regions_of
from postproc.compensation.solver.expected_error import LengthLaw
from postproc.exceptions import PostprocError

HEAD = [
    "| rows | split | readings | within the bound | quarters | outside of the survey "
    "| at least, at most | mean error mm | mean bound mm |",
    "|---|---|---|---|---|---|---|---|---|",
]


@dataclass(frozen=True)
class Held:
    """Lengths of errors of readings that no fit has seen, and their bounds [m].

    Attributes:
        size, bound: Of n readings.
        outside: Which states the model calls outside of what was surveyed.
    """

    size: np.ndarray
    bound: np.ndarray
    outside: np.ndarray

    @property
    def share(self) -> float:
        """Share of the readings within their bounds [%]."""
        return 100.0 * float((self.size <= self.bound).mean())

    def quarters(self) -> str:
        """Write the shares by quarter of the bound."""
        cuts = np.quantile(self.bound, [0.25, 0.5, 0.75])
        own = np.searchsorted(cuts, self.bound)
        return ", ".join(f"{self.take(own == k).share:.1f}" for k in range(4))

    def take(self, rows: np.ndarray) -> Held:
        """Take some of the readings."""
        return Held(self.size[rows], self.bound[rows], self.outside[rows])


def judge(series: Series, test: np.ndarray) -> Held:
    """Predict some rows by a fit of all others."""
    left, read, outside = predict_rows(series, test, "tracker")
    law = LengthLaw.of_normal(np.zeros_like(left), read.covariance)
    return Held(np.linalg.norm(left, axis=1), law.bound, outside)


def by_pose(series: Series, test: np.ndarray) -> np.ndarray:
    """Keep whole poses: all rows of those that the drawn rows begin with."""
    pose = np.unique(np.round(series.rows.states.q, 4), axis=0, return_inverse=True)[1]
    pose = pose.reshape(-1)
    return np.flatnonzero(np.isin(pose, pose[test]))


def splits(series: Series, seeds: int) -> Iterator[tuple[str, list[np.ndarray]]]:
    """List the rows that are held out, split by split."""
    draws: dict[str, Callable[[int, int], np.ndarray]] = {
        "random": random_rows,
        "blocks": blocks,
    }
    for name, draw in draws.items():
        drawn = (draw(len(series.rows), seed) for seed in range(seeds))
        yield name, [by_pose(series, rows) for rows in drawn]
    region = regions_of(series.rows.states)
    yield "regions", [np.flatnonzero(region == k) for k in np.unique(region)]


def report(series: Series, seeds: int) -> Iterator[str]:
    """Judge a series by every split."""
    for name, tests in splits(series, seeds):
        found = [judge(series, test) for test in tests]
        columns = ("size", "bound", "outside")
        every = Held(
            *(np.concatenate([vars(one)[k] for one in found]) for k in columns)
        )
        shares = [one.share for one in found]
        inside, out = every.take(~every.outside), every.take(every.outside)
        apart = f"{out.share:.1f} % of {len(out.size)}" if len(out.size) else "none"
        yield (
            f"| {series.name} | {name} | {len(inside.size)} | {inside.share:.1f} % "
            f"| {inside.quarters()} | {apart} "
            f"| {min(shares):.1f} to {max(shares):.1f} % "
            f"| {every.size.mean() * 1e3:.3f} | {every.bound.mean() * 1e3:.3f} |"
        )


def main() -> None:
    """Run the study and print its rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    default = os.environ.get("POSTPROC_SHARED", "../shared")
    parser.add_argument("--shared", type=Path, default=Path(default))
    parser.add_argument("--only", nargs="*", help="series: A, B, D, grid")
    given = parser.parse_args()
    print(*HEAD, sep="\n")
    with tempfile.TemporaryDirectory() as folder:
        try:
            data = loaded(given.shared, Path(folder))
        except PostprocError as exc:  # the data are not there
            raise SystemExit(f"not run: {exc}") from None
        for name in given.only or ("D", "grid", "B"):
            for line in report(data[name], given.seeds):
                print(line, flush=True)


if __name__ == "__main__":
    main()
