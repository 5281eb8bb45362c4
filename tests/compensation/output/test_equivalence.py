"""Two readings of one program: what clones may change, and what nothing may."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.output.equivalence import equivalent
from postproc.compensation.program import read_program
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.visits import Visits
from postproc.robot.cell import Cell

MOVES = Reason(Code.NO_TARGET, "it moves")

POINT = "POS(100, 200, 150, 0, 175, 0, '')"
SHARED = f"""PROGRAM job
VAR p, q : POSITION
BEGIN
  p := {POINT}
  MOVE LINEAR TO p
  MOVE JOINT TO {{10, 0, -90, 0, 60, 0}}
  MOVE LINEAR TO p
END job
"""
CLONED = f"""PROGRAM job
VAR p, q : POSITION
BEGIN
  q := {POINT}
  p := {POINT}
  MOVE LINEAR TO p
  MOVE JOINT TO {{10, 0, -90, 0, 60, 0}}
  MOVE LINEAR TO q
END job
"""
NONE = np.zeros(0, dtype=np.int64)


@pytest.fixture
def both(job_cell: Cell) -> tuple[Visits, Visits]:
    before, after = (
        read_program({"job.pdl": text.encode()}, job_cell).visits
        for text in (SHARED, CLONED)
    )
    return before, after


def test_a_clone_goes_where_the_original_went(both: tuple[Visits, Visits]) -> None:
    before, after = both
    assert equivalent(before, after, NONE, before.target.values, {2: "q"}) == ""
    assert "other moves" in equivalent(before, after, NONE, before.target.values)
    assert "other moves" in equivalent(
        before, after, NONE, before.target.values, {1: "q"}
    )
    assert "name" in equivalent(before, after, NONE, before.target.values, {2: "r"})
    both_cloned = {0: "q", 2: "q"}
    assert "other moves" in equivalent(
        before, after, NONE, before.target.values, both_cloned
    )
    assert "other moves" in equivalent(after, before, NONE, after.target.values)


@pytest.mark.parametrize(
    ("part", "column"),
    [("motion", "kind"), ("motion", "fly"), ("speed", "linear"), ("graph", "pred"),
     ("target", "config_given"), ("frame", "poses")],
)  # fmt: skip
def test_nothing_else_may_differ(
    both: tuple[Visits, Visits], part: str, column: str
) -> None:
    before, after = both
    whole = getattr(after, part)
    other = np.array(getattr(whole, column))
    other[1] = ~other[1] if other.dtype == bool else 5
    wrong = replace(after, **{part: replace(whole, **{column: other})})
    told = equivalent(before, wrong, NONE, before.target.values, {2: "q"})
    assert told == f"the output has another {part}: {column}"


def test_nothing_else_may_be_said(both: tuple[Visits, Visits]) -> None:
    before, after = both
    texts = after.with_columns(configs=("", "x"), config=np.array([1, 0, 0]))
    assert "config" in equivalent(before, texts, NONE, before.target.values, {2: "q"})
    display = replace(after, reason=np.array([0, 1, 0]), reasons=(NO_REASON, MOVES))
    assert "reason" in equivalent(before, display, NONE, before.target.values, {2: "q"})
    values = after.target.values + np.array([0.0, 0.0, 1e-9, 0.0, 0.0, 0.0])
    moved = after.with_columns(values=values)
    assert "to be kept" in equivalent(before, moved, NONE, values, {2: "q"})
