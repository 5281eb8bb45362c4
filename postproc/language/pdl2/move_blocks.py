"""Blocks of moves of PDL2 to known places, with calls between them that do nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, Ints, all_in_rows
from postproc.language import ir
from postproc.language.analysis.found_goals import FoundVisit
from postproc.language.analysis.move_blocks import (
    MoveBlock,
    PlainMove,
    PlainMoves,
    Runs,
    TargetSlots,
    choose_examples,
    find_plain,
    find_runs,
    number_rows,
    split_by,
)
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.calls import call_statement, calls_in_expressions
from postproc.language.pdl2.entries import Entries
from postproc.language.pdl2.evaluate import Execution
from postproc.language.pdl2.external_routines import stays_still
from postproc.language.pdl2.job import Place, World
from postproc.language.pdl2.machine import MOST_AXES, Machine
from postproc.language.pdl2.moves import read_move
from postproc.language.pdl2.side_effects import CHANGING, PURE, list_invoked
from postproc.language.text.statement_table import Statements
from postproc.language.text.symbol_column import NameColumn
from postproc.language.text.templates import number_in_order

# Lines that are run a thousand at a time: moves to known places, idle calls.
#
# Such a line changes the store, if at all, in the same way however often it is run, and
# reads nothing that another one changes: running one line of every variant runs them
# all. Which lines are plain is told by the text alone, so that a block of them is the
# same block each time that the analysis comes to it.

_NOT_WITH = ("$move_type", "$tool", "$base", "$uframe")
_WRITTEN, _ALONE = -1, -2  # instead of a row of the variable file


def _read_line(one: ir.SourceStatement) -> PlainMove | None:
    """Read a line whose numbered names are open: a plain move, or a call.

    None for all others. WITH may set numbers.
    """
    if isinstance(one, ir.Instruction):
        idle = PlainMove("", counting=())
        return None if isinstance(one, ast.ProgramCall) else idle
    if not isinstance(one, ast.Move) or one.how != "TO":
        return None
    other = one.arm or one.via or one.til is not None or one.sync
    if other or one.trajectory not in ("JOINT", "LINEAR", ""):
        return None
    where, found = one.where[0], [_slot_of(setting) for setting in one.settings]
    slots = tuple(slot for slot in found if slot is not None)
    system = isinstance(where, ir.DataObject) and where.name.startswith("$")
    if system or len(slots) < len(found):
        return None
    return PlainMove.to(where, _slots_of, counting=slots)


def _slot_of(setting: ir.Assignment) -> int | None:
    """Return the number that WITH sets, None where it sets anything else."""
    name, value = setting.target.name, setting.value
    plain = not setting.target.steps and name.startswith("$") and name not in _NOT_WITH
    return value.slot if plain and isinstance(value, ir.Num) else None


def _slots_of(operand: ir.Operand | None) -> TargetSlots | None:
    """Return the six numbers of a written target, None for all other operands."""
    items: Sequence[ir.Operand | None] = ()
    match operand:
        case ir.Composite(items):
            pass
        case ir.FunctionCall("pos") as call:
            last = isinstance(call.values[-1], ir.StringLiteral) if call.values else 0
            items = call.values[:-1] if last else call.values
    slots = tuple(item.slot for item in items if isinstance(item, ir.Num))
    return TargetSlots(slots) if len(slots) == len(items) == 6 else None


def _are_sound(target: TargetSlots, numbers: Floats) -> Bools:
    return all_in_rows(np.isfinite(numbers))


class BodyLines:
    """The plain lines of a body.

    Attributes:
        plain: Those of its program that may be.
        first: Its first row.
        variant: Index into the moves of the program of each of its rows, (n,), -1 where
            it is not plain.
        statements: What the lines of each variant say, but for numbers and points.
        calls: Which of them call something.
        runs: The blocks.
        goal: Index into `names` of where each row goes, (n,), -1 where it is written.
        names: Names of variables, in lower case, that lines go to.
        own: Which of them are variables of the program itself, and no arrays, (m,).
        rows: Rows of those in the variable file, -1 where it tells none.
        prefix: What keys of the program's own variables begin with.
    """

    def __init__(self, world: World, place: Place, plain: PlainMoves) -> None:
        """Find them.

        Args:
            world: The files of the job.
            place: The body.
            plain: The lines of its program that may be.
        """
        self._world, self._place, self.plain = world, place, plain
        body = place.body
        self._parameters = {*body.parameters}
        self.first, self.prefix = body.first + 1, f"{place.program.name}/"
        variant = plain.variant[self.first : body.last].astype(np.int64)
        number, example = number_in_order(variant)
        self.statements, self.calls = dict[int, ir.SourceStatement](), set[int]()
        quiet = np.ones(len(example), dtype=bool)
        for k, at in enumerate(example.tolist()):
            if (own := int(variant[at])) < 0:
                continue
            one = place.program.lines.statement(self.first + at)
            called = _calls(world, place, one)
            quiet[k] = all(map(self._does_nothing, called))
            self.statements[own] = one
            self.calls |= {own} if called else set()
        variant[~quiet[number]] = -1
        self._find_names(plain, variant)
        self.variant = variant
        joins = body.flow.joins
        self.runs: Runs = find_runs(self.first, joins, plain, variant)
        self.rows = world.initial.rows(self.prefix, self.names)
        self.rows[~self.own] = -1

    def _find_names(self, plain: PlainMoves, variant: Ints) -> None:
        """Find the variables that lines go to; leave those to anything but a point."""
        shapes = self._place.program.lines.shapes
        at = np.flatnonzero(plain.named[variant])
        open_name = plain.name[self.first + at].astype(np.int64)
        # A name of its own, or the one that all of its variant go to.
        code = np.where(open_name >= 0, open_name, -1 - variant[at])
        used, which = np.unique(
            2 * code + plain.indexed[variant[at]], return_inverse=True
        )
        code, array = used // 2, (used % 2).astype(bool)
        literal = [plain.moves[-1 - k].name for k in code[code < 0].tolist()]
        self.names = NameColumn(literal)
        self.names.extend(shapes.names.take(code[code >= 0]).lower())
        points, self.own = self._find_points(array)
        self.goal = np.full(len(variant), -1, dtype=np.int64)
        self.goal[at] = which
        variant[at[~points[which]]] = -1

    def _find_points(self, array: Bools) -> tuple[Bools, Bools]:
        """Tell which names are those of points, and which are the program's own, (m,).

        Args:
            array: Which are followed by an index, (m,).
        """
        place, names = self._place, self.names
        declared = place.program.variables
        points = np.where(
            array,
            declared.passing(names, lambda said: _is_point(said.type, True)),
            declared.passing(names, lambda said: _is_point(said.type, False)),
        )
        own = ~declared.passing(names, lambda said: bool(said.exported))
        own &= ~array & (not any(mark in self.prefix for mark in "[."))
        hiding = NameColumn(sorted(place.body.own_names | self._world.volatile))
        for k in np.flatnonzero(hiding.find(names) >= 0).tolist():
            points[k], own[k] = self._is_point(names[k], bool(array[k])), False
        return points, own & points

    def _is_point(self, name: str, array: bool) -> bool:
        """Tell whether a name is a variable whose value no call changes unseen."""
        if name in self._parameters or name in self._world.volatile:
            return False
        return _is_point(self._world.type_of(self._place, name), array)

    def _does_nothing(self, call: ir.FunctionCall) -> bool:
        """Tell whether a call neither moves the arm nor sets what moves depend on."""
        name = call.name
        if self._world.find_routine(self._place.program, name) is not None:
            return False
        bare = name not in CHANGING and name not in PURE
        if bare and not stays_still(self._world, self._place.program, name):
            return False
        return all(self._keeps(a, bare) for a in call.values)

    def _keeps(self, argument: ir.Operand | None, bare: bool) -> bool:
        """Tell whether nothing that moves depend on is known by an argument's name."""
        match argument:
            case None | ir.Num() | ir.StringLiteral() | ir.Operation(_, (ir.Num(),)):
                return True
            case ir.DataObject(name, ()):
                type_ = self._world.type_of(self._place, name)
                safe = type_ is None or not (
                    type_.name in ast.POINTS or type_.array or type_.path
                )
                known = name.startswith("$") or name in self._parameters
                return bare and safe and not known
        return False


