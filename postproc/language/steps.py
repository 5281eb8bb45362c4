"""What each statement does to the store, and which way the program goes on."""

from __future__ import annotations

import re

from postproc.language import pdl2 as ast
from postproc.language.arrivals import Arrival
from postproc.language.assign import assign
from postproc.language.blocks import recovered
from postproc.language.calls import call_statement, calls_in_expressions
from postproc.language.effects import changed_arguments, rows_effects
from postproc.language.forgetting import forget, forget_names, pin_names
from postproc.language.loops import end_round, start_loop
from postproc.language.machine import Here, Machine
from postproc.language.moves import move
from postproc.language.values import Nothing, Value
from postproc.language.visits import ELSEWHERE, Motion, Target

_WORD = re.compile(r"\$?[A-Za-z_]\w*")
_CANNOT_MOVE = re.compile(
    r"(?:IF|ELSE|ENDIF|SELECT|CASE|ENDSELECT|FOR|ENDFOR|WHILE|ENDWHILE|REPEAT|UNTIL|"
    r"WAIT|SIGNAL|DELAY|PULSE|WRITE|READ|ENCODE|DECODE|OPEN|CLOSE|ENABLE|DISABLE|"
    r"\$?\w+(?:\[[^\]]*\]|\.\$?\w+)*\s*:=)",
    re.I,
)
_MOVES = re.compile(r".*\b(?:MOVE|MOVEFLY|SYNCMOVE|SYNCMOVEFLY)\b", re.I)


def step(machine: Machine, here: Here, statement: ast.Statement) -> bool:
    """Run one statement; tell whether the next row follows."""
    statement = recovered(statement)
    if not isinstance(statement, ast.Label | ast.Else | ast.When):
        calls_in_expressions(machine, here, statement)
    match statement:
        case ast.Move():
            move(machine, here, statement)
        case ast.Assign():
            line = int(here.place.program.lines.line[here.row])
            taught = (
                line in here.world.taught_lines[here.place.program.lines.source.name]
            )
            assign(here, statement, taught)
        case ast.Call():
            return not call_statement(machine, here, statement)
        case ast.Label(_, then) | ast.Case(_, then) | ast.Else(then) | ast.When(then):
            return then is None or step(machine, here, then)
        case ast.Transfer("WRITE", operands):
            for operand in operands:
                here.world.pin(here.value(operand), "the program writes it out")
        case ast.Transfer(word, operands):
            for operand in changed_arguments(operands):
                forget(here, operand, f"{word} changes it")
        case ast.Unknown():
            _unknown(machine, here, statement)
        case _:
            return _control(machine, here, statement)
    return True


def _control(machine: Machine, here: Here, statement: ast.Statement) -> bool:
    blocks, row = here.place.body.blocks, here.row
    match statement:
        case ast.If(condition):
            inner = blocks.inner[row]
            otherwise = inner[0] if inner else blocks.end[row]
            return _branch(machine, here, condition, row + 1, otherwise, True)
        case ast.While(condition):
            return _branch(machine, here, condition, row + 1, blocks.end[row] + 1)
        case ast.Until(condition):
            return _branch(machine, here, condition, row + 1, blocks.opener[row])
        case ast.EndWhile():
            machine.push(here.context, blocks.opener[row], here.store)
        case ast.Select(value):
            _select(machine, here, here.value(value))
        case ast.For():
            start_loop(machine, here, statement)
        case ast.EndFor():
            end_round(machine, here)
        case ast.Goto(label):
            machine.push(here.context, blocks.labels[label], here.store)
        case ast.ExitCycle() if blocks.cycle >= 0:
            machine.push(here.context, blocks.cycle, here.store)
        case ast.Return():
            machine.leave(here, by_return=True)
        case ast.Condition():
            machine.go_on(here.context, blocks.end[row] + 1, here.store)
        case ast.EndCondition():
            pass
        case _:
            return True
    return False


def _branch(
    machine: Machine,
    here: Here,
    condition: ast.Expression | None,
    then: int,
    otherwise: int,
    enters: bool = False,
) -> bool:
    """Go both ways, or the one that is known; `otherwise` may enter an ELSE."""
    truth = here.value(condition) if condition is not None else None
    if truth is not True:
        go = machine.push if enters else machine.go_on
        go(here.context, otherwise, here.store)
    if truth is not False:
        machine.go_on(here.context, then, here.store)
    return False


def _select(machine: Machine, here: Here, value: Value) -> None:
    """Go to every CASE that may be meant."""
    blocks = here.place.body.blocks
    for row in blocks.inner[here.row]:
        statement = here.place.program.statement(row)
        if isinstance(statement, ast.Case):
            fits = _fits(here, row, statement, value)
            if fits is not False:
                machine.push(here.context, row, here.store)
            if fits is True:
                return
        else:
            machine.push(here.context, row, here.store)
            return
    machine.push(here.context, blocks.end[here.row], here.store)


def _fits(here: Here, row: int, case: ast.Case, value: Value) -> bool | None:
    """Tell whether a CASE means a value, None where it is not known."""
    at = Here(here.world, here.place, row, here.store, here.volatile, here.context)
    found: bool | None = not case.choices and None
    for choice in case.choices:
        low, high = choice if isinstance(choice, tuple) else (choice, choice)
        a, b = at.value(low), at.value(high)
        known = type(a) is type(value) and type(b) is type(value)
        if not known or not isinstance(value, float | str):
            found = None
        elif a <= value <= b:  # type: ignore[operator]
            return True
    return found


def _unknown(machine: Machine, here: Here, statement: ast.Unknown) -> None:
    """Forget all that unknown text could influence."""
    line = int(here.place.program.lines.line[here.row])
    why = f"line {line}, which is not understood, may change it"
    names = frozenset(word.lower() for word in _WORD.findall(statement.text))
    forget_names(here, names, why)
    if _MOVES.match(statement.text):
        arrival = Arrival(
            here.place,
            here.row,
            machine.predecessors(here),
            here.store.settings,
            Motion.JOINT,
            Target.UNKNOWN,
            reason="the move statement is not understood",
        )
        here.store.last = frozenset({machine.record(here, 1, arrival), ELSEWHERE})
    elif not _CANNOT_MOVE.match(statement.text):
        here.store.last |= {ELSEWHERE}


def run_broken(machine: Machine, here: Here) -> None:
    """List the moves of a body whose blocks do not close; follow none of them."""
    body = here.place.body
    program = here.place.program
    why = f"the block structure is broken (line {body.blocks.broken})"
    here.reason = why
    for row in range(body.first + 1, body.last):
        said = ast.action(program.statement(row))
        if isinstance(said, ast.Move):
            here.row = row
            here.store.last = frozenset({ELSEWHERE})
            move(machine, here, said)
    effects = rows_effects(program, body.first, body.last)
    pin_names(here, effects.read, f"{why}: it may be used in a computation")
    forget_names(here, effects.assigned, why)
    here.store.set(tool=Nothing(why), base=Nothing(why), uframe=Nothing(why))
    here.store.last = frozenset({ELSEWHERE})
    machine.leave(here)
