"""Tell the waves of gears that a fit names on real arms: order, size, and how sure.

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
from data_sets import descriptions
from real_arms import DEFAULT, fitted, read_once

from postproc.calibration.fit import Calibration
from postproc.model.effect_sum import Combination
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm


def told(found: Calibration, arm: Arm) -> Iterator[str]:
    """Write a row for every wave, by joint and order."""
    rows, model = [], found.model
    batch = ArmStates(arm, found.survey.states)
    for effect, part in zip(model.effects.effects, model.effects.slices, strict=True):
        values = model.values[part]
        size = effect.amplitude(values, model.covariance[part, part])
        if size is None:
            continue
        moved = Combination((effect,)).error(batch, values)
        peak = float(np.linalg.norm(moved, axis=1).max())
        (joint,) = {p.joint for p in effect.parameters()}
        rows.append((joint, effect.nonlinear()["order"][0], *size, peak))
    for joint, order, size, error, peak in sorted(rows):
        yield (
            f"| {joint} | {order:.4g} | {size * 1e3:.4f} +- {error * 1e3:.4f} "
            f"| {peak * 1e3:.3f} |"
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
            rows = data.series[split.fit][split.draws[0][0]]
            found = fitted(data, rows, DEFAULT)
            seconds = time.process_time() - began
            where = f"{data.about.name} {split.fit}, {len(rows)} rows"
            print(f"\n{where}, {seconds:.0f} s\n")
            print("| joint | order | mrad | peak mm |\n|---|---|---|---|")
            print("\n".join(told(found, data.cell.arm)), flush=True)


if __name__ == "__main__":
    main()