def _is_point(type_: ast.Type | None, array: bool) -> bool:
    """Tell whether a type is that of a point, or of an array of them."""
    if type_ is None or type_.name not in ast.POINTS or type_.path:
        return False
    return type_.array == array


def _calls(
    world: World, place: Place, said: ir.SourceStatement
) -> list[ir.FunctionCall]:
    """List the calls in a line, those by a function's name alone too."""
    found = list_invoked(world, place, said)
    if isinstance(said, ir.Instruction):
        found.append(ir.FunctionCall(said.name, said.arguments))
    return found


@dataclass
class MoveBlocks:
    """The blocks of a job, found when a body is first come to."""

    machine: Machine
    _plain: dict[int, PlainMoves] = field(default_factory=dict)
    _lines: dict[int, BodyLines] = field(default_factory=dict)
    _kinds: Ints | None = None
    _written: dict[tuple[int, int], MoveBlock] = field(default_factory=dict)

    def run(self, here: Execution) -> bool:
        """Run the block that begins at a row; tell whether there is one.

        Where a condition handler may move the arm at any time there is none: every
        move may then come from elsewhere. Nor is there where the moves may be another
        arm's.
        """
        if self.machine.interrupted or here.other_default():
            return False
        lines = self._lines_of(here.world, here.place)
        end, first = lines.runs.get(here.row), (id(here.place.body), here.row)
        if end is None:
            return False
        block = self._written.get(first)
        if block is None or block.modes is not here.store.settings:
            block = self._read(here, lines, end)
            own = slice(first[1] - lines.first, end - lines.first)
            calls = not lines.calls.isdisjoint(lines.variant[own].tolist())
            if not calls and (lines.goal[own] < 0).all():
                self._written[first] = block
        # Moves to written numbers are the same ones again under the same settings:
        # what differs is where the arm comes from.
        come = self.machine.predecessors(here)
        arrived = self.machine.record(here, 0, replace(block, origins=come))
        here.store.last, here.row = frozenset({arrived}), end
        return True

    def _lines_of(self, world: World, place: Place) -> BodyLines:
        program, body = place.program, place.body
        if id(program) not in self._plain:
            found = find_plain(program.lines, _read_line, _are_sound)
            self._plain[id(program)] = found
        if id(body) not in self._lines:
            self._lines[id(body)] = BodyLines(world, place, self._plain[id(program)])
        return self._lines[id(body)]

    def _read(self, here: Execution, lines: BodyLines, end: int) -> MoveBlock:
        """Run the lines of a block; return its moves."""
        place, begin = here.place, here.row
        rows, plain = np.arange(begin, end), self._plain[id(place.program)]
        variant = lines.variant[rows - lines.first]
        self._run_one_of_each(here, lines, rows, variant)
        going = plain.going[variant]
        rows, variant = rows[going], variant[going]
        points = _find_rows(here, lines, rows)
        text, entries = place.program.lines, here.world.initial.entries
        at = np.maximum(points, 0)
        origin = text.first[rows].astype(np.int64)
        columns, named = [variant], points >= 0
        if named.any():
            origin = np.where(named, entries.slots[at, 0], origin)
            columns.append(np.where(named, self._kinds_of(here.world)[at], -1))
        if marked := here.world.taught_lines[text.source.name]:
            columns.append(np.isin(text.begin_line[rows], sorted(marked)).astype(int))

        def read(k: int) -> FoundVisit:
            here.row = int(rows[k])
            one = text.statement(here.row)
            assert isinstance(one, ast.Move)
            return read_move(here, one)

        def slots_at(k: int) -> tuple[int, ...]:
            base, target = here.world.initial.base, plain.moves[variant[k]].target
            if target is None:
                return tuple((base + entries.slots[points[k]]).tolist())
            return tuple(place.first + int(origin[k]) + slot for slot in target.slots)

        chosen = choose_examples(columns, points == _ALONE, read, slots_at)
        here.row, more = begin, dict[str, Any]()
        if named.any():
            more["names"], more["values"] = entries.name.take(at), entries.numbers[at]
            more["aux"] = _read_aux(entries, points)
        return MoveBlock.of(chosen, rows, origin, modes=here.store.settings, **more)

    def _run_one_of_each(
        self, here: Execution, lines: BodyLines, rows: Ints, variant: Ints
    ) -> None:
        """Let the first line of every variant have its effects."""
        for k in number_in_order(variant)[1].tolist():
            here.row, number = int(rows[k]), int(variant[k])
            statement = lines.statements[number]
            if number in lines.calls:
                calls_in_expressions(self.machine, here, statement)
            if isinstance(statement, ir.Instruction):
                call_statement(self.machine, here, statement)

    def _kinds_of(self, world: World) -> Ints:
        """Number points of the variable file by how they are written, (p,)."""
        if self._kinds is None:
            points, entries = world.initial, world.initial.entries
            slots = entries.slots - entries.slots[:, :1]
            columns = [entries.layout, points.taught, points.shared, *slots.T]
            whole = [column.astype(np.int64) for column in columns]
            self._kinds = number_rows(whole, len(slots))[0]
        return self._kinds


