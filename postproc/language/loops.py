"""FOR loops: round by round where the bounds are constant, else over and over."""

from __future__ import annotations

import math

from postproc.language import pdl2 as ast
from postproc.language.blocks import recovered
from postproc.language.effects import rows_effects
from postproc.language.forgetting import forget
from postproc.language.machine import MAX_ROWS, Here, Machine


def start_loop(machine: Machine, here: Here, statement: ast.For) -> None:
    """Go into the first round, past the loop, or both where that is not known."""
    row, end = here.row, here.place.body.blocks.end[here.row]
    start, stop = here.value(statement.start), here.value(statement.stop)
    by = here.value(statement.step) if statement.step is not None else 1.0
    rounds = None
    if isinstance(start, float) and isinstance(stop, float) and isinstance(by, float):
        by = -by if statement.down and by > 0 else by
        if by and math.isfinite((stop - start) / by):
            rounds = max(int((stop - start) / by + 1e-9) + 1, 0)
            rounds = 0 if (stop - start) / by < 0 else rounds
    if rounds == 0:
        machine.go_on(here.context, end + 1, here.store)
        return
    loop = (here.context, row)
    if rounds is not None and _unrolled(machine, here, statement, rounds, end):
        plan = (float(start), float(by), rounds)  # type: ignore[arg-type]
        if machine.ranges.setdefault(loop, plan) == plan:
            _round(machine, here, here.context, row, 0)
            return
    machine.widened.add(loop)
    forget(here, ast.Reference(statement.name), "it counts a loop")
    if rounds is None:
        machine.go_on(here.context, end + 1, here.store)
    machine.push(here.context, row + 1, here.store)


def _unrolled(
    machine: Machine, here: Here, statement: ast.For, rounds: int, end: int
) -> bool:
    """Tell whether a loop is followed round by round."""
    loop = (here.context, here.row)
    if loop in machine.widened:
        return False
    if loop in machine.ranges:
        return True
    program = here.place.program
    changed = rows_effects(program, here.row + 1, end).assigned | here.volatile
    if statement.name in changed:
        return False
    machine.rows += rounds * (end - here.row)
    if machine.rows <= MAX_ROWS:
        return True
    machine.rows -= rounds * (end - here.row)
    here.world.report_once(
        program,
        here.row,
        "loop-not-unrolled",
        str(here.row),
        f"the loop runs {rounds} times: too often to be followed round by round; "
        "targets that depend on its counter are not compensated",
    )
    return False


def _round(
    machine: Machine,
    here: Here,
    context: tuple[tuple[int, int], ...],
    row: int,
    number: int,
) -> None:
    """Start a round of a constant loop."""
    first, by, _ = machine.ranges[(context, row)]
    program = here.place.program
    statement = recovered(program.statement(row))
    if isinstance(statement, ast.Label) and statement.then is not None:
        statement = statement.then
    inner = (*context, (machine.position(program, row), number))
    machine.enter(inner, here.place)
    if isinstance(statement, ast.For):
        key = here.locate(ast.Reference(statement.name)).key
        here.store.write(key, first + number * by)
    machine.go_on(inner, row + 1, here.store)


def end_round(machine: Machine, here: Here) -> None:
    """Go into the next round, out of the loop, or both where that is not known."""
    row = here.place.body.blocks.opener[here.row]
    at = machine.position(here.place.program, row)
    statement = recovered(here.place.program.statement(row))
    if isinstance(statement, ast.Label) and statement.then is not None:
        statement = statement.then
    name = statement.name if isinstance(statement, ast.For) else ""
    last = here.context[-1] if here.context else None
    if last is not None and last[0] == at and last[1] >= 0:
        outer = here.context[:-1]
        if last[1] + 1 < machine.ranges[(outer, row)][2]:
            _round(machine, here, outer, row, last[1] + 1)
            return
    else:
        forget(here, ast.Reference(name), "it counts a loop")
        machine.push(here.context, row + 1, here.store)
    forget(here, ast.Reference(name), "it counted a loop that has ended")
    machine.go_on(here.context, here.row + 1, here.store)
