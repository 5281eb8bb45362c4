"""What a statement, a routine or a call may do, read off the text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from postproc.language import ir
from postproc.language.analysis.call_graph import reach
from postproc.language.analysis.task_machine import MOVES
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import FRAMES
from postproc.language.pdl2.external_routines import (
    TRACKING,
    RoutineEffect,
    effect_of,
    report_unknown_routine,
)
from postproc.language.pdl2.job import Place, World
from postproc.language.pdl2.program import Program

PURE, CHANGING = ast.NAMES["pure"], ast.NAMES["changing"]

NODES = frozenset({"node_app", "node_del", "node_ins"})
"""Those of them that change how many nodes a path has, and no number in them."""

# What text may do that is not understood.

_WORD = re.compile(r"\$?[A-Za-z_]\w*")
_CALL = re.compile(r"(?<![\w$.])([A-Za-z_]\w*)\s*\(")
_HARMLESS = re.compile(
    r"(?:(?:IF|ELSE|ENDIF|SELECT|CASE|ENDSELECT|FOR|ENDFOR|WHILE|ENDWHILE|REPEAT|UNTIL|"
    r"WAIT|SIGNAL|DELAY|PULSE|WRITE|READ|ENCODE|DECODE|OPEN|CLOSE|ENABLE|DISABLE)\b|"
    r"\$?\w+(?:\[[^\]]*\]|\.\$?\w+)*\s*:=)",
    re.I,
)
_MOVING = re.compile(
    r"\b(?:MOVE|MOVEFLY|SYNCMOVE|SYNCMOVEFLY|CANCEL|EXIT|GOTO|RETURN|CALL)\b|\$ARM_DATA\b",
    re.I,
)
_STRING = re.compile(r"'[^']*'")
_NEXT = re.compile(r";|\b(?:THEN|ELSE|DO|REPEAT)\b|\bCASE\s*\([^)]*\)\s*:", re.I)


def words_in(text: str) -> frozenset[str]:
    """Return the names in a text, in lower case, system variables with ``$``."""
    return frozenset(word.lower() for word in _WORD.findall(text))


def is_harmless(text: str) -> bool:
    """Tell whether a statement that is not understood does nothing to the arm.

    It must begin like one that cannot move the arm or set frames (an assignment sets
    what it names), and call nothing but built-in functions. So must each further
    statement of its line.

    >>> is_harmless("WAIT FOR $DIN[1] ?? 3"), is_harmless("WAIT FOR f(1) ?? 3")
    (True, False)
    >>> is_harmless("n := abs(3 3)"), is_harmless("FROBNICATE p WITH 3")
    (True, False)
    >>> is_harmless("IF $DIN[1] THEN grip ENDIF"), is_harmless("n := 1 ?? CANCEL ALL")
    (False, False)
    """
    text = _STRING.sub("", text)
    parts = filter(None, map(str.strip, _NEXT.split(text)))
    if not all(map(_HARMLESS.match, parts)) or _MOVING.search(text):
        return False
    called = {name.lower() for name in _CALL.findall(text)}
    return called <= PURE | CHANGING | ast.NAMES["statement"]


class Effects(NamedTuple):
    """What statements may do, without the routines that they call.

    Attributes:
        moves: `MOVES` where one is a move, or text that is not understood.
        assigned: Names of variables and settings (with ``$``) that they may change.
        read: Names of variables and settings that occur in them.
        calls: Names that they call and their file does not hold.
        cancels: Those of them that end moves on their way.
    """

    moves: frozenset[str] = frozenset()
    assigned: frozenset[str] = frozenset()
    read: frozenset[str] = frozenset()
    calls: frozenset[str] = frozenset()
    cancels: frozenset[ir.SourceStatement] = frozenset()


def list_invoked(world: World, place: Place, *nodes: ir.Node) -> list[ir.FunctionCall]:
    """List the calls in nodes that may have effects, those by a name alone, too."""
    found, names = list[ir.FunctionCall](), set[str]()
    for part in ir.walk(*nodes):
        if isinstance(part, ir.FunctionCall):
            found += [part] if part.name not in PURE else []
        elif isinstance(part, ir.DataObject) and not part.steps:
            names.add(part.name)
    alone = sorted(name for name in names if world.is_function(place, name))
    return found + [ir.FunctionCall(name, ()) for name in alone]


def list_changed_arguments(
    arguments: tuple[ir.Operand | None, ...],
) -> list[ir.DataObject]:
    """Return the arguments that go by reference: variables by themselves."""
    return [a for a in arguments if isinstance(a, ir.DataObject)]


def rows_effects(program: Program, first: int, last: int) -> Effects:
    """Return what the statements of rows first to last - 1 may do."""
    every = map(_direct, _list_statements(program, first, last))
    found = Effects(*(frozenset().union(*own) for own in zip(*every, strict=True)))
    return found._replace(calls=found.calls.difference(program.routines))


def names_but_ends(program: Program, first: int, last: int) -> frozenset[str]:
    """Return the names in rows first to last - 1 but for destinations of moves."""
    found = set[str]()
    for one in _list_statements(program, first, last):
        move = ast.action(one)
        ends = [*move.where, move.via] if isinstance(move, ast.Move) else []
        found |= {r.name for r in ir.data_in(one) if all(r is not e for e in ends)}
    return frozenset(found)


def _list_statements(
    program: Program, first: int, last: int
) -> Iterator[ir.SourceStatement]:
    """Yield the distinct statements of rows."""
    shapes = np.unique(program.lines.shape[first:last])
    return (program.lines.said[shape] for shape in shapes.tolist())


_END = ir.Leave("exitcycle")


@lru_cache(maxsize=8192)
def _direct(statement: ir.SourceStatement) -> Effects:
    chain, calls, assigned = [statement], ir.calls_in(statement), set[str]()
    while (then := getattr(chain[-1], "then", None)) is not None:
        chain.append(then)
    called = {call.name for call in calls}
    changed = [a for call in calls if call.name not in PURE for a in call.values]
    for one in chain:
        match one:
            case ir.NotUnderstood(text):
                assigned |= words_in(text)
                assigned |= set() if is_harmless(text) else {f"${f}" for f in FRAMES}
            case ir.Assignment(target):
                changed.append(target)
            case ir.ForLoop(name):
                assigned.add(name)
            case ast.Transfer(word, operands) if word != "WRITE":
                changed += operands
            case ir.Instruction(name):
                called.add(name)
                changed += one.values
    assigned.update(map(_name_assigned, list_changed_arguments(tuple(changed))))
    if TRACKING in called:
        assigned.add(f"${TRACKING}")
    moving = any(isinstance(one, ast.Move | ir.NotUnderstood) for one in chain)
    moves = frozenset([MOVES] if moving else [])
    read = frozenset(data.name for data in ir.data_in(statement))
    ends = (one for one in chain[-1:] if isinstance(one, ast.CancelMove) or one == _END)
    called -= PURE | CHANGING
    return Effects(moves, frozenset(assigned), read, frozenset(called), frozenset(ends))


def _name_assigned(reference: ir.DataObject) -> str:
    if reference.name == "$arm_data" and len(reference.steps) >= 2:
        return f"${str(reference.steps[1]).lstrip('$')}"
    return reference.name


# What a call or a handler may do, through all files of the job.


LiveRows = tuple[Place, Effects]
"""Where rows stand that may run, and what they do; what they call are others."""


@dataclass(frozen=True)
class CallGraph:
    """All that may run because something runs.

    Attributes:
        parts: What runs first, then what it calls, in any file of the job.
        moves: It may move the arm, itself or by a routine that the job does not hold.
        frames: A routine that the job does not hold may set frames.
    """

    parts: tuple[LiveRows, ...]
    moves: bool
    frames: bool

    @property
    def cancels(self) -> frozenset[ir.SourceStatement]:
        """Statements that end moves on their way."""
        return frozenset().union(*(own.cancels for _, own in self.parts))

    @property
    def may_change(self) -> frozenset[str]:
        """Names of variables and settings (with ``$``) that may change."""
        names = frozenset().union(*(own.assigned for _, own in self.parts))
        return names | {f"${frame}" for frame in FRAMES if self.frames}


def call_graph_of(world: World, place: Place) -> CallGraph:
    """Follow a body into all that it calls; remembered for each body."""
    key = id(place.body)
    if key not in world.reached:
        world.reached[key] = live_rows(world, place, place.body.first, place.body.last)
    found = world.reached[key]
    assert isinstance(found, CallGraph)
    return found


def live_rows(world: World, place: Place, first: int, last: int) -> CallGraph:
    """Tell what rows first to last - 1 of a body may do, and all that they call."""
    parts = list_live(world, place, first, last)
    outside = {effect for part in parts for effect in _outside(world, *part)}
    moves = {RoutineEffect.MOVES, RoutineEffect.TRACKS, RoutineEffect.UNKNOWN}
    frames = {RoutineEffect.SETS_FRAMES, RoutineEffect.TABLE, RoutineEffect.UNKNOWN}
    moving = any(own.moves for _, own in parts) or bool(outside & moves)
    return CallGraph(parts, moving, bool(outside & frames))


def list_live(
    world: World, place: Place, first: int, last: int
) -> tuple[LiveRows, ...]:
    """Follow rows first to last - 1 of a body into all that they call."""
    parts = [(place, rows_effects(place.program, first, last))]
    whole = (first, last) == (place.body.first, place.body.last)
    for one in reach(
        _list_called(world, place, first, last),
        lambda one: _list_called(world, one, one.body.first, one.body.last),
        lambda one: id(one.body),
    ):
        if not (whole and one.body is place.body):  # else its rest may be called, too
            rows = (one.body.first, one.body.last)
            parts.append((one, rows_effects(one.program, *rows)))
    return tuple(parts)


def _outside(world: World, place: Place, own: Effects) -> Iterator[RoutineEffect]:
    """Yield what the routines do that some rows call and the job does not hold."""
    program = place.program
    for name in sorted(own.calls):
        inside = world.find_routine(program, name) or world.find_program(program, name)
        if inside is None:
            effect = effect_of(world, program, name)
            if effect is RoutineEffect.UNKNOWN:
                report_unknown_routine(world, program, place.body.first, name)
            yield effect


def _list_called(world: World, place: Place, first: int, last: int) -> Iterator[Place]:
    """Yield the bodies that rows name, as calls or in expressions."""
    for part in ir.walk(*_list_statements(place.program, first, last)):
        found = None
        if isinstance(part, ast.ProgramCall):
            found = world.find_program(place.program, part.name)
        elif isinstance(part, ir.Instruction | ir.FunctionCall):
            found = world.find_routine(place.program, part.name)
        elif isinstance(part, ir.DataObject) and not part.steps:
            found = world.find_routine(place.program, part.name)
        if found is not None:
            yield found


def has_target(statement: ir.SourceStatement) -> bool:
    """Tell whether a line moves to a target, and not to a system variable.

    A move that names its arm may be one of another arm, and does not count.
    """
    move = ast.action(statement)
    return isinstance(move, ast.Move) and not move.arm and goes_to_target(move)


def goes_to_target(move: ast.Move) -> bool:
    """Tell whether a move goes to a place that is no system variable."""
    if move.how != "TO":
        return False
    where = move.where[0] if move.where else None
    return not (isinstance(where, ir.DataObject) and where.name.startswith("$"))