def _read_aux(entries: Entries, points: Ints) -> Floats | None:
    """Return auxiliary axes, (k, a), by rows of the variable file; None for none."""
    found = None
    layout = np.where(points >= 0, entries.layout[np.maximum(points, 0)], -1)
    for number, mine in split_by(layout):
        axes = entries.layouts[number].axes if number >= 0 else ()
        for column, axis in enumerate(axes):
            if 1 <= axis <= MOST_AXES:
                if found is None:
                    found = np.full((len(points), MOST_AXES), np.nan)
                found[mine, axis - 1] = entries.aux[points[mine], column]
    return found


def _find_rows(here: Execution, lines: BodyLines, rows: Ints) -> Ints:
    """Find the rows of the variable file that moves go to, (k,).

    `_WRITTEN` stands for numbers in the move, `_ALONE` for what is read by itself.
    """
    text, initial = here.place.program.lines, here.world.initial
    goal, plain = lines.goal[rows - lines.first], lines.plain
    points = np.full(len(rows), _WRITTEN, dtype=np.int64)
    named = np.flatnonzero(goal >= 0)
    goal = goal[named]
    points[named] = np.where(lines.rows[goal] >= 0, lines.rows[goal], _ALONE)
    asked = ~lines.own[goal] | _find_assigned(here, lines, goal)
    for at, name in zip(named[asked].tolist(), goal[asked].tolist(), strict=True):
        row = int(rows[at])
        key = lines.prefix + lines.names[name]
        if not lines.own[name]:
            index = plain.moves[lines.variant[row - lines.first]].index
            root = here.world.root(here.place, lines.names[name])
            key = _key(text, row, root, index)
        assigned = here.store.get_assigned(key) if key else _ALONE
        points[at] = initial.point(key) if assigned is None else _ALONE
    points[named[points[named] < 0]] = _ALONE
    initial.used[points[points >= 0]] = True
    return points


def _find_assigned(here: Execution, lines: BodyLines, names: Ints) -> Bools:
    """Tell which of the program's own variables it has given a value itself, (m,)."""
    values, found = here.store.values, np.zeros(len(names), dtype=bool)
    own, prefix = np.flatnonzero(lines.own[names]), lines.prefix
    given = [*islice(values, len(own))]
    if len(given) < len(own):  # all that there are
        known = NameColumn(k[len(prefix) :] for k in given if k.startswith(prefix))
        found[own] = (known.find(lines.names) >= 0)[names[own]]
    else:
        keys = (prefix + lines.names[name] for name in names[own].tolist())
        found[own] = [values.get(key) is not None for key in keys]
    return found


def _key(
    lines: Statements[ir.SourceStatement], row: int, key: str, slots: tuple[int, ...]
) -> str:
    """Return where the point of a move is stored, "" where its index is not known."""
    index = [float(lines.value[lines.first[row] + slot]) for slot in slots]
    if not all(number.is_integer() for number in index):
        return ""
    element = ",".join(str(int(number)) for number in index)
    return f"{key}[{element}]" if slots else key
