"""Weigh compliance of joints 2 and 3 of a real arm beside shapes of their angles.

PYTHONPATH=.:docs/studies python docs/studies/softness.py DATA --series grid

Compliance is added to fits with more and more that follows the joints' own angles.
Printed is what it is worth beside each, and the softness of both joints.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from data_sets import DataSet, descriptions, read_set

from postproc.calibration.fit import fit_measurements
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effects import propose
from postproc.model.effects.compliance import Compliance
from postproc.model.kinematics import ArmStates

BASE = ("geometry", "backlash", "registration", "tracker_drift")
BESIDE = (
    (),
    ("transmission",),
    ("coupling", "transmission"),
    ("coupling", "transmission", "joint_spline"),
)
JOINTS, MOST = (2, 3), 1000


def lines(data: DataSet, series: str) -> Iterator[str]:
    """Write a line for every model that compliance is added to."""
    rows = data.series[series][np.arange(min(MOST, len(data.series[series])))]
    first = fit_measurements(
        rows, data.cell, frame=data.about.frame, validate=False,
        effects=["geometry", "backlash", "tracker_drift"],
    )  # fmt: skip
    placed = first.model.registration
    assert placed is not None, "a series in the frame of its tracker"
    states, position = placed.on_probes(rows.states), placed.to_base(rows.position)
    batch = ArmStates(data.cell.arm, states)
    laws = [p for p in Compliance.on(batch).pieces() if p.joints[0] in JOINTS]
    least: float | None = None
    for more in BESIDE:
        own = propose((*BASE, *more), data.cell.arm, states)
        without = fit_effects(batch, position, own, None)
        with_ = fit_effects(batch, position, (*own, *laws), None)
        least = without.log_evidence if least is None else least
        yield (
            f"| {data.about.name} {series} | {', '.join(more) or '-'} | "
            f"{without.log_evidence - least:.0f} | "
            f"{with_.log_evidence - without.log_evidence:.0f} | {softness(with_)} |"
        )


def softness(fit: Fit) -> str:
    """Write the softness of the joints."""
    names = fit.combination.names
    at = [names.index(f"{Compliance.name}.k{j}") for j in JOINTS]
    return ", ".join(f"{fit.values[k] * 1e6:.1f} +- {fit.std[k] * 1e6:.1f}" for k in at)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--series", nargs="+", default=["grid"])
    asked = parser.parse_args()
    print("| rows | besides | worth [nats] | compliance | k2, k3 [urad/(N m)] |")
    print("|---|---|---|---|---|")
    for path, base in descriptions(asked.data):
        data = read_set(path, base)
        for series in asked.series:
            if data is not None and series in data.series:
                for line in lines(data, series):
                    print(line, flush=True)


if __name__ == "__main__":
    main()
