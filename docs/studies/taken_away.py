"""Take a kind of effect out of a model of a real arm; let `diagnose` find it.

PYTHONPATH=. python docs/studies/taken_away.py DATA

Rows of a series are cut into blocks of consecutive rows, which are dealt to three
parts. The first is fitted, with the effects that the default fit finds in it but for
one kind (and but for the functions without a law, which would hold a part of it). The
second is what `diagnose` is given. The third is what nothing has seen: errors before
and after are those of its rows.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from data_sets import DataSet, descriptions, read_set
from numpy.typing import NDArray

from postproc.calibration.diagnosis.diagnose import extend_model
from postproc.calibration.fit import fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.model.effects.placement import Placement
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.model.statistics import ErrorStatistics

KINDS = {
    "compliance": ("compliance", "bending", "base_tilt", "counterbalance"),
    "waves": ("transmission", "drive_transmission"),
    "backlash": ("backlash", "backlash_profile", "load_backlash", "drive_backlash"),
}
FREE = ("joint_spline", "joint_map", "part_motion", "curve", "elm_map")
BLOCK = 20  # consecutive rows
MOST = 900  # rows of a part


def parts_of(rows: Measurements, seed: int) -> list[Measurements]:
    """Deal blocks of rows to three parts."""
    block = np.arange(len(rows)) // BLOCK
    dealt = np.random.default_rng(seed).permutation(block.max() + 1) % 3
    return [rows[np.flatnonzero(dealt[block] == k)[:MOST]] for k in range(3)]


def left(model: Model, data: DataSet, rows: Measurements) -> ErrorStatistics:
    """Return what a model leaves of readings of its own set-up."""
    return ErrorStatistics.of(residual(model, data, rows))


def residual(model: Model, data: DataSet, rows: Measurements) -> NDArray[np.float64]:
    """Return residuals of readings of the model's own set-up, (n, 3) [m]."""
    arm, placed = data.cell.arm, model.registration
    states = rows.states if placed is None else placed.on_probes(rows.states)
    position = rows.position if placed is None else placed.to_base(rows.position)
    read = model.reading(arm, states)
    return position - ArmStates(arm, states).walk.tcp - read.error


def trial(
    data: DataSet, series: str, kind: str, seed: int
) -> tuple[ErrorStatistics, ErrorStatistics, ErrorStatistics, str]:
    """Take a kind away; return errors before, after, of the whole model, and words."""
    first, fresh, unseen = parts_of(data.series[series], seed)
    how = {"frame": data.about.frame, "validate": False}
    whole = fit_measurements(first, data.cell, **how)
    names = dict.fromkeys(e.name for e in whole.model.effects.effects)
    kept = [n for n in names if n not in (*KINDS[kind], *FREE, Placement.name)]
    less = fit_measurements(first, data.cell, effects=kept, **how).model
    placed = less.registration
    known = fresh
    if placed is not None:
        known = replace(
            fresh,
            states=placed.on_probes(fresh.states),
            position=placed.to_base(fresh.position),
        )
    found = extend_model(
        known, data.cell.arm, less,
        tracker=None if placed is None else placed.tracker,
        setup=() if placed is None else (Placement.name,),
    )  # fmt: skip
    better = replace(found.model, registration=placed)
    return (
        left(less, data, unseen), left(better, data, unseen),
        left(whole.model, data, unseen), found.diagnosis.story(),
    )  # fmt: skip


def lines(
    data: DataSet, seeds: int, only: list[str] | None, kinds: Sequence[str]
) -> Iterator[str]:
    """Write a line for every series, kind and seed."""
    for series in only or data.series:
        if series not in data.series:
            continue
        for kind in kinds:
            for seed in range(seeds):
                before, after, whole, story = trial(data, series, kind, seed)
                yield (
                    f"| {data.about.name} {series} | {kind} | {before.mean_mm:.4f} | "
                    f"{after.mean_mm:.4f} | {whole.mean_mm:.4f} | {story} |"
                )


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--series", nargs="+", help="names of series; all without it")
    asked = parser.parse_args()
    print("| rows | removed | before mm | after mm | whole fit mm | story |")
    print("|---|---|---|---|---|---|")
    for path, base in descriptions(asked.data):
        data = read_set(path, base)
        if data is None:
            continue
        for line in lines(data, asked.seeds, asked.series, asked.kinds):
            print(line, flush=True)


if __name__ == "__main__":
    main()
