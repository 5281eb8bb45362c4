"""Points on the ways of arms whose gaps are drawn more widely than shipped ones.

    python -m tests.studies.wide_gaps [--seeds 100 105] [--lines 12] [--folder PLACE]
        [--half 0.01 0.1] [--gears sharp] [--repeats 6] [--states plain reversals ..]

Every joint's half gap is drawn log-uniformly between the bounds [mrad], and what the
joints scatter by is set [urad]. `--gears mixed` draws which kind of gear every joint
has, and how wide elastic flanks are; both are printed beside what reversals say. The
job is lines of 300 to 900 mm with stops at 50 mm/s. One row a state of knowledge: a
plain survey (`plain`), one with reversals (`reversals`), that and a measured path
(`track`); `+stops` preloads the backlash. A row says what 95 % of all the way stays
within and the largest deviation, both again behind the first 5 mm of every move, how
much farther a place is than the same program without points [mm], the share of the way
that is within 0.05 mm and that is nearer than without, the share of moves whose promise
holds, and of those that stay within their largest deviation by any open hypothesis, the
share of the way of moves with an end that a guard rejects, and the largest deviation of
the others, the moves with points, and the median of points a move, of all moves and of
those with any. The last lines sum up every state over all arms.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from docs.studies import paths as study
from postproc.model.flank_hypotheses import verdict_of
from postproc.model.model import load_model
from postproc.report.simulation import simulate_file
from postproc.robot.cell import load_cell
from postproc.simulation import draw, virtual_arm
from postproc.simulation import path as simulated
from postproc.simulation.arm import MIXED, GearKind
from postproc.simulation.laws import Draw, Law, backlash
from postproc.simulation.path import PathScores
from tests.written import cli

NEARER = 1e-5  # [m]
NEAR = 5e-5  # [m]
PREDICTED = 1e-5  # [m] what predictions are accurate to
BEGINS = 5e-3  # [m] behind a stop, told apart
SPACING = 1e-4  # [m] between places that are looked at: links jump where moves begin
JUMPS = -1e-4, -5e-5, 0.0, 5e-5, 1e-4  # [m] along the way, by which a jump may differ
STATES = ("plain", "reversals+stops", "track+stops")
STOPS = ("--set", "compensation.preload_backlash=true")


def done(*arguments: object, may_reject: bool = False) -> None:
    """Run a command of the command line, in this process.

    Args:
        arguments: What is written behind `postproc`.
        may_reject: It may end with 2, as a diagnosis whose model is not to be used.
    """
    found = cli(*arguments)
    if found.exit_code not in (0, 1) and not (may_reject and found.exit_code == 2):
        raise RuntimeError(found.stderr)


def gaps_between(low: float, high: float) -> Any:
    """Draw a backlash law of half gaps [mrad] that are log-uniform between bounds."""

    def drawn(given: Draw) -> Law:
        half = np.exp(given.rng.uniform(np.log(low), np.log(high), 6)) * 1e-3
        usual = backlash(given)
        own = np.array([-usual.parameters[f"b_{j}"] for j in range(1, 7)])
        told = {f"b_{j + 1}": -float(half[j]) for j in range(6)}
        return replace(usual, parameters=told,
                       shape=lambda at: usual.shape(at) * half / own)  # fmt: skip

    return drawn


class Bench:
    """One virtual arm, its surveys, and its job."""

    def __init__(self, seed: int, folder: Path, lines: int, gears: str) -> None:
        """Draw the job of an arm."""
        self.seed, self.folder, self.gears = seed, folder, gears
        kind = f"simulation.backlash_model={gears}"
        self.arm = ("--set", f"simulation.seed={seed}", "--set", kind)
        folder.mkdir(parents=True, exist_ok=True)
        self.cell = folder / "cell.toml"
        self.cell.write_text(study.CELL)
        with patch.multiple(study, LINES=lines, ARCS=0):
            (folder / "job.pdl").write_text(study.job(seed, load_cell(self.cell)))

    def model(self, state: str) -> Path:
        """Survey and fit what a state of knowledge takes, once."""
        at, place = ("--cell", self.cell), self.folder / f"{state}.model.json"
        if place.exists():
            return place
        if state == "track":
            self.compensate("reversals", ())
            ran, track = self.folder / "reversals.out.pdl", self.folder / "track.csv"
            done("simulate", ran, *at, *self.arm, "--track", track)
            done("diagnose", "--path", track, "--program", ran, *at, "--model",
                 self.model("reversals"), "-o", place, may_reject=True)  # fmt: skip
            return place if place.exists() else self.model("reversals")
        many = f"survey.reversals={4 if state == 'reversals' else 0}"
        survey = self.folder / f"{state}.pdl"
        done("survey", *at, "--poses", 300, "--set", many, "-o", survey)
        done("simulate", survey, *at, *self.arm, "-o", survey.with_suffix(".csv"))
        done("fit", survey.with_suffix(".csv"), *at, "-o", place)
        return place

    def compensate(self, state: str, options: tuple[object, ...]) -> dict[str, Any]:
        """Compensate the job, and return the report."""
        name, report = f"{state}.out.pdl", self.folder / f"{state}.report.json"
        done("compensate", self.folder / "job.pdl", "--cell", self.cell, "--model",
             self.model(state.partition("+")[0]), "-o", self.folder / name,
             "--report", report, *options)  # fmt: skip
        told: dict[str, Any] = json.loads(report.read_bytes())
        return told

    def run(self, state: str) -> PathScores:
        """Run what was compensated."""
        with patch.object(simulated, "STEP", SPACING):
            run = simulate_file(
                self.folder / f"{state}.out.pdl", self.cell, self.seed,
                reference=self.folder / "job.pdl", path=True, gears=self.gears,
            )  # fmt: skip
        assert run.paths is not None
        return run.paths


def even(found: PathScores, visit: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the way of a move and how far it is off there, [m] each.

    The way never goes back, as that of a tool may whose link jumps.
    """
    k = int(np.searchsorted(found.visit, visit))
    rows = slice(found.first[k], found.first[k + 1])
    return np.maximum.accumulate(found.way[rows]), found.across[rows]


