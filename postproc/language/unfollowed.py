"""Routines that cannot be followed: their moves are listed, what they change forgotten.

A function that is called in an expression runs in the middle of a statement, and a
routine that calls itself may run at any depth: neither is run by the analysis.
"""

from __future__ import annotations

from postproc.language import pdl2 as ast
from postproc.language.effects import changed_arguments
from postproc.language.forgetting import forget, forget_names, pin_names
from postproc.language.machine import Here, Machine
from postproc.language.moves import move
from postproc.language.reach import FRAMES, Reach
from postproc.language.store import Store
from postproc.language.values import Nothing
from postproc.language.visits import ELSEWHERE
from postproc.language.world import Place

_UNFOLLOWED = -4  # in a context: the body is not run, its moves are listed


def leave_out(
    machine: Machine,
    here: Here,
    name: str,
    reach: Reach,
    arguments: tuple[ast.Expression | None, ...] = (),
) -> None:
    """Take in what a call may do without following it; list the moves it may make."""
    for argument in changed_arguments(arguments):
        here.world.pin(here.value(argument), f"{name} may move to it")
        forget(here, argument, f"{name} may change it")
    for part in reach.parts:
        within = Here(here.world, part.place, here.row, here.store, here.volatile)
        pin_names(within, part.effects.read, f"{name} may compute with it")
        forget_names(within, part.effects.assigned, f"{name} may change it")
        _list_moves(machine, here, part.place, name)
    if reach.frames:
        why = f"a routine that {name} calls sets it"
        here.store.set(**{frame: Nothing(why) for frame in FRAMES})
    if reach.moves:
        here.store.last = frozenset({ELSEWHERE})


def _list_moves(machine: Machine, here: Here, place: Place, name: str) -> None:
    """List the moves of a body once, from nowhere and with nothing known."""
    program, body = place.program, place.body
    context = ((machine.position(program, body.first), _UNFOLLOWED),)
    if context in machine.places or id(body) in machine.recursive:
        return
    machine.enter(context, place)
    why = f"{name}, which is not followed, runs this move"
    nothing = Nothing(why)
    for row in range(body.first + 1, body.last):
        statement = program.statement(row)
        if isinstance(statement, ast.Move):
            store = Store(lambda key: nothing, last=frozenset({ELSEWHERE}))
            store.set(**dict.fromkeys(FRAMES, nothing))
            at = Here(here.world, place, row, store, here.volatile, context, why)
            move(machine, at, statement)
