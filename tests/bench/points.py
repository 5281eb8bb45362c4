"""What points on the ways of a long program cost: one program with and without them.

    python -m tests.bench.points [--moves 2500] [--rounds 1] [--folder PLACE]

A job of lines of 300 to 900 mm between stops, two targets a line, of development arm
400 surveyed with reversals, is compensated at its targets and with `--path-tolerance
0.1`, in one process, in turn. The least processor time of the rounds counts, and the
stages of both are printed. `--max-inserted` allows as many points as moves need.
"""

from __future__ import annotations

import argparse
import hashlib
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Outcome
from postproc.simulation import draw
from tests.studies.wide_gaps import Bench, gaps_between

ARM = 400  # a development arm
HALF = 0.01, 0.1  # [mrad] between which its half gaps are drawn
TOLERANCE = 0.1  # [mm]


def bench_of(folder: Path, moves: int) -> tuple[Bench, Path]:
    """Draw the job of the arm, and fit its model; both once a folder."""
    with patch.object(draw, "backlash", gaps_between(*HALF)):
        bench = Bench(ARM, folder / f"{moves}", moves, "sharp")
        return bench, bench.model("reversals")


def measure(bench: Bench, model: Path, options: Options) -> tuple[float, Outcome]:
    """Compensate the job; return the processor time [s] as well."""
    begin = time.process_time()
    found = compensate(bench.folder / "job.pdl", bench.cell, model, options=options)
    return time.process_time() - begin, found


def describe(name: str, seconds: float, found: Outcome) -> str:
    """Say in one line what a run took, and what came out."""
    stages = ", ".join(f"{key} {value:.1f}" for key, value in found.stages.items())
    inserted = found.in_time.inserted if found.in_time else None
    points = (
        f"{inserted.count} points in {len(inserted.points)} moves" if inserted else ""
    )
    digest = hashlib.sha256(b"".join(found.outputs.values())).hexdigest()[:12]
    return f"{name:8} {seconds:6.1f} s {points} bytes {digest} ({stages})"


def main() -> None:
    """Print both runs, and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=2500)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--max-inserted", type=int, default=1000)
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    wanted = {
        "without": Options(timing=True),
        "points": Options(path_tolerance_mm=TOLERANCE, max_inserted=given.max_inserted),
    }
    with tempfile.TemporaryDirectory() as temporary:
        bench, model = bench_of(given.folder or Path(temporary), given.moves)
        least = dict.fromkeys(wanted, float("inf"))
        for _ in range(given.rounds):
            for name, options in wanted.items():
                seconds, found = measure(bench, model, options)
                least[name] = min(least[name], seconds)
                print(describe(name, seconds, found), flush=True)
    print(f"points take {least['points'] / least['without']:.2f} times as long")


if __name__ == "__main__":
    main()
