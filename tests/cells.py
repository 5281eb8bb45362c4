"""Plant any small motion of any part by any driver, and see what `diagnose` says.

    python -m tests.cells [--count 300] [--first 20000] [--jobs 2] [--pairs]

A cell of the table of causes is drawn by seed over carriers, drivers and laws, but for
those that are effects of the library, and planted on a virtual arm of its own, at 0.5,
1 and 3 times the noise. Printed is how often its link and driver are told, alone or in
the stated group, and what unseen poses are left, beside a fit that knows the cell.
Unseen poses are visited at temperatures of the survey: at others a law of temperature
that is no line corrects nothing (`Ranges.outside`).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.effect_selection import attribute_drift
from postproc.exceptions import PostprocError
from postproc.model.effects import BY_NAME
from postproc.model.effects.effect import Family
from postproc.simulation.part_motion import PlantedMotion
from tests.calibration.planted import campaign
from tests.undeclared_trial import true_errors

NEAR, WORSE = 1.3, 1.02  # times the error of an informed fit, and that before
SIZES = (0.5, 1.0, 3.0)
ROWS = (300, 500)
FIRST = 20_000  # seeds below are for trying things out
MOTIONS = ("rotation", "shift")
BODIES = ("base", *(f"link{k}" for k in range(2, 7)), "tool")
SINGLE = ("payload", "temperature", "speed")
PLAIN_LAWS = ("linear", "harmonic 1", "harmonic 2", "harmonic 3", "harmonic 4")
OWN_LAWS = (
    "joint",
    "lambda",
    "travel",
)  # of a joint's own turn: effects of the library


@dataclass(frozen=True)
class CellTrial:
    """One arm, diagnosed and scored.

    Attributes:
        seed, size: Of everything; over the noise.
        cells: What was planted.
        verdict: What the tool said.
        found: Place and driver of every finding, and of its group.
        named: Findings with a name whose group holds nothing that was planted.
        right: Whether link and driver of every cell are told, alone or in a group.
        alone: Whether they are without the group.
        groups: Sizes of the groups.
        true_mm: Unseen poses before, after, and of an informed fit.
        seconds: Processor time of the search.
    """

    seed: int
    size: float
    cells: tuple[str, ...]
    verdict: str
    found: list[list[str]]
    named: list[str]
    right: bool
    alone: bool
    groups: list[int]
    true_mm: tuple[float, float, float]
    seconds: float


def draw_cell(rng: np.random.Generator) -> str:
    """Draw a cell that is no effect of the library."""
    while True:
        motion, body = str(rng.choice(MOTIONS)), str(rng.choice(BODIES))
        axis, driver = str(rng.choice(list("xyz"))), _driver(rng)
        law = _law(rng, driver)
        link = (
            int(body[4:]) if body.startswith("link") else {"base": 1, "tool": 6}[body]
        )
        if rng.random() < 0.2 and driver.split()[0] in ("joint", "temperature"):
            factor, own = str(rng.choice(["lambda", "torque"])), link
            if driver.startswith("joint") and rng.random() < 0.5:
                own, law = int(rng.integers(2, 6)), str(rng.choice(PLAIN_LAWS))
            factor = "lambda" if own == 6 else factor  # nothing hangs beside axis 6
            driver = f"{factor} {own} * {driver}"
        cell = PlantedMotion.parse(f"{motion}:{body}:{axis} by {driver} {law}")
        if not _known(cell) and _may_be_the_arms(cell):
            return str(cell)


def _driver(rng: np.random.Generator) -> str:
    """Draw what drives it."""
    kind = str(rng.choice(["joint", "lambda", "travel", "torque", "moment", *SINGLE]))
    if kind in SINGLE:
        return kind
    joint = int(
        rng.choice([2, 3, 4, 5] if kind in ("torque", "moment") else range(1, 7))
    )
    return f"{kind} {joint}" + (str(rng.choice(["x", "y"])) if kind == "moment" else "")


def _law(rng: np.random.Generator, driver: str) -> str:
    """Draw how it drives."""
    if driver.startswith("lambda"):
        return "linear"
    laws = ["linear", "sign", "step", "saturating", "spline"]
    if driver.startswith("joint"):
        laws += [f"harmonic {int(rng.integers(1, 5))}"] * 2
    return str(rng.choice(laws))


def _known(cell: PlantedMotion) -> bool:
    """Tell whether the library has it, or comes so close that it has its name."""
    kind, _, which = cell.drivers[-1].partition(" ")
    if cell.motion == "rotation" and cell.axis == "z" and cell.body != "tool":
        own = str(max(cell.link, 1))
        if kind in OWN_LAWS and which == own:
            return True
        if kind in ("torque", "payload", "moment", "joint", "speed"):
            return True  # compliance, coupling, windup, lag
    bends = cell.motion == "rotation" and kind == "moment" and which[0] == cell.body[4:]
    return bends or (cell.body == "base" and kind in ("moment", "torque", "payload"))


def _may_be_the_arms(cell: PlantedMotion) -> bool:
    """Leave out what is told and not compensated: base motions a tracker may follow."""
    return cell.body != "base" or cell.drivers[-1].split()[0] in (
        "lambda", "travel", "speed",
    )  # fmt: skip


def place(cell: PlantedMotion) -> tuple[int, str]:
    """Return link and driver that a finding must tell."""
    link = {"base": 1, "tool": 7}.get(cell.body, cell.link)
    return link, " x ".join(cell.drivers).replace("travel", "way")


def told(family: Family) -> tuple[int, str]:
    """Return the link and the driver of what was found."""
    driver = family.driver or ""
    if family.along is None:
        return family.joint or 0, driver or NAMED_DRIVERS.get(family.effect, "")
    part = family.along.split()
    link = {"base": 1, "tool": 7}.get(part[0]) or int(part[1])
    return link, driver


NAMED_DRIVERS = {"thermal": "temperature", "payload": "payload"}


def run(job: tuple[int, float, int]) -> str:
    """Plant, measure, diagnose, score; a line of the log."""
    seed, size, count = job
    rng = np.random.default_rng([seed, 46])
    rows = int(rng.integers(*ROWS))
    while True:
        texts = tuple(draw_cell(rng) for _ in range(count))
        try:
            c = campaign(seed, texts, size, rows=rows)
            break
        except PostprocError:
            continue  # it does not move this tool
    base = c.base_fit()
    start = time.process_time()
    traced = trace(base, seed=0)
    seconds = time.process_time() - start
    families = [f.family for f in traced.findings]
    groups = [(f.family, *f.rivals) for f in traced.findings]
    asked = [place(PlantedMotion.parse(t)) for t in texts]
    first = {told(f) for f in families if f is not None}
    every = {told(f) for group in groups for f in group if f is not None}
    kept = attribute_drift(traced.search.fit, None)
    plain, _ = true_errors(c, seed, base, kept, surveyed=True)
    named = [
        str(f.family)
        for f, group in zip(traced.findings, groups, strict=True)
        if f.effect != "part_motion"
        and not BY_NAME[f.effect].free
        and not any(told(g) in asked for g in group if g is not None)
    ]
    trial = CellTrial(
        seed, size, texts, traced.verdict,
        [[str(f) for f in group] for group in groups], named,
        all(a in every for a in asked), all(a in first for a in asked),
        [len(group) for group in groups], plain, seconds,
    )  # fmt: skip
    return json.dumps(asdict(trial))


HEAD = (
    "| of the noise | trials | link and driver told | of these without the group | "
    "unseen poses within 1.3 of informed | worse than before | a false name | "
    "group, median and largest |\n|---|---|---|---|---|---|---|---|"
)


def share(held: Sequence[bool]) -> str:
    """Write how many of some trials, with exact bounds of the share (95 %)."""
    count, n = sum(held), len(held)
    if n == 0:
        return "0 of 0"
    bounds = binomtest(count, n).proportion_ci(method="exact")
    return f"{count} of {n} ({bounds.low:.0%} to {bounds.high:.0%})"


def summary(trials: Sequence[dict[str, Any]]) -> str:
    """Write the table."""
    lines = [HEAD]
    for size in sorted({t["size"] for t in trials}):
        some = [t for t in trials if t["size"] == size]
        mm = np.array([t["true_mm"] for t in some])
        groups = [g for t in some for g in t["groups"]] or [0]
        columns = (
            f"{size:g}", str(len(some)),
            share([t["right"] for t in some]),
            share([t["alone"] for t in some if t["right"]]),
            share(list(mm[:, 1] <= NEAR * mm[:, 2])),
            share(list(mm[:, 1] > WORSE * mm[:, 0])),
            share([bool(t["named"]) for t in some]),
            f"{np.median(groups):g}, {max(groups)}",
        )  # fmt: skip
        lines.append(f"| {' | '.join(columns)} |")
    return "\n".join(lines)


def main() -> None:
    """Run what the log does not hold yet, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first", type=int, default=FIRST)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--pairs", action="store_true", help="two cells an arm")
    parser.add_argument("--log", type=Path, default=Path("build/cells.jsonl"))
    given = parser.parse_args()
    given.log.parent.mkdir(parents=True, exist_ok=True)
    count = 2 if given.pairs else 1
    seeds = range(given.first, given.first + given.count)
    jobs = [(seed, SIZES[k % len(SIZES)], count) for k, seed in enumerate(seeds)]
    lines = given.log.read_text().splitlines() if given.log.exists() else []
    known = {(t["seed"], len(t["cells"])) for t in map(json.loads, lines)}
    todo = [job for job in jobs if (job[0], count) not in known]
    with ProcessPoolExecutor(given.jobs) as pool, given.log.open("a") as out:
        for line in pool.map(run, todo):
            out.write(line + "\n")
            out.flush()
    every = map(json.loads, given.log.read_text().splitlines())
    print(
        summary([t for t in every if t["seed"] in seeds and len(t["cells"]) == count])
    )


if __name__ == "__main__":
    main()
