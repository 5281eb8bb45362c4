"""Fit small campaigns of real arms, by default and by geometry and backlash alone.

PYTHONPATH=. python docs/studies/small_campaigns.py DATA [--draws 4]

Of every series, campaigns of 20, 40, 60 and 100 poses are drawn at random. Both fits
of a campaign are tested on the same other rows of its series. Printed are mean errors,
how much more the default leaves (the mean of paired differences of rows, over the mean
error of the other fit), and the upper end of the 95 % interval of that: campaigns are
drawn again with replacement, and rows within them.
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from data_sets import DataSet, descriptions, read_set
from numpy.typing import NDArray
from taken_away import residual

from postproc.calibration.fit import fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.exceptions import PostprocError

POSES = (20, 40, 60, 100)
TESTED, LEAST = 400, 100  # rows, at most and at least
SIMPLE = ("geometry", "backlash")
DRAWS = 4000  # of the bootstrap


@dataclass(frozen=True)
class Pair:
    """Errors of the same rows after both fits, (n,) [mm].

    Attributes:
        poses: How many were fitted.
        default, simple: Errors.
    """

    poses: int
    default: NDArray[np.float64]
    simple: NDArray[np.float64]


def pair(data: DataSet, series: str, poses: int, seed: int) -> Pair | str:
    """Fit one campaign twice; return what fits say where they write no model."""
    rows = data.series[series]
    rng = np.random.default_rng([zlib.crc32(series.encode()), poses, seed])
    drawn = rng.permutation(len(rows))
    fitted = rows[np.sort(drawn[:poses])]
    others = rows[np.sort(drawn[poses : poses + TESTED])]
    try:
        return Pair(
            poses,
            errors(data, fitted, others, None),
            errors(data, fitted, others, SIMPLE),
        )
    except PostprocError as e:
        return str(e).splitlines()[0]


def errors(
    data: DataSet,
    fitted: Measurements,
    others: Measurements,
    effects: Sequence[str] | None,
) -> NDArray[np.float64]:
    """Fit, and return the errors of other rows, (n,) [mm]."""
    report = fit_measurements(
        fitted, data.cell, frame=data.about.frame, effects=effects
    )
    return 1e3 * np.linalg.norm(residual(report.model, data, others), axis=1)


def more(pairs: Sequence[Pair]) -> tuple[float, float]:
    """Return how much more the default leaves, and its upper bound at 95 %, shares."""
    rng = np.random.default_rng(0)
    every = [(p.default - p.simple, p.simple) for p in pairs]
    drawn = [
        share([again(every[k], rng) for k in rng.integers(len(every), size=len(every))])
        for _ in range(DRAWS)
    ]
    return share(every), float(np.quantile(drawn, 0.975))


def again(
    one: tuple[NDArray[np.float64], NDArray[np.float64]], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw rows with replacement."""
    rows = rng.integers(len(one[0]), size=len(one[0]))
    return one[0][rows], one[1][rows]


def share(
    every: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> float:
    """Return summed differences over summed errors."""
    return float(sum(d.sum() for d, _ in every) / sum(e.sum() for _, e in every))


def line(name: str, pairs: Sequence[Pair]) -> str:
    """Write a line of the table."""
    most, bound = more(pairs)
    default, simple = (
        np.mean([getattr(p, kind).mean() for p in pairs])
        for kind in ("default", "simple")
    )
    worse = sum(p.default.mean() > 1.02 * p.simple.mean() for p in pairs)
    return (
        f"| {name} | {len(pairs)} | {default:.3f} | {simple:.3f} | "
        f"{most:+.1%} | {bound:+.1%} | {worse} |"
    )


def campaigns(data: DataSet, draws: int) -> Iterator[list[Pair]]:
    """Fit all campaigns of a set, and print a line for each series and size."""
    for series in data.series:
        for poses in POSES:
            if len(data.series[series]) < poses + LEAST:
                continue
            found = [pair(data, series, poses, seed) for seed in range(draws)]
            pairs = [p for p in found if isinstance(p, Pair)]
            if pairs:
                print(line(f"{data.about.name} {series}, {poses}", pairs), flush=True)
            for refused in (p for p in found if isinstance(p, str)):
                print(f"<!-- {data.about.name} {series}, {poses}: {refused} -->")
            yield pairs


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--draws", type=int, default=4)
    asked = parser.parse_args()
    print(
        "| campaigns, poses | n | default, mm | `geometry,backlash`, mm | more | "
        "upper bound | worse by 2 % |"
    )
    print("|---|---|---|---|---|---|---|")
    every: list[Pair] = []
    for path, base in descriptions(asked.data):
        data = read_set(path, base)
        if data is None:
            continue
        every += [p for pairs in campaigns(data, asked.draws) for p in pairs]
    print(line("all", every))


if __name__ == "__main__":
    main()
