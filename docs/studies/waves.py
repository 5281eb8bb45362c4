"""Tell the waves that the maps of real arms' joints hold: order, size, and how sure.

PYTHONPATH=. python docs/studies/waves.py DATA [--only UR10]

Fits and looks at the rows only that the first random split of every series fits; rows
that are tested are not read.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from data_sets import DataSet, Split, descriptions
from real_arms import DEFAULT, fitted, read_once

from postproc.calibration.diagnosis.library import Library, Projection
from postproc.calibration.diagnosis.refit import refit
from postproc.calibration.diagnosis.score import bootstrap
from postproc.calibration.diagnosis.search import Search
from postproc.calibration.diagnosis.waves import name_waves
from postproc.model.effects.placement import Placement


def found_in(data: DataSet, split: Split) -> Search:
    """Fit the rows of a split's first draw, and name the waves in what was fitted."""
    rows = data.series[split.fit][split.draws[0][0]]
    calibration = fitted(data, rows, DEFAULT)
    placed = calibration.model.registration
    tracker = data.cell.tracker if placed is None else placed.tracker
    setup = () if placed is None else (Placement.name,)
    survey, arm = calibration.survey, data.cell.arm
    base = refit(survey, arm, calibration.model, tracker, setup)
    library = Library.of(base)
    null = bootstrap(Projection.of(base), library, 0)
    return name_waves(Search(base, base, library, (), null, None))


def told(found: Search) -> Iterator[str]:
    """Write a row for every wave, by joint and order."""
    rows = []
    for k, addition in enumerate(found.additions):
        fit, place = found.fit, found.place(k)
        effect, part = addition.candidate.effect, fit.combination.slices[place]
        size = effect.amplitude(fit.values[part], fit.covariance[part, part])
        assert size is not None
        peak = float(np.linalg.norm(fit.moved(part), axis=1).max())
        joint, order = addition.candidate.family.joint, effect.nonlinear()["order"][0]
        rows.append((joint, order, *size, peak, addition.score.evidence))
    for joint, order, size, error, peak, evidence in sorted(rows):
        yield (
            f"| {joint} | {order:.4g} | {size * 1e3:.4f} +- {error * 1e3:.4f} "
            f"| {peak * 1e3:.3f} | {evidence:.0f} |"
        )


def main() -> None:
    """Print a table for every series that has a random split."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", default="", help="name of one data set")
    given = parser.parse_args()
    for path, base in descriptions(given.data):
        data = read_once(path, base)
        if data is None or given.only not in data.about.name:
            continue
        for split in (s for s in data.splits if "random" in s.title and s.same):
            began = time.process_time()
            found = found_in(data, split)
            seconds = time.process_time() - began
            where = f"{data.about.name} {split.fit}, {len(found.base.batch)} rows"
            print(f"\n{where}, {seconds:.0f} s\n")
            print("| joint | order | mrad | peak mm | nats |\n|---|---|---|---|---|")
            print("\n".join(told(found)), flush=True)


if __name__ == "__main__":
    main()