def harm(new: PathScores, old: PathScores, visit: int, at: np.ndarray) -> np.ndarray:
    """Return how much farther a move is off at places of its way than before [m].

    Compared is the farthest within `JUMPS` of a place: links jump as soon as their
    drives have crossed their gaps, with points a little sooner or later.
    """
    there = at + np.array(JUMPS)[:, None]
    usual = np.interp(there, *even(old, visit)).max(axis=0)
    return np.interp(at, *even(new, visit)) - usual


def guarded(report: dict[str, Any]) -> set[int]:
    """Return the moves with an end whose target a guard rejects, by visit."""
    status = [target["status"] for target in report["targets"]]
    visits = [path["visit"] for path in report["path"]]
    return {v for v in visits if "rejected" in (status[v - 1], status[v])}


def compared(
    new: PathScores, old: PathScores, told: list[dict[str, Any]], whole: set[int]
) -> dict[str, float]:
    """Compare the ways of a program with those of the one without points."""
    every, usual, kept, ways, rejected = [], [], [], [], []
    bounded, begins, behind = [], [], []
    for path in told:
        (way, off), (old_way, before) = (even(one, path["visit"]) for one in (new, old))
        at = np.arange(way[0], way[-1], 1e-3)
        here = np.interp(at, way, off)
        begins.append(harm(new, old, path["visit"], np.arange(0.0, BEGINS, SPACING)))
        behind.append(harm(new, old, path["visit"], at[at >= BEGINS]))
        every.append(here)
        usual.append(np.interp(at, old_way, before))
        ways.append(at)
        rejected.append(np.full(len(at), path["visit"] in whole))
        promise = path.get("promise_mm")
        if promise is not None:
            kept.append(np.percentile(here, 95) <= 1e-3 * promise + 5e-6)
            bounded.append(off.max() <= 1e-3 * path["worst_mm"] + PREDICTED)
    off, before, far, held = map(np.concatenate, (every, usual, ways, rejected))
    far = far >= BEGINS
    return {
        "95 %": 1e3 * np.percentile(off, 95),
        "max": 1e3 * off.max(),
        "95 % behind starts": 1e3 * np.percentile(off[far], 95),
        "max behind starts": 1e3 * off[far].max(),
        "worse": 1e3 * np.concatenate(behind).max(),
        "at starts": 1e3 * np.concatenate(begins).max(),
        "within": (off < NEAR).mean(),
        "nearer": (off < before - NEARER).mean(),
        "kept": np.mean(kept) if kept else np.nan,
        "bounded": np.mean(bounded) if bounded else np.nan,
        "promised": len(kept),
        "guarded": held.mean(),
        "max of others": 1e3 * off[~held].max(initial=0.0),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(100, 105))
    parser.add_argument("--lines", type=int, default=12)
    parser.add_argument("--half", type=float, nargs=2, default=(0.01, 0.1))
    parser.add_argument("--repeats", type=float, default=6.0)
    parser.add_argument("--gears", default="sharp")
    parser.add_argument("--states", nargs="+", default=STATES)
    parser.add_argument("--tolerance", default="0.1")
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    scatter = np.full(6, given.repeats * 1e-6)
    rows: dict[str, list[dict[str, float]]] = {state: [] for state in given.states}
    with (
        tempfile.TemporaryDirectory() as temporary,
        patch.object(draw, "backlash", gaps_between(*given.half)),
        patch.object(draw._Planter, "joint_noise", lambda *_: scatter),
    ):
        for seed in range(given.seeds[0], given.seeds[1] + 1):
            place = (given.folder or Path(temporary)) / f"{given.gears}{seed}"
            bench = Bench(seed, place, given.lines, given.gears)
            for state in given.states:
                rows[state].append(row(bench, state, given.tolerance))
            if given.gears == MIXED:
                print(joints(bench), flush=True)
    for state, found in rows.items():
        print(f"{state:16} {sum_up(found)}")


