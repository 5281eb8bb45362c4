"""A generated program and its compensated text, executed on the virtual arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.compensation.outcome import Outcome
from postproc.compensation.program import read_program
from postproc.report.simulation import setup_of
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.simulation import virtual_arm
from postproc.simulation.program import ProgramRun, run_program
from tests.conftest import SEED
from tests.language.pdl2.executed import Executed, Generated
from tests.language.pdl2.interpreter import Interpreter
from tests.language.pdl2.reread import reread
from tests.language.pdl2.straight import straight

MOST = 80  # executed moves that are run on the virtual arm
LONGEST = 10_000  # executed moves in which targets are looked for
ENDLESS = 500  # .. where inputs decide how long it runs
Flanks = tuple[float, ...]
arm = cache(virtual_arm)


@dataclass(frozen=True)
class Ran:
    """A program before and after, as it was executed, move for move.

    Attributes:
        made: The program.
        after: With the numbers and clones of its compensated text.
        asked, ran: The executed moves of both, as far as the arm gets.
        whole: All that would be executed of the program.
        flanks: On which flank every gear really lies after every move.
        before, now: How far the tool lands from where it was wanted [mm], by move.
        lost: The line of the first move that the arm can make as it was written, but
            not as it was corrected, 0 where there is none.
    """

    made: Generated
    after: Generated
    asked: list[Executed]
    ran: list[Executed]
    whole: list[Executed]
    flanks: Mapping[int, Flanks]
    before: Mapping[int, float]
    now: Mapping[int, float]
    lost: int


def executed(made: Generated, done: Outcome, cell: Cell) -> Ran:
    """Run a program before and after, in the cell's frames, as far as the robot gets.

    It stops at a variable that was never set, and at a move that the arm cannot make.

    Raises:
        AssertionError: The compensated program makes other moves.
    """
    after, back = reread(made, done.outputs)
    whole, ran = (started(m, cell) for m in (made, after))
    assert [back[step.line] for step in ran] == [step.line for step in whole]
    end = known_until(whole)
    first = on_arm(made, whole[:end], cell)
    flanks = by_move(first.visit, map(tuple, first.arrivals.side.round(2).tolist()))
    end = next((k for k in range(end) if k not in flanks), end)
    end -= whole[end - 1].how == "VIA"
    second = on_arm(after, ran[:end], cell)
    wanted = by_move(first.visit, arm(SEED).nominal_tcp(first.arrivals))
    landed = [by_move(r.visit, arm(SEED).tcp(r.arrivals)) for r in (first, second)]
    stuck = next((k for k in range(end) if k not in landed[1]), end)
    lost = whole[stuck].line if stuck < end else 0
    end = stuck
    before, now = (
        {k: float(np.linalg.norm(at[k] - wanted[k]) / MM) for k in range(end)}
        for at in landed
    )
    flanks = {k: flanks[k] for k in range(end)}
    return Ran(made, after, whole[:end], ran[:end], whole, flanks, before, now, lost)


def known_until(steps: list[Executed]) -> int:
    """Return the first move to an unknown place, or in the middle of an arc."""
    for k, step in enumerate(steps[:MOST]):
        end = steps[k + 1] if k + 1 < min(len(steps), MOST) else None
        cut = step.how == "VIA" and (end is None or end.line != step.line)
        if step.values is None or cut:
            return k
    return min(len(steps), MOST)


def started(made: Generated, cell: Cell) -> list[Executed]:
    """Run a program, in the cell's frames."""
    most = LONGEST if made.deterministic else ENDLESS
    interpreter = Interpreter(made, 7, most=most)
    interpreter.frames = {
        name: tuple(getattr(cell, name).record) for name in ("tool", "uframe")
    }
    return interpreter.run()


def on_arm(made: Generated, steps: list[Executed], cell: Cell) -> ProgramRun:
    """Let the virtual arm make some moves."""
    visits = read_program({"job.pdl": straight(made, steps)}, cell).visits
    return run_program(arm(SEED), setup_of(cell), visits)


def by_move(visit: NDArray[np.int64], values: Any) -> dict[int, Any]:
    """Return values by the moves that the arm could make."""
    return dict(zip(visit.tolist(), values, strict=True))
