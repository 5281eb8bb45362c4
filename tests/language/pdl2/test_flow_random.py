"""Generated programs: the analysis contains what the interpreter does."""

import random

import numpy as np
import pytest

from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import source_from_bytes
from postproc.language.visits import ELSEWHERE, START, Meaning, Visits
from tests.language.pdl2.executed import PAGE, Executed, Generated
from tests.language.pdl2.interpreter import Interpreter
from tests.language.pdl2.poses import matrix
from tests.language.pdl2.whole_jobs import Job
from tests.slow import slow

SOME, PROGRAMS = 50, 150


POSES = (Meaning.POSE, Meaning.NEAR, Meaning.FOR)


def generate(seed: int, exact: bool) -> tuple[Generated, Visits]:
    made = Job(random.Random(seed), exact).program()
    programs = {
        name.removesuffix(".pdl"): parse(source_from_bytes(name, data))
        for name, data in made.files.items()
    }
    for program in programs.values():
        codes = {d.code for d in program.diagnostics}
        assert not codes & {"unknown-statement", "block-structure"}, made.whole
    return made, resolve(programs.pop("job"), others=programs).visits


def fits(visits: Visits, visit: int, executed: Executed) -> bool:
    if visits.motion.via[visit] != (executed.how == "VIA"):
        return False
    frames = (
        (visits.frame.tool[visit], executed.tool),
        (visits.frame.uframe[visit], executed.uframe),
    )
    for index, actual in frames:
        pose = matrix(actual)
        pose[:3, 3] /= 1000.0
        if index >= 0 and not np.allclose(visits.frame.poses[index], pose):
            return False
    if visits.target.meaning[visit] == Meaning.UNKNOWN or recursive(visits, visit):
        return True
    return executed.values is not None and same_goal(visits, visit, executed)


def recursive(visits: Visits, visit: int) -> bool:
    """Tell whether a visit stands where values may be those of another call."""
    return "calls itself" in visits.reasons[visits.reason[visit]].text


def same_goal(visits: Visits, visit: int, executed: Executed) -> bool:
    """Compare the kind of a move, and its numbers: angles by the rotation they say."""
    target, held = Meaning(visits.target.meaning[visit]), executed.values or ()
    how = executed.how
    if target == Meaning.ABOUT:
        frame = Meaning(int(visits.target.values[visit][4])).name.removeprefix(
            "RELATIVE"
        )
        if how != f"ABOUT{frame}":
            return False
    elif target.name != how and how not in ("TO", "VIA"):
        return False
    if how in ("NEAR", "FOR") and visits.target.distance_mm[visit] != executed.short_mm:
        return False
    numbers = visits.target.values[visit][: len(held)]
    if target in POSES:
        return np.allclose(matrix(numbers), matrix(held))
    return np.allclose(numbers, held)


def follow(visits: Visits, trace: list[Executed], made: Generated) -> list[set[int]]:
    """Return the visits that each executed move may be, along predecessors."""
    by_line: dict[int, list[int]] = {}
    lines = visits.place.file * PAGE + visits.place.line
    for visit, line in enumerate(lines.tolist()):
        by_line.setdefault(line, []).append(visit)
    before, found = {START}, []
    for executed in trace:
        now = {
            visit
            for visit in by_line.get(executed.line, [])
            if fits(visits, visit, executed)
            and not (before | {ELSEWHERE}).isdisjoint(
                visits.graph.predecessors(visit).tolist()
            )
        }
        assert now, f"line {executed.line} is run, but is no visit\n{made.whole}"
        found.append(now)
        before = now
    return found


@pytest.mark.parametrize("seed", [*range(SOME), *slow(range(SOME, PROGRAMS))])
def test_predecessors_contain_what_is_run(seed: int) -> None:
    made, visits = generate(seed, exact=False)
    for run in range(6):
        follow(visits, Interpreter(made, run).run(), made)


@pytest.mark.parametrize("seed", [*range(SOME), *slow(range(SOME, PROGRAMS))])
def test_constant_programs_are_followed_exactly(seed: int) -> None:
    made, visits = generate(1000 + seed, exact=True)
    trace = Interpreter(made, 0, most=100_000).run()
    conditions_known = made.whole.count("IF n") == 0 and "SELECT" not in made.whole
    followed = follow(visits, trace, made)
    assert all(len(now) == 1 for now in followed)
    for (visit,), executed in zip(followed, trace, strict=True):
        known = visits.target.meaning[visit] != Meaning.UNKNOWN
        assert known or executed.values is None, f"line {executed.line}\n{made.whole}"
    if conditions_known:
        assert len(visits) == len(trace)
        assert np.diff(visits.graph.pred_start).tolist() == [1] * len(visits)
