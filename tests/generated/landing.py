"""Compensated programs, executed by the interpreter on the virtual arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from postproc.accuracy.model import Model
from postproc.compensate import compensate
from postproc.notes import SURE
from postproc.options import Options
from postproc.planning import read_program
from postproc.pose import MM
from postproc.report import Outcome, Status
from postproc.robot.cell import Cell
from postproc.simulate import setup_of
from postproc.virtual import land, virtual_arm
from postproc.virtual.program import run_program
from tests.conftest import SEED
from tests.fuzz.case import check_bytes, records_of
from tests.generated.found import CLONED, FIRST, KNOWN, LISTED, ROUNDED, UNSURE, Found
from tests.generated.once import count_once
from tests.language.executed import PAGE, Executed, Generated
from tests.language.interpreter import Interpreter
from tests.language.reachable import OPENING, reachable
from tests.language.reread import CLONE, Lines, reread
from tests.language.straight import straight
from tests.language.test_flow_random import follow

MOST = 80  # executed moves that are run on the virtual arm
LONGEST = 10_000  # executed moves in which targets are looked for


@dataclass(frozen=True)
class Ran:
    """A program before and after, as it was executed, move for move.

    Attributes:
        made: The program.
        after: With the numbers and clones of its compensated text.
        back: The original line of each line of that.
        asked, ran: The executed moves of both, as far as the arm gets.
        whole: All that would be executed of the program.
        flanks: On which flank every gear really lies after every move.
    """

    made: Generated
    after: Generated
    back: Lines
    asked: list[Executed]
    ran: list[Executed]
    whole: list[Executed]
    flanks: Mapping[int, tuple[float, ...]]


def lands(seed: int, cell: Cell, model: Model) -> Found:
    """Compensate a program and run it before and after, on the arm of the model.

    Every other program has several files, every other two of them clones.

    Raises:
        AssertionError: A byte outside of the targets changed, or other moves are made.
    """
    made, options = program(seed)
    files = made.files
    main, pages = files["job.pdl"], {n: d for n, d in files.items() if n != "job.pdl"}
    done = compensate(main, cell, model, name="job.pdl", pages=pages, options=options)
    if "cloned" not in {d.code for d in done.diagnostics}:
        check_bytes(files, {**files, **done.outputs}, records_of(done.sidecar),
                    done.visits)  # fmt: skip
    run = executed(made, done, cell)
    found = Found()
    if len(run.asked) > len(OPENING):
        rows = follow(done.visits, run.asked, made)
        count_errors(found, run, done, rows, cell)
        count_once(found, seed, run.whole, run.ran, done, rows, run.flanks)
    return found


def program(seed: int) -> tuple[Generated, Options]:
    """Write a program, and say whether its points are cloned."""
    cloned = seed % 8 < 4
    shares = 0.4 if cloned else 0.0
    made = reachable(seed, seed % 2 == 0, pages=seed % 4 < 2, shares=shares)
    return made, Options(clone=cloned)


def executed(made: Generated, done: Outcome, cell: Cell) -> Ran:
    """Run a program before and after, in the cell's frames, as far as the robot gets.

    It stops at a variable that was never set, and at a move that the arm cannot make.
    """
    after, back = reread(made, done.outputs)
    whole, ran = (started(m, cell) for m in (made, after))
    assert [back[step.line] for step in ran] == [step.line for step in whole]
    known = [step.values is not None for step in whole[:MOST]]
    end = known.index(False) if False in known else len(known)
    flanks = sides(made, whole[:end], cell)
    end = next((k for k in range(end) if k not in flanks), end)
    flanks = {k: f for k, f in flanks.items() if k < end}
    return Ran(made, after, back, whole[:end], ran[:end], whole, flanks)


def started(made: Generated, cell: Cell) -> list[Executed]:
    """Run a program, in the cell's frames."""
    interpreter = Interpreter(made, 7, most=LONGEST)
    interpreter.frames = {
        name: tuple(getattr(cell, name).record) for name in ("tool", "uframe")
    }
    return interpreter.run()


def count_errors(
    found: Found, run: Ran, done: Outcome, rows: Sequence[set[int]], cell: Cell
) -> None:
    """Sort the true errors of moves whose numbers changed by what the report says."""
    asked, ran = run.asked, run.ran
    before, now = (
        errors(run.made, asked, *other, cell)
        for other in ((run.made, asked), (run.after, ran))
    )
    d, visits = done.decisions, done.visits
    for k, step in enumerate(asked):
        if ran[k].values == step.values or k not in before or k not in now:
            continue
        mine, pair = sorted(rows[k]), (before[k], now[k])
        if not mine or (d.status[mine] != Status.SAFE).any():
            found.error_mm[LISTED].append(pair)
        elif (visits.fly & ~visits.via)[mine].any():
            found.error_mm[ROUNDED].append(pair)
        else:
            unsure = bool((np.abs(d.side[mine]) < SURE).any())
            found.error_mm[UNSURE if unsure else KNOWN].append(pair)
            size = np.linalg.norm(d.std_error[mine], axis=1).max() / MM
            found.z += [now[k] / size] if unsure else []
            if unsure and k == 0:
                found.error_mm[FIRST].append(pair)
            at_clone = CLONE.search(line_of(run.after.files, ran[k].line))
            if at_clone and not unsure:
                found.error_mm[CLONED].append(pair)


def line_of(files: dict[str, bytes], line: int) -> str:
    """Return a line of a job, without its comment."""
    text = list(files.values())[line // PAGE].decode("latin-1")
    return text.splitlines()[line % PAGE - 1].split("--")[0]


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


def sides(
    made: Generated, asked: list[Executed], cell: Cell
) -> dict[int, tuple[float, ...]]:
    """Return the flanks of all gears after the moves that the arm can make."""
    visits = read_program({"job.pdl": straight(made, asked)}, cell).visits
    ran = run_program(virtual_arm(SEED), setup_of(cell), visits)
    flanks = ran.arrivals.side.round(2).tolist()
    return {k: tuple(f) for k, f in zip(ran.visit.tolist(), flanks, strict=True)}
