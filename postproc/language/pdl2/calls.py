"""Calls and assignments: what they leave of variables, frames and places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from postproc.diagnostics import Code, Reason
from postproc.language import ir
from postproc.language.analysis.call_context import At
from postproc.language.analysis.origins import NOWHERE
from postproc.language.analysis.values import WrittenNumber
from postproc.language.language import Record, Start
from postproc.language.pdl2 import external_routines, side_effects
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import FRAMES, Store
from postproc.language.pdl2.conditions import DISTURBING
from postproc.language.pdl2.evaluate import (
    Execution,
    bare,
    copy_parts,
    fill,
    invalidate_key,
    parts_of,
    set_owner,
)
from postproc.language.pdl2.job import Place
from postproc.language.pdl2.machine import (
    Machine,
    escape_names,
    invalidate,
    invalidate_names,
    let_others_run,
)
from postproc.language.pdl2.moves import move
from postproc.language.pdl2.values import (
    Component,
    Nothing,
    Position,
    Value,
    number_in,
    points_of,
)

# Routines that cannot be followed: their moves are listed, what they change forgotten.
#
# A function that is called in an expression runs in the middle of a statement, and a
# routine that calls itself may run at any depth: neither is run by the analysis.

_UNFOLLOWED = -4  # in a context: the body is not run, its moves are listed


def summarise_call(
    machine: Machine,
    here: Execution,
    name: str,
    reach: side_effects.CallGraph,
    arguments: tuple[ir.Operand | None, ...] = (),
    parameters: Sequence[str] = (),
) -> None:
    """Take in what a call may do without following it; list the moves it may make."""
    still = {*parameters} - reach.may_change
    for at, argument in enumerate(arguments):
        if isinstance(argument, ir.DataObject):
            here.world.pin(here.value(argument), f"{name} may move to it")
            if at >= len(parameters) or parameters[at] not in still:
                invalidate(here, argument, f"{name} may change it")
    take_effects(
        here, reach.parts, f"{name} may compute with it", f"{name} may change it"
    )
    for place, _ in reach.parts:
        list_moves(machine, here, place, name)
    if reach.frames:
        here.store.forget_frames(f"a routine that {name} calls sets it")
    if reach.moves:
        here.store.lose_place()


def take_effects(
    here: Execution, parts: Sequence[side_effects.LiveRows], computes: str, changes: str
) -> None:
    """Take in what rows do to variables that are not followed, and say so."""
    for place, own in parts:
        within = Execution(here.world, place, here.row, here.store)
        escape_names(within, own.read, computes)
        invalidate_names(within, own.assigned, changes)


def list_moves(machine: Machine, here: Execution, place: Place, name: str) -> None:
    """List the moves of a body once, from nowhere and with nothing known."""
    first = place.offset + place.body.first
    if machine.root.find(first, _UNFOLLOWED) or id(place.body) in machine.recursive:
        return
    context = machine.root.within(first, _UNFOLLOWED, place)
    why = f"{name}, which is not followed, runs this move"
    nothing, reason = Nothing(why), Reason(Code.NEVER_REACHED, why)
    for row, statement in place.list_moves():
        store = Store(lambda key: nothing, last=NOWHERE)
        store.forget_frames(why)
        at = Execution(here.world, place, row, store, context, reason)
        move(machine, at, statement)


# Calls: routines of the job are run, others are taken at their word.


def call_statement(machine: Machine, here: Execution, call: ir.Instruction) -> bool:
    """Run a call; tell whether control went into a routine of the job."""
    whole = isinstance(call, ast.ProgramCall)
    find = here.world.find_program if whole else here.world.find_routine
    inside = find(here.place.program, call.name)
    if inside is None:
        opaque_call(here, call.name, call.values)
        return False
    running = machine.calls_to(inside.body, here.context)
    if running:
        machine.recursive |= {id(body) for body in running}
        name = inside.body.name or inside.program.name
        _say(here, Code.RECURSION, name, "calls itself and is not followed: the next "
             "move is assumed to start at an unknown place. Write it as a "
             "loop")  # fmt: skip
        summarise_call(
            machine, here, name, side_effects.call_graph_of(here.world, inside)
        )
        here.store.lose_place()
        return False
    _bind(here, inside, call.values)
    machine.call(At(here.context, here.row), inside, here.store)
    return True


def calls_in_expressions(
    machine: Machine, here: Execution, statement: ir.SourceStatement
) -> None:
    """Let the function calls inside of a statement have their effects."""
    program = here.place.program
    if not program.calling[program.lines.shape[here.row]]:
        return
    for call in machine.find_calls(here.place, statement):
        inside = here.world.find_routine(here.place.program, call.name)
        if inside is None:
            opaque_call(here, call.name, call.values)
            continue
        name, reach = inside.body.name, side_effects.call_graph_of(here.world, inside)
        answer, key = _run_function(machine, here, inside, call), here.answer_key(call)
        here.store.drop(key)
        if answer is not None:
            here.store.write(key, answer)
        summarise_call(machine, here, name, reach, call.values, inside.body.parameters)
        if reach.moves:
            _say(here, Code.CALL_NOT_FOLLOWED, name, "is called in an expression and "
                 "may move the arm: the next move is assumed to start at an unknown "
                 "place. Call it as a statement")  # fmt: skip


def _run_function(
    machine: Machine, here: Execution, inside: Place, call: ir.FunctionCall
) -> Value | None:
    """Return what a function returns that only sets variables of its own.

    None for one that does more than that.
    """
    store, body = here.store.copy(), inside.body
    _bind(replace(here, store=store), inside, call.values)
    own = body.own_names.difference(body.parameters)
    for row in range(body.flow.first, body.flow.last):
        at = Execution(here.world, inside, row, store, here.context)
        one = inside.statement(row)
        if machine.find_calls(inside, one):
            return None
        match one:
            case ir.Leave("return", ir.Operand() as value):
                found = at.value(value)
                if isinstance(found, Position):
                    found = replace(found, derived=f"{body.name} returns it")
                return found
            case ir.Assignment(target) if target.name in own:
                assign(at, one, False)
            case _ if type(one) is not ir.SourceStatement:
                return None
    return None


def _bind(
    here: Execution, inside: Place, arguments: tuple[ir.Operand | None, ...]
) -> None:
    """Give the parameters their values; variables go by reference."""
    prefix = f"{inside.program.name}:{inside.body.name}/"
    for at, parameter in enumerate(inside.body.parameters):
        argument = arguments[at] if at < len(arguments) else None
        key = prefix + parameter
        if other := here.world.other_arm(inside, parameter):
            here.world.pin(here.value(argument), f"arm {other} goes to it too")
            here.store.write(key, Nothing(points_of(other)))
            continue
        if isinstance(argument, ir.DataObject) and not argument.name.startswith("$"):
            target = here.locate(argument)
            if target.component == ():
                here.store.write(key, target)
                continue
            for aliased in target.keys:
                invalidate_key(here, aliased, f"{inside.body.name} may change it")
        if argument is None:
            here.store.write(key, Nothing("the argument is not given"))
            continue
        given = bare(argument)
        if given is not None and (parts := parts_of(here, given)):
            fill(here, key, parameter, given.name, parts)
            continue
        value = here.value(argument)
        if isinstance(value, Position) and not value.name:
            value = replace(value, name=f"{inside.body.name}.{parameter}")
        here.store.write(key, value)


def opaque_call(
    here: Execution, name: str, arguments: tuple[ir.Operand | None, ...]
) -> None:
    """Take in what a routine that the job does not hold is said, or assumed, to do."""
    built_in = name in side_effects.CHANGING or name in side_effects.PURE
    why = f"{name.upper()} computes with it" if built_in else f"{name} is given it"
    if name not in side_effects.NODES:
        for given in arguments:
            here.world.pin(here.value(given), why)
        named = frozenset(r.name for r in map(bare, arguments) if r is not None)
        escape_names(here, named, why)
    for argument in side_effects.list_changed_arguments(arguments):
        invalidate(here, argument, f"{name} may change it (arguments go by reference)")
    if built_in:
        return
    let_others_run(here)
    match external_routines.effect_of(here.world, here.place.program, name):
        case external_routines.RoutineEffect.TABLE:
            _frames_from_table(here, name, arguments)
        case external_routines.RoutineEffect.MOVES:
            here.store.lose_place()
        case external_routines.RoutineEffect.SETS_FRAMES:
            here.store.forget_frames(f"{name} sets it; give its table under "
                                     f"[frames.routines.{name}] in the cell "
                                     "file")  # fmt: skip
        case external_routines.RoutineEffect.TRACKS:
            on = here.value(arguments[0]) if arguments else Nothing("")
            here.store.set(**{external_routines.TRACKING: on})
            here.store.lose_place()
            _say(here, Code.POSITION_UNKNOWN, name, "lets a sensor guide the arm, or "
                 "ends that: the next move starts at an unknown place")  # fmt: skip
        case external_routines.RoutineEffect.KNOWN:
            _say(here, Code.ROUTINE_ASSUMED_MOTIONLESS, name,
                 "is not in the given files. It is assumed to neither move the arm "
                 "nor set frames, because it is on the list of such routines "
                 "(docs/routines.md). If it does, declare it under [routines] of the "
                 "cell, or set assume_motion")  # fmt: skip
        case external_routines.RoutineEffect.UNKNOWN:
            external_routines.report_unknown_routine(
                here.world, here.place.program, here.row, name
            )
            here.store.forget_surroundings(
                f"{name}, which is not in the given files, may set it: declare it "
                "under [routines] of the cell")  # fmt: skip


def _say(here: Execution, code: Code, name: str, text: str) -> None:
    here.report_once(code, name, f"{name} {text}")


def _frames_from_table(
    here: Execution, name: str, arguments: tuple[ir.Operand | None, ...]
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
        here.store.forget_frames(
            f'{name}({key}) sets it and the cell file has no "{key}" under '
            f"[frames.routines.{name}]"
        )
        return
    for frame, record in rows[key].items():
        found = frame_value(here.world.start, record, f"{name}({key}) sets it")
        here.store.set(**{frame: found})


def frame_value(start: Start, record: Record, why: str) -> Position | Nothing:
    """Return a frame of the cell file as a value."""
    if record is None:
        return Nothing(why)
    parts = tuple(WrittenNumber(float(n)) for n in record)
    why, taught = "it stands in the cell file", record in start.taught_records
    return Position(False, parts, derived=why, taught=taught)


# Assignments: what a variable, a component or a setting holds afterwards.


def assign(here: Execution, statement: ir.Assignment, taught: bool) -> None:
    """Let an assignment have its effect; `taught` marks the literal in it."""
    reference, new, name = statement.target, statement.value, statement.target.name
    if other := here.world.other_arm(here.place, name):
        here.world.pin(here.value(new), f"arm {other} goes to it too")
        for key in here.locate(reference).keys:
            invalidate_key(here, key, points_of(other))
        return
    if name.startswith("$"):
        taught = taught or here.takes_taught(new)
        _setting(here, reference, _value(here, new, taught), taught)
        return
    target = here.locate(reference)
    if target.exact and target.number >= 0:
        part = here.number(new)
        held = _position(here, name, target.key).with_component(target.number, part)
        held = replace(held, taught=held.taught or here.takes_taught(new))
        here.store.write(target.key, set_owner(here, name, target.key, held))
        return
    if copy_parts(here, new, reference):
        return
    value = _value(here, new, taught)
    if not target.exact:
        for key in target.keys:
            invalidate_key(here, key, "an element known only at run time is assigned")
        return
    if target.component != ():
        value = _with_part(_position(here, name, target.key), target.component, value)
    if isinstance(value, Position):
        value = set_owner(here, name, target.key, value)
    if isinstance(value, Nothing) and target.component == ():
        here.store.forget(target.key, value)
    else:
        here.store.write(target.key, value)


def _value(here: Execution, expression: ir.Operand, taught: bool) -> Value:
    """Return what an expression is worth, a position marked as taught if it is."""
    value = here.value(expression)
    if taught and isinstance(value, Position):
        return replace(value, taught=True)
    return value


def _setting(
    here: Execution, reference: ir.DataObject, value: Value, taught: bool
) -> None:
    """Change a frame or motion variable of our arm, or one number of a frame."""
    name, component = here.locate_setting(reference)
    if name is None:
        _part_of_setting(here, reference, value)
        return
    if isinstance(component, int):
        held = here.find_taught(here.store.settings.get(name, Position()))
        held = held if isinstance(held, Position) else Position()
        held = held.with_component(component, WrittenNumber(number_in(value)))
        value = replace(held, taught=held.taught or taught)
    else:
        here.world.pin(value, f"${name.upper()} is set to it")
        if isinstance(value, Position) and name in FRAMES:
            value = replace(value, parts=tuple(map(WrittenNumber, value.numbers)))
    if f"${name}" in here.world.volatile:
        value = Nothing("a condition handler changes it")
    here.store.set(**{name: value})


def _part_of_setting(here: Execution, reference: ir.DataObject, value: Value) -> None:
    """Forget a setting of which a part is set, or that may be another arm's."""
    name, steps = reference.name[1:], reference.steps
    field, arm = name, here.world.arm
    whose: int | None = arm if name != "arm_data" else 0
    match reference:
        case ir.DataObject("$arm_data", (ir.ElementStep((index, *_)), *rest)):
            field, whose = str((*rest, "")[0]).lstrip("$"), here.integer(index)
    off = value is False and here.store.settings.get(field, False) is False
    if whose in (None, arm) and field in DISTURBING and not off:
        here.store.set(**{field: Nothing("a part of it is assigned")})
    if name in FRAMES or not steps:
        said = f"a part of {reference.name.upper()} is assigned"
        why = said if steps else here.other_default()
        here.store.set(**{name: Nothing(why)})
    elif whose is None:
        here.store.set(**{field: Nothing("it is set for an arm known at run time")})


def _with_part(held: Position, component: Component, value: Value) -> Value:
    """Return a position of which a part is set that is none of its six numbers."""
    match component:
        case "pos":
            if not isinstance(value, Position):
                known = isinstance(value, Nothing)
                return value if known else Nothing("it is no position")
            return replace(value, aux=held.aux, taught=value.taught or held.taught)
        case ("aux", axis):
            return held.with_aux(axis, number_in(value))
    return Nothing("a part of it known only at run time is assigned")


def _position(here: Execution, name: str, key: str) -> Position:
    """Return the position that a variable holds, one of which nothing is known else."""
    held = here.store.read(key)
    if isinstance(held, Position):
        return held
    type_ = here.world.type_of(here.place, name)
    joints = type_ is not None and type_.name == "jointpos"
    never = isinstance(held, Nothing) and held.code is Code.NO_VALUE
    return Position(joints, aux=() if never else None)
