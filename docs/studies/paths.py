"""How well compensated programs keep to their paths, and how well that is predicted.

    python docs/studies/paths.py [--seeds 41 45]

For each virtual arm: a survey of 300 poses from both sides, a model, a job of 40 lines
of 300 to 900 mm and 20 arcs with stops and random approaches at 50 mm/s anywhere in
front of the arm, compensated at its targets; the arm then runs both programs, and its
paths are compared every millimetre with those that were asked for.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from postproc.compensation.program import plan_visits, read_program
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import record_from_pose

CELL = """
[robot]
arm = "nj220-2.7"
absolute_accuracy = false
[tool]
xyz_mm = [100.0, 50.0, 200.0]
source = "tracker"
[payload]
mass_kg = 90.0
com_mm = [0.0, 0.0, 200.0]
[tracker]
xyz_mm = [3000.0, -2000.0, 1500.0]
[survey]
points_mm = [[-212.5, 96.0, 331.0], [148.0, -121.5, 268.0], [-58.0, 42.5, 514.0]]
"""
LINES, ARCS = 40, 20
PROGRAMS: dict[str, tuple[str, ...]] = {
    "job": (),
    "plain": (),
    "points": ("--path-mm", "0.1"),
    "stops": ("--path-mm", "0.1", "--take-up"),
}
STATES = {
    "job": "as written",
    "plain": "compensated",
    "points": "with points",
    "stops": "with points and stops",
}
RUN = "from postproc.cli import main; main()"
START = (
    "  MOVE JOINT TO {4.0, -6.0, -84.0, 9.0, 53.0, -12.0}",
    "  MOVE JOINT TO {0.0, 0.0, -90.0, 0.0, 60.0, 0.0}",
    "  $LIN_SPD := 0.05",
)
CENTRE = np.radians([0.0, 10.0, -100.0, 0.0, 60.0, 0.0])
SPREAD = np.radians([45.0, 25.0, 25.0, 60.0, 35.0, 60.0])


def written(moves: list[str]) -> str:
    """Write a program of these moves."""
    return "\n".join(["PROGRAM job", "BEGIN", *START, *moves, "END job", ""])


def pos(pose: np.ndarray) -> str:
    """Write a pose as a literal."""
    return f"POS({', '.join(f'{v:.4f}' for v in record_from_pose(pose))}, '')"


def draw(rng: np.random.Generator, cell: Cell, arc: bool) -> list[str]:
    """Draw a move to a place, and a line or an arc from there."""
    q = CENTRE + rng.uniform(-1, 1, 6) * SPREAD
    begin = cell.arm.flange(q[None])[0] @ cell.tool.pose
    way = rng.normal(size=3)
    way *= rng.uniform(0.3, 0.9) / np.linalg.norm(way)
    end, via = begin.copy(), begin.copy()
    end[:3, 3] += way
    via[:3, 3] += way / 2 + np.cross(way, rng.normal(size=3)) / 4
    on = f"CIRCULAR TO {pos(end)} VIA {pos(via)}" if arc else f"LINEAR TO {pos(end)}"
    return [f"  MOVE JOINT TO {pos(begin)}", f"  MOVE {on}"]


def job(seed: int, cell: Cell) -> str:
    """Write moves that the arm can reach."""
    rng, kept = np.random.default_rng(seed), []
    for many, arc in ((LINES, False), (ARCS, True)):
        found = 0
        while found < many:
            moves = draw(rng, cell, arc)
            files = {"job.pdl": written(moves).encode()}
            if not plan_visits(
                read_program(files, cell).visits, cell
            ).plan.reason.any():
                kept += moves
                found += 1
    return written(kept)


def done(*arguments: object) -> None:
    """Run a command of the command line."""
    command = [sys.executable, "-c", RUN, *map(str, arguments)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode not in (0, 1):
        raise RuntimeError(run.stderr)


def study(seed: int, folder: Path) -> None:
    """Print the figures of one arm."""
    place = folder / "cell.toml"
    place.write_text(CELL)
    (folder / "job.pdl").write_text(job(seed, load_cell(place)))
    at, arm = ("--cell", place), ("--seed", seed)
    done("survey", *at, "--poses", 300, "-o", folder / "survey.pdl")
    done("simulate", folder / "survey.pdl", *at, *arm, "-o", folder / "survey.csv")
    done("fit", folder / "survey.csv", *at, "-o", folder / "model.json")
    for name, more in PROGRAMS.items():
        if name != "job":
            done("compensate", folder / "job.pdl", *at, "--model",
                 folder / "model.json", "-o", folder / f"{name}.pdl",
                 "--report", folder / f"{name}.json", *more)  # fmt: skip
    for name in PROGRAMS:
        done("simulate", folder / f"{name}.pdl", *at, *arm, "--path", "--wanted",
             folder / "job.pdl", "--json", folder / "true.json")  # fmt: skip
        report = folder / ("plain.json" if name == "job" else f"{name}.json")
        told = json.loads(report.read_bytes())["path"]
        true = json.loads((folder / "true.json").read_bytes())["path"]
        for move in ("LINEAR", "CIRCULAR"):
            if move == "LINEAR" or name in ("job", "plain"):  # arcs get no points
                own = [path for path in told if path["move"] == move]
                tell(f"{seed:4d}  {STATES[name]:21}  {move:8}", own, true,
                     "before" if name == "job" else "after")  # fmt: skip


def tell(
    head: str, told: list[dict[str, Any]], true: list[dict[str, Any]], key: str
) -> None:
    """Print how far the arm leaves its paths, and how far that is from predicted."""
    real = {move["visit"]: move for move in true}
    found, along, predicted = np.array([
        (real[p["visit"]]["max_mm"], real[p["visit"]]["p95_mm"], p["max_mm"][key])
        for p in told
    ]).T  # fmt: skip
    off, points = np.abs(found - predicted), [p["inserted"] for p in told]
    print(
        f"{head}  {len(found):3d}  {found.mean():.3f}  {np.percentile(found, 95):.3f}"
        f"  {found.max():.3f}  {along.mean():.3f}  {off.mean():.4f}  {off.max():.4f}"
        f"  {np.median(points):.0f}  {max(points)}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(41, 45))
    first, last = parser.parse_args().seeds
    print(
        " arm  program                move        n   mean   95 %    max   95 % along "
        "a move  off: mean   max  [mm]  points: median  max"
    )
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as folder:
            study(seed, Path(folder))


if __name__ == "__main__":
    main()