def joints(bench: Bench) -> str:
    """Say which gears an arm has, and what reversals say of them."""
    gears = virtual_arm(bench.seed, gears=bench.gears).gears
    known = load_model(bench.model("reversals")).flank_widths
    found = []
    for j, (kind, width) in enumerate(zip(gears.kinds, known, strict=True)):
        wide = f" {gears.reach[j]:.1f}" if kind is GearKind.ELASTIC else ""
        word, gap = verdict_of(width) or "uncertain", 2e3 * gears.gap[j]
        if word in ("elastic", "between"):
            word += f" {width[0]:g} to {width[1]:g}"
        found.append(f"{j + 1} {kind.value}{wide} ({gap:.2f} mrad): {word}")
    return f"{bench.seed:4d} joint " + "; ".join(found)


def sum_up(found: list[dict[str, float]]) -> str:
    """Sum up a state of knowledge over all arms."""
    arms, last = len(found), {key: [one[key] for one in found] for key in found[0]}
    low = sum(size <= 1e3 * NEAR for size in last["95 %"])
    moves = sum(last["promised"])
    kept, bounded = (
        round(np.nansum(np.multiply(last[name], last["promised"])))
        for name in ("kept", "bounded")
    )
    largest = ", ".join(
        f"{name} {max(last[name]):.3f}"
        for name in ("95 %", "max", "max of others", "worse", "at starts")
    )
    return (
        f"95 % within {1e3 * NEAR:g} mm on {low} of {arms} arms, promises kept "
        f"{kept} of {moves}, largest {bounded} of {moves}, moves with points "
        f"{sum(last['split'])}, nearer {np.mean(last['nearer']):.2f}; at the most "
        f"{largest}, points {max(last['points']):.0f}"
    )


def row(bench: Bench, state: str, tolerance: str) -> dict[str, float]:
    """Print one state of knowledge of one arm, and return it."""
    knows, _, stops = state.partition("+")
    bench.compensate(knows, ())
    without = bench.run(knows)
    asked = ("--path-tolerance", tolerance, *(STOPS if stops else ()))
    report = bench.compensate(f"{knows}+{stops}", asked)
    told = report["path"]
    whole = guarded(report)
    found = compared(bench.run(f"{knows}+{stops}"), without, told, whole)
    usual = compared(without, without, told, whole)
    points = [path["inserted"] for path in told]
    some = [count for count in points if count] or [0]
    print(
        f"{bench.seed:4d} {state:16} without {usual['95 %']:.3f} {usual['max']:.3f}  "
        + "  ".join(
            f"{key} {value:.3f}" for key, value in found.items() if key != "promised"
        )
        + f"  moves {sum(map(bool, points))}/{len(told)} points {np.median(points):.0f}"
        + f" where any {np.median(some):.0f}, at most {max(some)}"
        + f"  {report['path_accuracy']['after']['max_mm']:.3f} predicted",
        flush=True,
    )
    split, middle = sum(map(bool, points)), float(np.median(points))
    return {**found, "split": split, "points": middle}


if __name__ == "__main__":
    main()
