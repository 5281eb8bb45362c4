"""A program that begins where another part of it ended goes on as if it were whole."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.compensation.scale.windowing import Window, cut_points
from postproc.compensation.solver.targets import targets_from_visits
from postproc.language.visits import Visits
from postproc.motion.joint_path import NOWHERE, StartState
from postproc.motion.planner import plan
from postproc.motion.replan import Replanned, replan, replan_all
from postproc.robot.cell import Cell
from postproc.robot.direction import NO_SIDES, UNLED, FlankState
from tests.bench import made
from tests.motion.test_replan import arcs, cell, picked, shifted

__all__ = ["cell"]  # a fixture

CLOSE = 1e-11  # [rad] and [m], what summing in blocks rounds off
FINE = 1e-6  # likewise, of a part of a joint's play


def milling() -> bytes:
    """Make a milling program that stops after every second row."""
    return made.milling(1500).source


@pytest.fixture(scope="module")
def short_runs() -> None:
    """Let milling operations have two rows."""
    rows, made.ROWS = made.ROWS, 2
    yield
    made.ROWS = rows


SOURCES = [milling, lambda: made.drilling(150).source, arcs,
           lambda: made.handling(90).source]  # fmt: skip
NAMES = ["milling", "drilling", "arcs", "handling"]


def read(cell: Cell, text: bytes) -> Visits:
    return read_program({"p.pdl": text}, cell).visits


def cut(visits: Visits) -> list[Window]:
    """Cut at every fifth quiet stop."""
    ends = np.flatnonzero(cut_points(visits))[2::5] + 1
    marks = [0, *ends.tolist(), len(visits)]
    assert len(marks) > 3
    return [alone(a, b) for a, b in pairwise(marks)]


def alone(first: int, end: int) -> Window:
    """Make a window without halos but for the stop before."""
    return Window(first, end, max(first - 1, 0), end)


@pytest.mark.usefixtures("short_runs")
@pytest.mark.parametrize("source", SOURCES, ids=NAMES)
def test_plans_go_on(cell: Cell, source) -> None:
    visits = read(cell, source())
    whole = plan(cell.arm, targets_from_visits(visits, cell)[0], 0.01)
    begin, lead = NOWHERE, UNLED
    for window in cut(visits):
        targets, _ = targets_from_visits(window.of(visits), cell)
        part = plan(cell.arm, targets, 0.01, begin=begin, lead=lead)
        rows = slice(window.seeds, None)
        own = slice(window.first, window.end)
        for name in ("q", "tcp", "aside", "travel"):
            np.testing.assert_allclose(
                getattr(part, name)[rows], getattr(whole, name)[own], rtol=0, atol=CLOSE
            )
        for name in ("direction", "slot", "reason", "overruled", "untimed"):
            np.testing.assert_array_equal(
                getattr(part, name)[rows], getattr(whole, name)[own], name
            )
        np.testing.assert_allclose(part.side[rows], whole.side[own], rtol=0, atol=FINE)
        np.testing.assert_allclose(part.speed[rows], whole.speed[own], atol=FINE)
        last = len(targets) - 1
        begin, lead = part.exact.at(last), part.lead(slice(last, None))


@pytest.mark.usefixtures("short_runs")
@pytest.mark.parametrize("source", SOURCES, ids=NAMES)
def test_courses_go_on_and_are_looked_at_again(cell: Cell, source) -> None:
    visits = read(cell, source())
    targets, _ = targets_from_visits(visits, cell)
    moved = picked(targets, 0.02, 5)
    after = replan_all(cell.arm, shifted(targets, moved, 5))
    begin, lead = NOWHERE, NO_SIDES
    for window in cut(visits):
        whole, _ = targets_from_visits(window.of(visits), cell)
        own = slice(window.first, window.end)
        mine = np.append(np.zeros(window.seeds, dtype=bool), moved[own])
        rows = np.flatnonzero(mine)
        there = rows + window.first - window.seeds
        new = whole.move_to(rows, after.targets.tcp[there], after.targets.joints[there])
        before = replan_all(cell.arm, whole, begin, lead)
        course = replan(cell.arm, before, new, mine, lead)
        found, kept = course.reached, slice(window.seeds, None)
        for name in ("q", "tcp", "aside"):
            wanted = getattr(after.reached, name)[own]
            np.testing.assert_allclose(
                getattr(found, name)[kept], wanted, rtol=0, atol=CLOSE
            )
        np.testing.assert_allclose(found.side[kept], after.side[own], rtol=0, atol=FINE)
        begin, lead = ended(course)


def ended(course: Replanned) -> tuple[StartState, FlankState]:
    """Say how a course leaves the arm at its last target."""
    last = slice(len(course.slot) - 1, None)
    at = course.exact.q[last], course.exact.flange[last], course.slot[last]
    return StartState(*at), course.sides[last]


@pytest.mark.parametrize("row", [1, 2, 3, 4])
def test_what_moves_next_to_the_stop_is_traced_from_there(cell: Cell, row: int) -> None:
    visits = read(cell, made.drilling(120).source)
    first = replan_all(cell.arm, targets_from_visits(alone(0, 60).of(visits), cell)[0])
    targets, _ = targets_from_visits(alone(60, len(visits)).of(visits), cell)
    begin, lead = ended(first)
    course = replan_all(cell.arm, targets, begin, lead)
    moved = np.zeros(len(targets), dtype=bool)
    moved[row] = True
    new = shifted(targets, moved, 1)
    found, wanted = (
        replan(cell.arm, course, new, moved, lead),
        replan_all(cell.arm, new, begin, lead),
    )
    np.testing.assert_allclose(found.passed, wanted.passed, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(found.side, wanted.side, rtol=0, atol=FINE)


def test_without_its_past_a_part_goes_on_otherwise(cell: Cell) -> None:
    visits = read(cell, made.drilling(120).source)
    whole = plan(cell.arm, targets_from_visits(visits, cell)[0], 0.01, timed=False)
    targets, _ = targets_from_visits(alone(60, len(visits)).of(visits), cell)
    part = plan(cell.arm, targets, 0.01, timed=False)
    assert (part.direction[1:] != whole.direction[60:]).any()
