"""The second opinion on generated programs of three languages.

    python -m tests.verify.generated [--count 300] [--first 0] [--shipped]

With --shipped it judges those of `programs/`, each with a model of its own arm.

Three in four are a job of lines, arcs, zones and JOINT moves in PDL2, RAPID or KRL, one
in four a PDL2 program with conditions, loops, calls and pages.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from postproc.model.model import load_model
from postproc.report.second_opinion import print_opinion
from postproc.robot.cell import Cell, load_cell
from postproc.verify.opinion import Opinion
from tests.any_controller import any_controller
from tests.conftest import make_job
from tests.generated.landing import program
from tests.language.neutral_job import LANGUAGES, drawn
from tests.verify.judged import (
    PROGRAMS,
    SHIPPED,
    Compensated,
    compensated,
    own_models,
    shipped,
)


def files_of(seed: int, cell: Cell) -> dict[str, bytes]:
    """Write the program of a seed, its main file first."""
    if seed % 4 == 3:
        made = program(5000 + seed)[0].files
        return {"job.pdl": made["job.pdl"], **made}
    name = list(LANGUAGES)[seed % 4]
    files = LANGUAGES[name](drawn(cell, seed))
    return {name: files[name], **files}


def judged(job: Compensated) -> tuple[int, Opinion]:
    """Return the visits of a program and the opinion on it."""
    return len(job.outcome.visits), job.opinion()


def jobs_of(folder: Path, seeds: Sequence[int]) -> Iterator[tuple[str, Compensated]]:
    """Compensate the programs of seeds, or without any those of `programs/`."""
    if not seeds:
        models = own_models(folder)
        yield from ((name, shipped(name, models)) for name in SHIPPED)
        return
    place = make_job(folder, (PROGRAMS / "cell.toml").read_text())
    cell = any_controller(load_cell(place / "cell.toml"))
    model = load_model(place / "model.json")
    for seed in seeds:
        yield str(seed), compensated(files_of(seed, cell), cell, model)


def main() -> int:
    """Judge all, and print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--shipped", action="store_true")
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.count)
    with tempfile.TemporaryDirectory() as name:
        jobs = jobs_of(Path(name), () if given.shipped else seeds)
        found = {which: judged(job) for which, job in jobs}
    whole = Opinion.join("generated", [opinion for _, opinion in found.values()])
    print_opinion(whole)
    visits, wrong = (
        sum(n for n, _ in found.values()),
        sum(not opinion.agrees for _, opinion in found.values()),
    )
    print(f"{len(found)} programs, {visits} visits, {wrong} disagree")
    for which, (_, opinion) in found.items():
        for row in (row for row in opinion.rows if row.beyond):
            print(which, row, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
