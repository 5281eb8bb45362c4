"""How well compensated programs keep to their paths, and how well that is predicted.

    python docs/studies/paths.py [--seeds 41 45] [--backlash-model sharp] [--unmeasured]

For each virtual arm: a survey of 300 poses from both sides and of reversals, a model, a
job of 40 lines of 300 to 900 mm and 20 arcs with stops and random approaches at 50 mm/s
anywhere in front of the arm, compensated at its targets, and with points on its ways
and stops that take up play. The arm then runs all programs, and its paths are compared
every millimetre with those that were asked for. The last two programs know what a
tracker read that followed the compensated one, which `--unmeasured` leaves out: to
diagnose that takes minutes where weight chooses flanks.
The last columns are what 95 % of all the way stays within, and the most by which a path
is worse than without points (those with points) or as written: of the moves' largest
deviations, and at any place of a move.
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
from postproc.report.simulation import simulate_file
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import record_from_pose
from postproc.simulation.path import PathScores

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
[environment]
temperature_c = 22.0
[tracker]
xyz_mm = [3000.0, -2000.0, 1500.0]
[survey]
points_mm = [[-212.5, 96.0, 331.0], [148.0, -121.5, 268.0], [-58.0, 42.5, 514.0]]
"""
LINES, ARCS = 40, 20
REVERSALS = 4  # of every joint
PROGRAMS: dict[str, tuple[str, ...]] = {
    "job": (),
    "plain": (),
    "points": (
        "--path-tolerance",
        "0.1",
        "--set",
        "compensation.preload_backlash=true",
    ),
    "diagnosed": (),
    "measured": (
        "--path-tolerance",
        "0.1",
        "--set",
        "compensation.preload_backlash=true",
    ),
}
DIAGNOSED = ("diagnosed", "measured")  # with the model that knows the track
STATES = {
    "job": "as written",
    "plain": "compensated",
    "points": "with points",
    "diagnosed": "compensated, diagnosed",
    "measured": "with points, after a track",
}
WITHOUT = {"points": "plain", "measured": "diagnosed"}  # the same without points
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


def fit_a_survey(folder: Path, *arm: object, reversals: int = 0) -> Path:
    """Write the cell, survey an arm and fit `model.json`; return the cell."""
    place = folder / "cell.toml"
    place.write_text(CELL)
    at, survey = ("--cell", place), folder / "survey.pdl"
    done(
        "survey",
        *at,
        "--poses",
        300,
        "--set",
        f"survey.reversals={reversals}",
        "-o",
        survey,
    )
    done("simulate", survey, *at, *arm, "-o", folder / "survey.csv")
    done("fit", folder / "survey.csv", *at, "-o", folder / "model.json")
    return place


def follow(ran: Path, *arm: object) -> dict[str, Any]:
    """Follow a program with a tracker; diagnose `better.json`, return the report."""
    folder = ran.parent
    at, track = ("--cell", folder / "cell.toml"), folder / "track.csv"
    done("simulate", ran, *at, *arm, "--track", track)
    done("diagnose", "--path", track, "--program", ran, *at, "--model",
         folder / "model.json", "-o", folder / "better.json", "--report",
         folder / "told.json")  # fmt: skip
    told: dict[str, Any] = json.loads((folder / "told.json").read_bytes())
    return told


def study(seed: int, folder: Path, gears: str, programs: list[str]) -> None:
    """Print the figures of one arm."""
    kind = f"simulation.backlash_model={gears}"
    arm = ("--set", f"simulation.seed={seed}", "--set", kind)
    place = fit_a_survey(folder, *arm, reversals=REVERSALS)
    (folder / "job.pdl").write_text(job(seed, load_cell(place)))
    at = ("--cell", place)
    for name in programs:
        more = PROGRAMS[name]
        model = folder / ("better.json" if name in DIAGNOSED else "model.json")
        if name != "job":
            done("compensate", folder / "job.pdl", *at, "--model", model, "-o",
                 folder / f"{name}.pdl", "--report", folder / f"{name}.json",
                 *more)  # fmt: skip
        if name == "plain" and "measured" in programs:
            told = follow(folder / "plain.pdl", *arm)
            said = [f"{j['joint']} {j['verdict']}" for j in told["path"]["flanks"]]
            print(f"{seed:4d}  flanks in motion: joint {', '.join(said)}", flush=True)
    paths: dict[str, PathScores] = {}
    for name in programs:
        run = simulate_file(
            folder / f"{name}.pdl", place, seed,
            reference=folder / "job.pdl", path=True, gears=gears,
        )  # fmt: skip
        assert run.paths is not None
        paths[name] = run.paths
        report = folder / ("plain.json" if name == "job" else f"{name}.json")
        told = json.loads(report.read_bytes())["path"]
        true = json.loads(run.to_json())["path"]
        for move in ("LINEAR", "CIRCULAR"):
            own = [path for path in told if path["move"] == move]
            tell(f"{seed:4d}  {STATES[name]:26}  {move:8}", own, true,
                 "before" if name == "job" else "after",
                 compared(paths[name], paths[WITHOUT.get(name, "job")], own),
            )  # fmt: skip


def compared(
    found: PathScores, without: PathScores, told: list[dict[str, Any]]
) -> tuple[float, float, float]:
    """Compare moves with the same ones without points [mm].

    Returns:
        What 95 % of all their way stays within, and the most by which they are farther
        from their paths: of the moves' largest deviations, and at any place of a move.
    """
    wanted, most, anywhere = {p["visit"] for p in told}, [0.0], [0.0]
    every: list[float] = []
    for visit in wanted:
        (way, off), (old_way, old) = (
            (one.way[rows], one.across[rows])
            for one in (found, without)
            for k in [int(np.searchsorted(one.visit, visit))]
            for rows in [slice(one.first[k], one.first[k + 1])]
        )
        even = np.arange(way[0], way[-1], 1e-3)
        every += np.interp(even, way, off).tolist()
        most.append(off.max() - old.max())
        anywhere.append((off - np.interp(way, old_way, old)).max())
    return 1e3 * np.percentile(every, 95), 1e3 * max(most), 1e3 * max(anywhere)


def tell(
    head: str,
    told: list[dict[str, Any]],
    true: list[dict[str, Any]],
    key: str,
    beside: tuple[float, float, float],
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
        f"  {np.median(points):.0f}  {max(points)}  "
        + "  ".join(f"{one:.3f}" for one in beside),
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(41, 45))
    parser.add_argument("--backlash-model", default="sharp")
    parser.add_argument("--unmeasured", action="store_true")
    given = parser.parse_args()
    first, last = given.seeds
    programs = [n for n in PROGRAMS if n not in DIAGNOSED or not given.unmeasured]
    print(
        " arm  program                 move        n   mean   95 %    max   95 % along "
        "a move  off: mean   max  [mm]  points: median  max  95 % of all  worse: "
        "largest  anywhere"
    )
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as folder:
            study(seed, Path(folder), given.backlash_model, programs)


if __name__ == "__main__":
    main()
