"""From a parsed program to its visits: what it moves to, and from where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from postproc.language import pdl2 as ast
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
from postproc.language.stretches import Stretches
from postproc.language.values import Nothing
from postproc.language.visits import ELSEWHERE, START, Visits
from postproc.language.world import Place, Start, World

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
    stretches = Stretches(machine)
    _start(machine)
    while (here := machine.next()) is not None:
        _run(machine, here, stretches)
    if machine.exhausted:
        world.report_once(
            program, 0, "too-complex", "", "the program has too many ways to be "
            "followed to the end: nothing in it is compensated",
        )  # fmt: skip
    world.pin_loose()
    return Resolved(collect(machine), tuple(sorted(world.diagnostics)))


def _start(machine: Machine) -> None:
    world = machine.world
    program, start = world.main, world.start
    store = Store(world.initial.find, last=frozenset({START}))
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
                for part in reach.parts:
                    for name in part.effects.read:
                        root = world.root(part.place, name)
                        world.loosen(root, "a condition handler may use it")
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


def _run(machine: Machine, here: Here, stretches: Stretches) -> None:
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
        if not stretches.run(here):
            statement = program.statement(here.row)
            if not first and isinstance(statement, ast.Case | ast.Else):
                machine.push(here.context, body.blocks.end[here.row], here.store)
                return
            if not step(machine, here, statement):
                return
            here.row += 1
        first = False
    machine.leave(here)
