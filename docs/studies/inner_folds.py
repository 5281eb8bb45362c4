"""How the default fit carries over, judged on rows that splits of real arms fit.

PYTHONPATH=. python docs/studies/inner_folds.py DATA [--of UR10:B]

No tested row of a series' first split is looked at. Regions, ends and thirds are
registered anew by nine numbers, as another campaign is.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from data_sets import BLOCKS, DataSet, Rows, descriptions, read_set
from real_arms import DEFAULT, Outcome, fitted, judge
from scipy.cluster.vq import kmeans2

from postproc.calibration.measurements import Measurements

FOLDS = 4
KINDS = ("random", "blocks", "regions", "ends", "thirds")
SAME_SET_UP = ("random", "blocks")
SERIES = ("UR10:B", "UR10:D", "UR5:grid")
END = 0.3  # share of the rows at either end of joint 1


def labels(rows: Measurements, kind: str) -> tuple[Rows, int]:
    """Say in which fold every row is, and how many folds are judged."""
    n, q = len(rows), rows.states.q
    rng, place = np.random.default_rng(0), np.arange(n)
    if kind == "random":
        return rng.permutation(n) % FOLDS, FOLDS
    if kind == "blocks":
        return rng.permutation(BLOCKS)[place * BLOCKS // n] % FOLDS, FOLDS
    if kind == "regions":
        z = (q - q.mean(axis=0)) / q.std(axis=0)
        return kmeans2(z, FOLDS, seed=0, minit="++")[1], FOLDS
    if kind == "ends":
        rank = np.argsort(np.argsort(q[:, 0])) / n
        return np.where(rank < END, 0, np.where(rank > 1.0 - END, 1, 2)), 2
    return place * 3 // n, 3


def folded(data: DataSet, rows: Measurements, kind: str) -> Outcome:
    """Fit all folds but one, and judge that one, in turn."""
    label, count = labels(rows, kind)
    same, found = kind in SAME_SET_UP, []
    for fold in range(count):
        inside, held = np.flatnonzero(label != fold), np.flatnonzero(label == fold)
        model = fitted(data, rows[inside], DEFAULT).model
        found.append(judge(model, data, rows[held], same))
    left, std = (
        np.concatenate([getattr(o, k) for o in found]) for k in ("left", "std")
    )
    return Outcome(left, std)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the data")
    parser.add_argument("--of", nargs="+", default=SERIES, help="SET:SERIES ..")
    given = parser.parse_args()
    sets = [read_set(*at) for at in descriptions(given.data)]
    print("| rows | mean | 95 % | max | intervals hold | rows judged |")
    print("|---|---|---|---|---|---|")
    for data in (d for d in sets if d is not None):
        for name, series in data.series.items():
            if f"{data.about.name}:{name}" not in given.of:
                continue
            split = next(s for s in data.splits if s.fit == name)
            rows = series[split.draws[0][0]]
            for kind in KINDS:
                outcome = folded(data, rows, kind)
                print(outcome.row(f"{data.about.name} {name}, {kind}"), flush=True)


if __name__ == "__main__":
    main()
