"""The second opinion on generated programs of three languages.

    python -m tests.verify.generated [--count 300] [--first 0] [--shipped]

With --shipped it judges those of `programs/`, welding and facing with the model of the
other arm, whose size is no matter here.

Three in four are a job of lines, arcs, zones and JOINT moves in PDL2, RAPID or KRL, one
in four a PDL2 program with conditions, loops, calls and pages.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from postproc.model.model import Model, load_model
from postproc.report.second_opinion import print_opinion
from postproc.robot.cell import Cell, load_cell
from postproc.verify.opinion import Opinion
from tests.any_controller import any_controller
from tests.conftest import make_job
from tests.generated.landing import program
from tests.language.neutral_job import LANGUAGES, drawn
from tests.verify.judged import PROGRAMS, SHIPPED, compensated, shipped


def files_of(seed: int, cell: Cell) -> dict[str, bytes]:
    """Write the program of a seed, its main file first."""
    if seed % 4 == 3:
        made = program(5000 + seed)[0].files
        return {"job.pdl": made["job.pdl"], **made}
    name = list(LANGUAGES)[seed % 4]
    files = LANGUAGES[name](drawn(cell, seed))
    return {name: files[name], **files}


def judged(seed: int | str, cell: Cell, model: Model) -> tuple[int, Opinion]:
    """Compensate a program, drawn or shipped; return its visits and the opinion."""
    if isinstance(seed, str):
        job = shipped(seed, model)
    else:
        job = compensated(files_of(seed, cell), cell, model)
    return len(job.outcome.visits), job.opinion()


def main() -> int:
    """Judge all, and print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--shipped", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = make_job(Path(name), (PROGRAMS / "cell.toml").read_text())
        cell = any_controller(load_cell(folder / "cell.toml"))
        model = load_model(folder / "model.json")
        seeds: Sequence[int | str] = range(given.first, given.first + given.count)
        if given.shipped:
            seeds = list(SHIPPED)
        found = [judged(seed, cell, model) for seed in seeds]
    whole = Opinion.joined("generated", [opinion for _, opinion in found])
    print_opinion(whole)
    visits, wrong = sum(n for n, _ in found), sum(not o.agrees for _, o in found)
    print(f"{len(found)} programs, {visits} visits, {wrong} disagree")
    for seed, (_, opinion) in zip(seeds, found, strict=True):
        for row in opinion.rows if not opinion.agrees else ():
            if row.beyond:
                print(seed, row, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
