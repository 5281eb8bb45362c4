"""What reversals of a survey say of gears of four kinds.

    python docs/studies/reversals.py [--seeds 100 119] [--reversals 4]

Every virtual arm is surveyed at 300 poses from both sides, with reversals, and a model
of what all of them have is fitted. Of its joints is counted how many are called sharp,
elastic, or not sure.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from pathlib import Path

import paths

from postproc.calibration.fit import fit
from postproc.model.effects import BASE_EFFECTS
from postproc.model.flank_hypotheses import verdict_of
from postproc.robot.cell import load_cell
from postproc.simulation.arm import GearKind


def verdicts(folder: Path, seed: int, gears: str, count: int) -> tuple[str, ...]:
    """Survey an arm, fit it, and say what its reversals say of joints 1 to 6."""
    place, program, rows = (folder / n for n in ("cell.toml", "s.pdl", "s.csv"))
    place.write_text(paths.CELL)
    at = ("--cell", place)
    paths.done("survey", *at, "--set", f"survey.reversals={count}", "-o", program)
    paths.done(
        "simulate",
        program,
        *at,
        "--set",
        f"simulation.seed={seed}",
        "--set",
        f"simulation.backlash_model={gears}",
        "-o",
        rows,
    )
    cell = load_cell(place)
    model = fit(rows, cell=cell, effects=BASE_EFFECTS).model
    return tuple(map(verdict_of, model.flank_widths))


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(100, 119))
    parser.add_argument("--reversals", type=int, default=4)
    given = parser.parse_args()
    first, last = given.seeds
    print("| gears | joint | sharp | elastic | uncertain |\n|---|---|---|---|---|")
    for kind in GearKind:
        said = []
        for seed in range(first, last + 1):
            with tempfile.TemporaryDirectory() as folder:
                found = verdicts(Path(folder), seed, kind.value, given.reversals)
            said.append(found)
        for joint, own in enumerate(zip(*said, strict=True), start=1):
            count = Counter(own)
            told = (count["sharp"], count["elastic"])
            told = (*told, len(own) - sum(told))
            print(
                f"| {kind.value} | {joint} | {' | '.join(map(str, told))} |", flush=True
            )


if __name__ == "__main__":
    main()
