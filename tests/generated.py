"""Many random programs: followed as they run, and landing where they say.

python -m tests.generated --count 1000        (or: make generated)
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from postproc.accuracy.model import Model, load_model
from postproc.compensate import compensate
from postproc.notes import SURE
from postproc.planning import read_program
from postproc.pose import MM
from postproc.report import Outcome, Status
from postproc.robot.cell import Cell, load_cell
from postproc.simulate import setup_of
from postproc.virtual import land, virtual_arm
from tests.conftest import SEED, make_job
from tests.fuzz.case import check_bytes, records_of
from tests.language.interpreter import Executed, Generated, Interpreter
from tests.language.reachable import OPENING, reachable, reread, straight
from tests.language.test_flow_random import follow, generate

MOST = 60  # executed moves that are run on the virtual arm
RUNS = 3  # executions of each program whose inputs are random


@dataclass
class Found:
    """What came of one program.

    Attributes:
        seed: Of the program.
        error_mm: True errors at compensated targets, before and after, where every
            side is known.
        unsure_mm: The same where the report says that a side is not sure.
        status: Inline targets that are executed once, by what came of them.
    """

    seed: int
    error_mm: list[tuple[float, float]] = field(default_factory=list)
    unsure_mm: list[tuple[float, float]] = field(default_factory=list)
    status: Counter[str] = field(default_factory=Counter)


def flows(seed: int) -> None:
    """Check that the analysis contains what runs, and is exact where all is constant.

    Raises:
        AssertionError: It is not so.
    """
    made, visits = generate(seed, exact=False)
    for run in range(RUNS):
        follow(visits, Interpreter(made, run).run(), made)
    made, visits = generate(seed, exact=True)
    trace = Interpreter(made, 0, most=100_000).run()
    assert all(len(now) == 1 for now in follow(visits, trace, made))
    if made.whole.count("IF n") == 0 and "SELECT" not in made.whole:
        assert len(visits) == len(trace)
        assert (np.diff(visits.pred_start) == 1).all()


def lands(seed: int, cell: Cell, model: Model) -> Found:
    """Compensate a program and run it before and after, on the arm of the model.

    Raises:
        AssertionError: A byte outside of the targets changed.
    """
    made = reachable(seed, exact=seed % 2 == 0)
    data = made.text.encode("latin-1")
    done = compensate(data, cell, model, name="job.pdl")
    files = {"job.pdl": data}
    check_bytes(files, done.outputs, records_of(done.sidecar), done.visits)
    text = done.outputs["job.pdl"].decode("latin-1")
    after = reread(made, text)
    asked, ran = (started(m, cell) for m in (made, after))
    found = Found(seed)
    known = [step.values is not None for step in asked]
    if known[len(OPENING) :]:
        end = known.index(False) if False in known else len(known)
        asked, ran = asked[:end], ran[:end]
        before, now = (errors(made, asked, x, y, cell)
                       for x, y in ((made, asked), (after, ran)))  # fmt: skip
        d, visits = done.decisions, done.visits
        safe = set(visits.line[d.status == Status.SAFE].tolist())
        unsure = set(visits.line[(np.abs(d.side) < SURE).any(axis=1)].tolist())
        passing = set(visits.line[visits.fly].tolist())  # no arrival: rounded
        for k, step in enumerate(asked):
            changed = ran[k].values != step.values and step.line in safe - passing
            if changed and k in before and k in now:
                pairs = found.unsure_mm if step.line in unsure else found.error_mm
                pairs.append((before[k], now[k]))
        count_once(found, done, asked, made)
    return found


def started(made: Generated, cell: Cell) -> list[Executed]:
    """Run a program, in the cell's frames."""
    interpreter = Interpreter(made, 7, most=MOST)
    interpreter.frames = {
        name: tuple(getattr(cell, name).record) for name in ("tool", "uframe")
    }
    return interpreter.run()


def errors(
    made: Generated,
    asked: list[Executed],
    executed: Generated,
    steps: list[Executed],
    cell: Cell,
) -> dict[int, float]:
    """Return the true error [mm] of every executed move that the arm can make."""
    wanted = read_program({"job.pdl": straight(made, asked)}, cell).visits
    commanded = read_program({"job.pdl": straight(executed, steps)}, cell).visits
    landing = land(virtual_arm(SEED), setup_of(cell), wanted, commanded)
    size = np.linalg.norm(landing.error, axis=1) / MM
    return dict(zip(landing.visit.tolist(), size.tolist(), strict=True))


def count_once(
    found: Found, done: Outcome, asked: list[Executed], made: Generated
) -> None:
    """Count what came of inline targets that are executed once, from one side."""
    lines = Counter(step.line for step in asked)
    d, v = done.decisions, done.visits
    for line, times in lines.items():
        rows = np.flatnonzero(v.line == line)
        inline = made.ops[line][0] == "move"
        if times == 1 and inline and len(rows) == 1:
            row = rows[0]
            single = len(v.predecessors(int(row))) == 1
            what = "compensated" if d.status[row] == Status.SAFE else ""
            if single:
                found.status[what or d.reasons[d.why[row]]] += 1


_SETUP: list[tuple[Cell, Model]] = []


def begin(folder: str) -> None:
    """Load the cell and the model once in each process."""
    cell = load_cell(Path(folder) / "cell.toml")
    _SETUP.append((cell, load_model(Path(folder) / "model.json")))


def check(seed: int) -> Found:
    """Check one program."""
    flows(seed)
    return lands(seed, *_SETUP[0])


def said(pairs: list[tuple[float, float]]) -> str:
    """Say in one line how errors changed."""
    if not pairs:
        return "none"
    e = np.array(pairs)
    return (
        f"{len(e)}, mean {e[:, 0].mean():.3f} -> {e[:, 1].mean():.4f} mm, 95 % "
        f"{np.percentile(e[:, 1], 95):.4f}, max {e[:, 1].max():.4f}"
    )


def main() -> int:
    """Check the programs and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=5000)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    error: list[tuple[float, float]] = []
    unsure: list[tuple[float, float]] = []
    status: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = str(make_job(Path(name)))
        with ProcessPoolExecutor(given.jobs, None, begin, (folder,)) as pool:
            seeds = range(given.first, given.first + given.count)
            for found in pool.map(check, seeds, chunksize=10):
                error += found.error_mm
                unsure += found.unsure_mm
                status += found.status
    print(f"{given.count} programs: each flow contains what was executed")
    print(f"arrivals from known sides: {said(error)}")
    print(f"arrivals from sides listed as not sure: {said(unsure)}")
    print("inline targets executed once, from one place:")
    for text, count in status.most_common():
        print(f"  {count:6d} {text}")
    return 0


if __name__ == "__main__":
    random.seed(0)
    sys.exit(main())
