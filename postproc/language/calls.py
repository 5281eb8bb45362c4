"""Calls: routines of the job are run, others are taken at their word."""

from __future__ import annotations

from dataclasses import replace

from postproc.language import pdl2 as ast
from postproc.language.copies import bare, fill, forget_key, parts_of
from postproc.language.effects import CHANGING, PURE, changed_arguments
from postproc.language.forgetting import forget, pin_names
from postproc.language.machine import Here, Machine
from postproc.language.reach import FRAMES, HANDS_OVER, reach_of
from postproc.language.unfollowed import leave_out
from postproc.language.values import Alias, Nothing, Position
from postproc.language.visits import ELSEWHERE
from postproc.language.world import Place, Record


def call_statement(machine: Machine, here: Here, call: ast.Call) -> bool:
    """Run a call; tell whether control went into a routine of the job."""
    find = here.world.find_program if call.program else here.world.find_routine
    inside = find(here.place.program, call.name)
    if inside is None:
        outside(here, call.name, call.arguments)
        return False
    if inside.body in machine.calls_in(here.context):
        running = machine.calls_in(here.context)
        machine.recursive |= {id(b) for b in running[running.index(inside.body) :]}
        _refuse_recursion(machine, here, inside)
        return False
    _bind(here, inside, call.arguments)
    machine.call(here, inside)
    return True


def calls_in_expressions(
    machine: Machine, here: Here, statement: ast.Statement
) -> None:
    """Let the function calls inside of a statement have their effects."""
    for call in machine.called(here.place, statement):
        inside = here.world.find_routine(here.place.program, call.name)
        if inside is None:
            outside(here, call.name, call.arguments)
        else:
            _summarised(machine, here, inside, call.arguments)


def _summarised(
    machine: Machine,
    here: Here,
    inside: Place,
    arguments: tuple[ast.Expression | None, ...],
) -> None:
    """Take a function's effects from its text instead of running it."""
    name, reach = inside.body.name, reach_of(here.world, inside)
    leave_out(machine, here, name, reach, arguments)
    if reach.moves:
        here.world.report_once(
            here.place.program,
            here.row,
            "call-not-followed",
            name,
            f"{name} may move the arm where it is called in an expression: the next "
            "move is taken to come from an unknown place; call it as a statement",
        )


def _refuse_recursion(machine: Machine, here: Here, inside: Place) -> None:
    name = inside.body.name or inside.program.name
    here.world.report_once(
        here.place.program,
        here.row,
        "recursion",
        name,
        f"{name} calls itself: what it does is not followed; moves after it are taken "
        "to come from an unknown place",
    )
    leave_out(machine, here, name, reach_of(here.world, inside))
    here.store.last = frozenset({ELSEWHERE})


def _bind(
    here: Here, inside: Place, arguments: tuple[ast.Expression | None, ...]
) -> None:
    """Give the parameters their values; variables go by reference."""
    prefix = f"{inside.program.name}:{inside.body.name}/"
    for at, parameter in enumerate(inside.body.parameters):
        argument = arguments[at] if at < len(arguments) else None
        key = prefix + parameter.name
        if isinstance(argument, ast.Reference) and not argument.name.startswith("$"):
            target = here.locate(argument)
            if target.component == ():
                here.store.write(key, Alias(target.keys, target.exact))
                continue
            for aliased in target.keys:
                forget_key(here, aliased, f"{inside.body.name} may change it")
        if argument is None:
            here.store.write(key, Nothing("the argument is not given"))
            continue
        given = bare(argument)
        if given is not None and (parts := parts_of(here, given)):
            fill(here, key, parameter.name, given.name, parts)
            continue
        value = here.value(argument)
        if isinstance(value, Position) and not value.name:
            value = replace(value, name=f"{inside.body.name}.{parameter.name}")
        here.store.write(key, value)


def outside(
    here: Here, name: str, arguments: tuple[ast.Expression | None, ...]
) -> None:
    """Take in what a routine that the job does not hold is said, or assumed, to do."""
    start = here.world.start
    built_in = name in CHANGING or name in PURE
    why = f"{name.upper()} computes with it" if built_in else f"{name} is given it"
    for given in arguments:
        here.world.pin(here.value(given), why)
    named = frozenset(r.name for r in map(bare, arguments) if r is not None)
    pin_names(here, named, why)
    for argument in changed_arguments(arguments):
        forget(here, argument, f"{name} may change it (arguments go by reference)")
    if built_in:
        return
    said = start.routines.get(name)
    if name in start.frame_tables:
        _frames_from_table(here, name, arguments)
    elif name.startswith(HANDS_OVER):
        here.store.last = frozenset({ELSEWHERE})
        _say(here, "position-unknown", name, "hands the arm over to a sensor or an "
             "outside stream: the next move comes from an unknown place")  # fmt: skip
    elif said is None:
        _say(here, "assumed-still", name, "is not in the files at hand: assumed "
             "neither to move the arm nor to set frames; if it does, say so under "
             f"[routines] or [frames.routines.{name}] in the cell file")  # fmt: skip
    if said == "moves":
        here.store.last = frozenset({ELSEWHERE})
    elif said == "sets-frames" and name not in start.frame_tables:
        _unknown_frames(here, f"{name} sets it; give its table under "
                        f"[frames.routines.{name}] in the cell file")  # fmt: skip


def _say(here: Here, code: str, name: str, text: str) -> None:
    here.world.report_once(here.place.program, here.row, code, name, f"{name} {text}")


def _unknown_frames(here: Here, why: str) -> None:
    here.store.set(**{frame: Nothing(why) for frame in FRAMES})


def _frames_from_table(
    here: Here, name: str, arguments: tuple[ast.Expression | None, ...]
) -> None:
    table = here.world.start.frame_tables[name]
    values = [here.value(a) for a in arguments]
    key = ",".join(
        f"{v:g}" if isinstance(v, float) else str(v)
        for v in values
        if isinstance(v, float | str) and not isinstance(v, bool)
    )
    rows = {k.replace(" ", ""): v for k, v in table.items()}
    if len(key.split(",")) != max(len(values), 1) or key not in rows:
        _unknown_frames(
            here,
            f'{name}({key}) sets it and the cell file has no "{key}" under '
            f"[frames.routines.{name}]",
        )
        return
    for frame, record in rows[key].items():
        here.store.set(**{frame: frame_value(record, f"{name}({key}) sets it")})


def frame_value(record: Record, why: str) -> Position | Nothing:
    """Return a frame of the cell file as a value."""
    if record is None:
        return Nothing(why)
    numbers = tuple(float(n) for n in record)
    return Position(False, numbers, derived="it stands in the cell file")
