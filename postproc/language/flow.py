"""From a parsed program to its visits: what it moves to, and from where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from postproc.language import pdl2 as ast
from postproc.language.arrivals import Run
from postproc.language.calls import frame_value
from postproc.language.collect import collect
from postproc.language.diagnostic import Diagnostic
from postproc.language.initial import fill_initial
from postproc.language.lsv import Variables
from postproc.language.machine import HANDLED, Here, Machine
from postproc.language.program import Program
from postproc.language.reach import reach_rows
from postproc.language.steps import run_broken, step
from postproc.language.store import Store
from postproc.language.values import Nothing
from postproc.language.visits import ELSEWHERE, START, Visits
from postproc.language.world import Place, Start, World

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

__all__ = ["Resolved", "Start", "resolve"]


@dataclass(frozen=True)
class Resolved:
    """What a program does.

    Attributes:
        visits: Its arrivals.
        diagnostics: What was found, sorted by file and line.
    """

    visits: Visits
    diagnostics: tuple[Diagnostic, ...]


def resolve(
    program: Program,
    start: Start | None = None,
    variables: Variables | None = None,
    others: Mapping[str, Program] | None = None,
) -> Resolved:
    """Follow a program from its start and list every arrival with its origins.

    Every way that the program may take is followed, with what is known of variables,
    frames and motion settings; whatever cannot be known is said on the visits that
    depend on it and never guessed.

    Args:
        program: The parsed program.
        start: What the cell says, by default identity frames and nothing else.
        variables: The program's variable file.
        others: Programs named by IMPORT, CALL or EXPORTED FROM, by lower-case name.
    """
    world = World(program, dict(others or {}), start or Start(), variables)
    fill_initial(world)
    machine = Machine(world)
    runs = _Runs()
    _start(machine)
    while (here := machine.next()) is not None:
        _run(machine, here, runs)
    if machine.exhausted:
        world.report_once(
            program, 0, "too-complex", "", "the program has too many ways to be "
            "followed to the end: nothing in it is compensated",
        )  # fmt: skip
    return Resolved(collect(machine), tuple(sorted(world.diagnostics)))


def _start(machine: Machine) -> None:
    world = machine.world
    program, start = world.main, world.start
    store = Store(world.initial.get, last=frozenset({START}))
    why = "the cell file does not say what it is"
    store.set(
        tool=frame_value(start.tool, why),
        base=frame_value(start.base, why),
        uframe=frame_value(start.uframe, why),
    )
    _handlers(machine, store)
    if program.main is not None:
        machine.enter((), Place(program, program.main))
        machine.push((), program.main.first + 1, store)


def _handlers(machine: Machine, store: Store) -> None:
    """Condition handlers run at any time: nothing they change is ever known."""
    world = machine.world
    nothing = Nothing("a condition handler runs at any time")
    unknown = Store(lambda key: nothing, last=frozenset({ELSEWHERE}))
    unknown.set(tool=nothing, base=nothing, uframe=nothing)
    for program in world.programs():
        for body in (program.main, *program.routines.values()):
            for first, last in body.blocks.handlers if body else ():
                assert body is not None
                place = Place(program, body)
                reach = reach_rows(world, place, first, last)
                machine.volatile |= reach.assigned
                if reach.moves:
                    _moving_handler(machine, place, first, unknown)
    for name in machine.volatile:
        if name.startswith("$"):
            store.set(**{name[1:]: Nothing("a condition handler changes it")})


def _moving_handler(machine: Machine, place: Place, row: int, store: Store) -> None:
    machine.interrupted = True
    machine.world.report_once(
        place.program,
        row,
        "handler-moves",
        str(row),
        "this condition handler may move the arm at any time: no move's origin is sure",
    )
    context = ((machine.position(place.program, row), HANDLED),)
    machine.enter(context, place)
    machine.push(context, row + 1, store)


@dataclass
class _Runs:
    """Where stretches of moves to inline literals end.

    A move without a trajectory word belongs to a stretch only where `$MOVE_TYPE` is
    known; that is the second part of the keys.
    """

    simple: dict[tuple[int, bool], tuple[Bools, Ints]] = field(default_factory=dict)
    joins: dict[int, Ints] = field(default_factory=dict)

    def end(self, here: Here) -> int:
        """Return the row after the stretch that a row is in, the row itself if none."""
        settled = here.store.settings.get("move_type") in ("joint", "linear")
        program, body, row = here.place.program, here.place.body, here.row
        key = (id(program), settled)
        if key not in self.simple:
            flags = [is_simple(s, settled) for s in program.statements]
            simple = np.array(flags, dtype=bool)[program.lines.shape]
            self.simple[key] = simple, np.flatnonzero(~simple)
        simple, others = self.simple[key]
        if not simple[row]:
            return row
        if id(body) not in self.joins:
            self.joins[id(body)] = np.array(sorted(body.blocks.joins), dtype=np.int64)
        joins = self.joins[id(body)]
        return min(body.last, _next(others, row), _next(joins, row))


def _next(rows: Ints, row: int) -> int:
    """Return the first of some rows after a row, a large number if there is none."""
    at = int(np.searchsorted(rows, row, side="right"))
    return int(rows[at]) if at < len(rows) else 1 << 62


def is_simple(statement: ast.Statement, settled: bool) -> bool:
    """Tell whether a line is a move to six written numbers and nothing else."""
    if not isinstance(statement, ast.Move) or statement.how != "TO":
        return False
    plain = statement.trajectory in ("JOINT", "LINEAR", "" if settled else "JOINT")
    if not plain or statement.arm or statement.via or statement.til:
        return False
    if statement.settings or statement.conditions:
        return False
    match statement.where[0]:
        case ast.Invoke("pos", (*items, ast.Text(_))) | ast.Aggregate(items):
            pass
        case ast.Invoke("pos", items):
            pass
        case _:
            return False
    return len(items) == 6 and all(isinstance(i, ast.Number) for i in items)


def _run(machine: Machine, here: Here, runs: _Runs) -> None:
    """Run statements one after the other until ways part or meet."""
    program, body = here.place.program, here.place.body
    joins = body.blocks.joins
    if body.blocks.broken:
        run_broken(machine, here)
        return
    first = True
    while here.row < body.last:
        if not first and here.row in joins:
            machine.push(here.context, here.row, here.store)
            return
        end = here.row if machine.interrupted else runs.end(here)
        if end > here.row:
            _straight(machine, here, end)
        else:
            statement = program.statement(here.row)
            if not first and isinstance(statement, ast.Case | ast.Else):
                machine.push(here.context, body.blocks.end[here.row], here.store)
                return
            if not step(machine, here, statement):
                return
            here.row += 1
        first = False
    machine.leave(here)


def _straight(machine: Machine, here: Here, end: int) -> None:
    """Record a stretch of moves to inline literals at once."""
    run = Run(
        here.place,
        here.row,
        end,
        machine.predecessors(here),
        here.store.settings,
        here.reason,
    )
    base = machine.record(here, 0, run)
    here.store.last = frozenset({base + end - here.row - 1})
    here.row = end
