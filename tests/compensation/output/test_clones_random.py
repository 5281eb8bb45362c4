"""Random programs with every move cloned that can be: they do the same when they run.

The generator's interpreter runs the instructions of the original; for the clones, only
what is new in the text is read, by a few patterns, and given instructions of its own.
"""

from __future__ import annotations

import random
import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.outcome import Decisions, Status
from postproc.compensation.output.clones import give_own_points
from postproc.compensation.program import ParsedProgram, read_program
from postproc.compensation.solver.decisions import Proposal
from postproc.diagnostics import NO_REASON
from tests.language.pdl2.executed import Generated
from tests.language.pdl2.generator import Generator
from tests.language.pdl2.interpreter import Interpreter
from tests.language.pdl2.reread import moved

PROGRAMS = 120
ASSIGNED = re.compile(r"\s*(\w+__\d+) := [^\d-]*([-\d., ]+)")
MOVED = re.compile(r"\s*MOVE JOINT TO (\w+__\d+)\b")


class Sharing(Generator):
    """Writes programs in which most moves go to the same few points."""

    def statement(self, depth: int) -> None:
        """Write a move to a point, or anything else."""
        if self.rng.random() < 0.6:
            self.move_variable()
        else:
            super().statement(depth)


def made_with(seed: int, exact: bool) -> Generated:
    """Write a program."""
    return Sharing(random.Random(seed), exact).program()


def all_disagree(reading: ParsedProgram, seed: int) -> Proposal:
    """Let every arrival ask for a change of its own."""
    visits, rng = reading.visits, np.random.default_rng(seed)
    usable = (visits.reason == 0) & (visits.target.literal >= 0)
    nothing = np.zeros((len(visits), 6))
    status = np.where(usable, Status.CONFLICT, Status.RUNTIME)
    why = np.zeros(len(visits), dtype=np.int64)
    decisions = Decisions(status, why, (NO_REASON,), nothing, nothing, nothing, nothing,
                          nothing[:, :3], nothing[:, :3])  # fmt: skip
    change = rng.integers(0, 3, (len(visits), 3)).astype(float)
    places = (
        visits.place.file.tolist(),
        visits.place.line.tolist(),
        visits.target.literal.tolist(),
    )
    own: dict[tuple[int, ...], np.ndarray] = {}
    for row, place in enumerate(zip(*places, strict=True)):
        change[row] = own.setdefault(place, change[row])  # one move agrees with itself
    empty = np.zeros(0, dtype=np.int64)
    none, left = usable & False, np.zeros(len(visits))
    return Proposal(empty, nothing, none, decisions, usable, change, empty, left)


def with_clones(made: Generated, text: str) -> tuple[Generated, dict[int, int]]:
    """Give the instructions of a program to its text with clones.

    Returns:
        The program, and the original line of each of its lines.
    """
    old = [line.replace("\r", "") for line in made.text.split("\n")]
    new = [line.replace("\r", "") for line in text.split("\n")]
    plain = [re.sub(r"__\d+", "", line) for line in new]
    inserted = [bool(re.match(r"\s*\w+__\d+\s*:", line)) for line in new]
    kept = [k for k, extra in enumerate(inserted) if not extra]
    assert [plain[k] for k in kept] == old  # nothing but clones is new
    at = {line + 1: k + 1 for line, k in enumerate(kept)}
    ops = {}
    for line, op in made.ops.items():
        ops[at.get(line, line)] = moved(op, at) if line > 0 else op
    for line, words in enumerate(new, start=1):
        if found := ASSIGNED.match(words):
            numbers = tuple(float(n) for n in found[2].strip(" ,").split(","))
            ops[line] = ("set", found[1].lower(), numbers)
        elif found := MOVED.match(words):
            ops[line] = ("move_to", found[1].lower())
    routines = {name: at[line] for name, line in made.routines.items()}
    after = replace(made, text=text, ops=ops, entry=at[made.entry], routines=routines)
    return after, {k: line for line, k in at.items()}


@pytest.mark.parametrize("seed", range(PROGRAMS))
def test_clones_do_not_change_what_is_run(seed: int, job_cell) -> None:
    made = made_with(seed, seed % 2 == 0)
    reading = read_program({"job.pdl": made.text.encode("latin-1")}, job_cell)
    cloned = give_own_points(reading, all_disagree(reading, seed), job_cell)
    text = cloned.sources[0].data.decode("latin-1")
    refused = [d for d in cloned.diagnostics if "would change" in d.message]
    assert not refused, made.text
    after, line = with_clones(made, text)
    for run in range(5):
        wanted = Interpreter(made, run).run()
        done = Interpreter(after, run).run()
        assert [(line[d.line], d.values, d.tool, d.uframe) for d in done] == [
            (w.line, w.values, w.tool, w.uframe) for w in wanted
        ], text


def test_most_programs_have_clones(job_cell) -> None:
    count = 0
    for seed in range(20):
        made = made_with(seed, seed % 2 == 0)
        reading = read_program({"job.pdl": made.text.encode("latin-1")}, job_cell)
        found = give_own_points(reading, all_disagree(reading, seed), job_cell)
        count += bool(found.cloned)
    assert count >= 10
