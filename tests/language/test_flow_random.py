"""Generated programs: the analysis contains what the interpreter does."""

import random

import numpy as np
import pytest

from postproc.language.flow import resolve
from postproc.language.source import source_from_bytes
from postproc.language.structure import parse
from postproc.language.visits import ELSEWHERE, START, Target, Visits
from tests.language.generator import Executed, Generated, Generator, Interpreter

PROGRAMS = 150


def generate(seed: int, exact: bool) -> tuple[Generated, Visits]:
    made = Generator(random.Random(seed), exact).program()
    program = parse(source_from_bytes("job.pdl", made.text.encode("latin-1")))
    codes = {d.code for d in program.diagnostics}
    assert not codes & {"unknown-statement", "block-structure"}, made.text
    return made, resolve(program).visits


def fits(visits: Visits, visit: int, executed: Executed) -> bool:
    if visits.line[visit] != executed.line:
        return False
    frames = (
        (visits.tool[visit], executed.tool),
        (visits.uframe[visit], executed.uframe),
    )
    for index, actual in frames:
        if index >= 0 and not np.allclose(visits.frames[index], actual):
            return False
    if visits.target[visit] == Target.UNKNOWN:
        return True
    return executed.values is not None and np.allclose(
        visits.values[visit], executed.values
    )


def follow(visits: Visits, trace: list[Executed], text: str) -> list[set[int]]:
    """Return the visits that each executed move may be, along predecessors."""
    by_line: dict[int, list[int]] = {}
    for visit, line in enumerate(visits.line.tolist()):
        by_line.setdefault(line, []).append(visit)
    before, found = {START}, []
    for executed in trace:
        now = {
            visit
            for visit in by_line.get(executed.line, [])
            if fits(visits, visit, executed)
            and not (before | {ELSEWHERE}).isdisjoint(
                visits.predecessors(visit).tolist()
            )
        }
        assert now, f"line {executed.line} is run, but is no visit\n{text}"
        found.append(now)
        before = now
    return found


@pytest.mark.parametrize("seed", range(PROGRAMS))
def test_predecessors_contain_what_is_run(seed: int) -> None:
    made, visits = generate(seed, exact=False)
    for run in range(6):
        follow(visits, Interpreter(made, run).run(), made.text)


@pytest.mark.parametrize("seed", range(PROGRAMS))
def test_constant_programs_are_followed_exactly(seed: int) -> None:
    made, visits = generate(1000 + seed, exact=True)
    trace = Interpreter(made, 0, most=100_000).run()
    conditions_known = made.text.count("IF n") == 0 and "SELECT" not in made.text
    followed = follow(visits, trace, made.text)
    assert all(len(now) == 1 for now in followed)
    if conditions_known:
        assert len(visits) == len(trace)
        assert np.diff(visits.pred_start).tolist() == [1] * len(visits)
