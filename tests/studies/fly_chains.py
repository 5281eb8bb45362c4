"""Points in chains of fly points, as in milling, sealing and trimming.

    python -m tests.studies.fly_chains [--seeds 400 401] [--chains 4] [--folder PLACE]

A chain is lines of 150 to 350 mm at 50 mm/s that turn by up to 60 degrees at fly
points, with zones of 5 mm (`cart`) or by overlap (`norm`). Arms, surveys and rows are
those of `tests.studies.wide_gaps`, after a survey with reversals.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np

from docs.studies import paths as study
from postproc.compensation.program import plan_visits, read_program
from postproc.robot.cell import Cell, load_cell
from postproc.simulation import draw
from tests.studies.wide_gaps import Bench, gaps_between, row

HALF = 0.01, 0.1  # [mrad]
LINES = 8  # of a chain
FLY = {
    "cart": ("  $FLY_TYPE := FLY_CART", "  $FLY_TRAJ := FLY_FROM", "  $FLY_DIST := 5"),
    "norm": ("  $FLY_TYPE := FLY_NORM", "  $FLY_PER := 100"),
}


def chain(rng: np.random.Generator, cell: Cell) -> list[str]:
    """Draw a chain: a joint move to where it begins, and lines in a plane."""
    q = study.CENTRE + rng.uniform(-1, 1, 6) * study.SPREAD / 2
    pose = cell.arm.flange(q[None])[0] @ cell.tool.pose
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moves, angle = [f"  MOVE JOINT TO {study.pos(pose)}"], rng.uniform(0, 2 * np.pi)
    for k in range(LINES):
        size = rng.uniform(0.15, 0.35)
        pose = pose.copy()
        pose[:3, 3] += size * (np.cos(angle) * axes[0] + np.sin(angle) * axes[1])
        angle += np.radians(rng.uniform(-60, 60))
        verb = "MOVEFLY" if k < LINES - 1 else "MOVE"
        end = " ADVANCE" if k < LINES - 1 else ""
        moves.append(f"  {verb} LINEAR TO {study.pos(pose)}{end}")
    return moves


def job(seed: int, cell: Cell, chains: int, fly: str) -> str:
    """Write chains that the arm can follow."""
    rng, kept = np.random.default_rng(seed), list(FLY[fly])
    while chains:
        moves = chain(rng, cell)
        text = study.written([*FLY[fly], *moves])
        visits = read_program({"job.pdl": text.encode()}, cell).visits
        if not plan_visits(visits, cell).plan.reason.any():
            kept += moves
            chains -= 1
    return study.written(kept)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(400, 401))
    parser.add_argument("--chains", type=int, default=4)
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as temporary,
        patch.object(draw, "backlash", gaps_between(*HALF)),
    ):
        for seed in range(given.seeds[0], given.seeds[1] + 1):
            place = (given.folder or Path(temporary)) / f"{seed}"
            bench = Bench(seed, place, 1, "sharp")
            for fly in FLY:
                text = job(seed, load_cell(bench.cell), given.chains, fly)
                (place / "job.pdl").write_text(text)
                print(fly, end=" ")
                row(bench, "reversals", "0.1")


if __name__ == "__main__":
    main()
