"""Where the points of a milled path land: thousands of fly points, and reversals.

    python -m tests.studies.milled_points [--seeds 720 723] [--points 3000]

Points 2 mm apart in rows there and back, as one fly run without a stop: every row has
places where a joint reverses, and its link crosses its gap while the tool goes on. Each
virtual arm is surveyed and fitted as in the demo. Printed is the true error of its fly
points [mm]: of one in two, in ten, in thirty, in a hundred, and the largest.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from postproc.report.simulation import setup_of, visits_of
from postproc.robot.cell import load_cell
from postproc.robot.pose import MM
from postproc.simulation import virtual_arm
from postproc.simulation.program import land
from tests.bench.__main__ import CELL
from tests.bench.made import unbroken
from tests.studies.wide_gaps import done

SHARES = (0.5, 0.9, 0.97, 0.99, 1.0)


def errors(seed: int, points: int, folder: Path) -> np.ndarray:
    """Return the true errors of the fly points on an arm, (n,) [m]."""
    at, arm = ("--cell", CELL), ("--set", f"simulation.seed={seed}")
    survey, model = folder / "survey.pdl", folder / "model.json"
    done("survey", *at, "-o", survey)
    done("simulate", survey, *at, *arm, "-o", survey.with_suffix(".csv"))
    done("fit", survey.with_suffix(".csv"), *at, "-o", model)
    job, out = folder / "job.pdl", folder / "out.pdl"
    job.write_bytes(unbroken(points).source)
    done("compensate", job, *at, "--model", model, "-o", out,
         "--set", "compensation.timing=false")  # fmt: skip
    cell = load_cell(CELL)
    setup = setup_of(cell)
    drawn = virtual_arm(seed, chain=setup.chain, coupling=setup.coupling)
    original, executed = (visits_of(path, cell) for path in (job, out))
    found = land(drawn, setup, original, executed)
    flown = original.motion.fly[found.visit]
    return np.asarray(np.linalg.norm(found.error[flown], axis=1))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(720, 723))
    parser.add_argument("--points", type=int, default=3000)
    given = parser.parse_args()
    print("arm", *(f"{share:.0%}" for share in SHARES), sep="\t")
    for seed in range(given.seeds[0], given.seeds[1] + 1):
        with tempfile.TemporaryDirectory() as folder:
            size = errors(seed, given.points, Path(folder)) / MM
        told = (f"{value:.3f}" for value in np.quantile(size, SHARES))
        print(seed, *told, sep="\t", flush=True)


if __name__ == "__main__":
    main()
