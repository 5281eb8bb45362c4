"""Blocks of moves to known places, run a thousand at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.language import ir
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.calls import call_statement, calls_in_expressions
from postproc.language.pdl2.evaluate import Execution
from postproc.language.pdl2.external_routines import stays_still
from postproc.language.pdl2.job import Place, World
from postproc.language.pdl2.machine import (
    HELD,
    WRITTEN,
    Machine,
    MoveBlock,
    MoveForm,
    Pdl2Goal,
)
from postproc.language.pdl2.moves import UNSURE, from_value, motion_of
from postproc.language.pdl2.program import ProgramLines
from postproc.language.pdl2.side_effects import CHANGING, PURE, list_invoked
from postproc.language.pdl2.values import Nothing
from postproc.language.text.symbol_column import NameColumn
from postproc.language.text.templates import alike, name_index, number_in_order
from postproc.language.visits import Meaning
from postproc.robot.trajectory import Motion

# Lines that are run a thousand at a time: moves to known places, idle calls.
#
# Such a line changes the store, if at all, in the same way however often it is run, and
# reads nothing that another one changes: running one line of every variant runs them
# all. Whether a line is quiet is told by the text alone, so that a stretch of them is
# the same stretch each time that the analysis comes to it.

_POINTS = ("position", "xtndpos", "jointpos")
_NOT_WITH = ("$move_type", "$tool", "$base", "$uframe")


class PlainMoves:
    """The quiet lines of a body.

    Attributes:
        first: Row of the first line that `variant` tells of.
        variant: Index into `statements` of every row, (n,), -1 where it is not quiet.
        statements: What the lines of each variant say, but for numbers and points.
        forms: What moves of each variant have in common, see `_form`; None for calls.
        calls: Which of them call something.
        points: Where the point is stored that lines of a shape go to, unless `name`
            tells it; of an array's elements the beginning, and slots of the index.
        prefix: What keys of the program's own variables begin with.
        names: Names, in lower case, of the program's own variables that lines go to.
        rows: Their rows in the variable file, -1 where it tells none.
        name: Index into `names` for every row, (n,), -1 for none.
        ends: Rows at which stretches end, ascending.
    """

    def __init__(
        self, world: World, place: Place, volatile: frozenset[str], may_be: Bools
    ) -> None:
        """Find them.

        Args:
            world: The files of the job.
            place: The body.
            volatile: Names that condition handlers change.
            may_be: Which shapes of the program may be those of quiet lines, (k,).
        """
        self._world, self._place, self._volatile = world, place, volatile
        program, body = place.program, place.body
        self._parameters = {p.name for p in body.parameters}
        self.statements: list[ir.SourceStatement] = []
        self.points: dict[int, tuple[str, tuple[int, ...]]] = {}
        self.prefix, self.names = f"{program.name}/", NameColumn()
        self.first = first = body.first + 1
        shape = program.lines.shape[first : body.last]
        self._shapes, own = np.unique(shape, return_inverse=True)
        self._name = np.full(len(self._shapes), -1, dtype=np.int64)
        of_shape, shapes = self._name.copy(), self._shapes[may_be[self._shapes]]
        forms = program.lines.said.form[shapes]
        kinds, begins = np.unique(np.sort(forms), return_index=True)
        groups = np.split(shapes[np.argsort(forms, kind="stable")], begins[1:])
        for form, mine in zip(kinds.tolist(), groups, strict=False):
            of_shape[np.searchsorted(self._shapes, mine)] = self._add(form, mine)
        self.variant: Ints = of_shape[own]
        joins = np.array(sorted(body.flow.joins), dtype=np.int64)
        loud = first + np.flatnonzero(self.variant < 0)
        self.ends: Ints = np.unique(np.concatenate([loud, joins, [body.last]]))
        said = self.statements
        self.forms = [*map(_form, said)]
        self.calls = [any(_calls(world, place, one)) for one in said]
        self.rows = world.initial.rows(self.prefix, self.names)
        self.name: Ints = self._name[own]

    def end(self, row: int) -> int:
        """Return the row after the stretch of a move, the row itself if none."""
        at = self.variant[row - self.first] if self.first <= row else -1
        if at < 0 or not isinstance(self.statements[at], ast.Move):
            return row
        return int(self.ends[np.searchsorted(self.ends, row, side="right")])

    def _add(self, form: int, shapes: Ints) -> Ints:
        """Return the variants of shapes of one form, -1 where one is not quiet."""
        said = self._place.program.lines.said
        one = said.said[form]
        where = one.where[0] if isinstance(one, ast.Move) else None
        names = said.shapes.names_at(shapes)
        if not isinstance(where, ir.DataObject):
            return self._variants(shapes, names)
        index, at = _number_slots(where.steps), name_index(where.name)
        variants = np.full(len(shapes), -1)
        if index is None:
            return variants
        goal, which = NameColumn([where.name]), np.zeros(len(shapes), dtype=np.int64)
        if at >= 0:
            used, which = np.unique(names[:, at], return_inverse=True)
            goal = said.shapes.names.take(used.astype(np.int64)).lower()
            names = np.delete(names, at, axis=1)
        quiet = self._points(shapes, goal, which, index, array=bool(where.steps))
        variants[quiet] = self._variants(shapes[quiet], names[quiet])
        return variants

    def _points(
        self,
        shapes: Ints,
        goal: NameColumn,
        which: Ints,
        index: tuple[int, ...],
        array: bool,
    ) -> Bools:
        """Enter where shapes go, and tell which of them go to a point, (m,).

        Args:
            shapes: Shapes of one form, (m,).
            goal: Names that they go to.
            which: The one of each, (m,).
            index: Number slots of an element's index.
            array: Whether there is any.
        """
        place = self._place
        declared = place.program.variables
        points = declared.passing(goal, lambda said: _is_point(said.type, array))
        alone = ~declared.passing(goal, lambda said: bool(said.exported))
        alone &= not array and not any(mark in self.prefix for mark in "[.")
        hidden = NameColumn(sorted(place.body.own_names | self._volatile)).find(goal)
        for k in np.flatnonzero(hidden >= 0).tolist():
            points[k], alone[k] = self._is_point(goal[k], array), False
        own = np.flatnonzero((points & alone)[which])
        at = np.searchsorted(self._shapes, shapes[own])
        self._name[at] = len(self.names) + which[own]
        self.names.extend(goal)
        for k in np.flatnonzero((points & ~alone)[which]).tolist():
            key = self._world.root(place, goal[which[k]])
            self.points[int(shapes[k])] = key, index
        found: Bools = points[which]
        return found

    def _variants(self, shapes: Ints, names: Ints) -> Ints:
        """Return the variants of shapes of one form with some names, (m,)."""
        ends = names.shape[1] * np.arange(1, len(shapes) + 1)
        kind = alike(names.ravel(), ends - names.shape[1], ends)
        found = []
        for k in number_in_order(kind)[1].tolist():
            one = self._place.program.lines.said[int(shapes[k])]
            quiet = all(map(self._does_nothing, _calls(self._world, self._place, one)))
            found.append(len(self.statements) if quiet else -1)
            self.statements += [one] if quiet else []
        return np.array(found, dtype=np.int64)[kind]

    def _is_point(self, name: str, array: bool) -> bool:
        """Tell whether a name is a variable whose value no call changes unseen."""
        if name in self._parameters or name in self._volatile:
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
                safe = type_ is None or (
                    type_.name not in _POINTS and not type_.array and not type_.path
                )
                known = name.startswith("$") or name in self._parameters
                return bare and safe and not known
        return False


def _may_be_plain(said: ir.SourceStatement) -> bool:
    if isinstance(said, ir.Instruction):
        return not isinstance(said, ast.ProgramCall)
    return _form(said) is not None


def _form(move: ir.SourceStatement) -> MoveForm | None:
    """Return what moves alike have in common, but for their trajectory.

    None unless they go to numbers or a variable. WITH may set numbers.
    """
    if not isinstance(move, ast.Move) or move.how != "TO":
        return None
    other = move.arm or move.via or move.til is not None or move.sync
    if other or move.trajectory not in ("JOINT", "LINEAR", ""):
        return None
    overrides = []
    for one in move.settings:
        name, plain = one.target.name, not one.target.steps
        plain = plain and name.startswith("$") and name not in _NOT_WITH
        if not (plain and isinstance(one.value, ir.Num)):
            return None
        overrides.append((name.lstrip("$"), one.value.slot))
    form = MoveForm(Motion.JOINT, fly=move.fly, overrides=tuple(overrides))
    items: Sequence[ir.Operand | None] = ()
    config = joints = None
    match move.where[0]:
        case ir.DataObject(name, () | (ir.ElementStep(_),)):
            return None if name.startswith("$") else form
        case ir.Composite(items):
            joints = True
        case ir.FunctionCall("pos") as call:
            *items, config = (*call.values, None)
            if items and isinstance(items[-1], ir.StringLiteral):
                *items, config = items
    slots = tuple(item.slot for item in items if isinstance(item, ir.Num))
    if not len(slots) == len(items) == 6:
        return None
    written = config.text if isinstance(config, ir.StringLiteral) else None
    return replace(form, slots=slots, joints=bool(joints), config=written)


def _is_point(type_: ast.Type | None, array: bool) -> bool:
    """Tell whether a type is that of a point, or of an array of them."""
    if type_ is None or type_.name not in _POINTS or type_.path:
        return False
    return type_.array == array


def _number_slots(steps: tuple[str | ir.ElementStep, ...]) -> tuple[int, ...] | None:
    """Return the slots of an index that is written in numbers, None for any other."""
    index = [
        i for step in steps if isinstance(step, ir.ElementStep) for i in step.subscripts
    ]
    slots = tuple(i.slot for i in index if isinstance(i, ir.Num))
    return slots if len(slots) == len(index) else None


def _calls(
    world: World, place: Place, said: ir.SourceStatement
) -> list[ir.FunctionCall]:
    """List the calls in a line, those by a function's name alone too."""
    found = list_invoked(world, place, said)
    if isinstance(said, ir.Instruction):
        found.append(ir.FunctionCall(said.name, said.arguments))
    return found


# Run a stretch of quiet lines at once.

LEAST = 2  # lines that are worth it
_NO_INDEX = Nothing("its index is known only at run time")
_OF_EACH = Pdl2Goal(Meaning.UNKNOWN)  # each move of a block has its own


@dataclass
class MoveBlocks:
    """The stretches of quiet lines of a job, found when a body is first come to."""

    machine: Machine
    quiet: dict[int, PlainMoves] = field(default_factory=dict)
    _may_be: dict[int, Bools] = field(default_factory=dict)
    _written: dict[tuple[int, int], MoveBlock] = field(default_factory=dict)

    def run(self, here: Execution) -> bool:
        """Run the stretch that begins at a row; tell whether there is one.

        Where a condition handler may move the arm at any time there is none: every
        move may then come from elsewhere. Nor is there where the moves may be another
        arm's.
        """
        if self.machine.interrupted or here.other_default():
            return False
        quiet = self._quiet(here)
        end = quiet.end(here.row)
        if end - here.row < LEAST:
            return False
        first = (id(here.place.body), here.row)
        run = self._written.get(first)
        if run is None or run.modes is not here.store.settings:
            rows = np.arange(here.row, end)
            variant = quiet.variant[rows - quiet.first]
            run = self._run_all(here, quiet, rows, variant)
            calls = np.array(quiet.calls)[variant].any()
            if not calls and (run.point == WRITTEN).all():
                self._written[first] = run
        # Moves to written numbers are the same ones again under the same settings:
        # what differs is where the arm comes from.
        here.row, come = run.at, self.machine.predecessors(here)
        arrived = self.machine.record(here, 0, replace(run, origins=come))
        here.store.last, here.row = frozenset({arrived}), end
        return True

    def _run_all(
        self, here: Execution, quiet: PlainMoves, rows: Ints, variant: Ints
    ) -> MoveBlock:
        """Run the lines of a stretch; return its moves."""
        forms = self._run_one_of_each(here, quiet, rows, variant)
        moves = np.isin(variant, np.array([*forms], dtype=np.int64))
        rows, variant = rows[moves], variant[moves]
        here.row = int(rows[0])
        point, goals = np.full(len(rows), WRITTEN), dict[int, Pdl2Goal]()
        if not all(form.slots for form in forms.values()):
            point, goals = _points(here, quiet, rows, variant)
        return MoveBlock(
            here.place, Motion.JOINT, False, _OF_EACH, here.store.settings,
            count=len(rows), at=here.row, at_once=rows, form=variant, forms=forms,
            point=point, goals=goals,
        )  # fmt: skip

    def _quiet(self, here: Execution) -> PlainMoves:
        program, body = here.place.program, here.place.body
        if id(program) not in self._may_be:
            self._may_be[id(program)] = program.lines.said.which(_may_be_plain)
        if id(body) not in self.quiet:
            self.quiet[id(body)] = PlainMoves(
                here.world, here.place, here.world.volatile, self._may_be[id(program)]
            )
        return self.quiet[id(body)]

    def _run_one_of_each(
        self, here: Execution, quiet: PlainMoves, rows: Ints, variant: Ints
    ) -> dict[int, MoveForm]:
        """Let the first line of every variant have its effects.

        Returns:
            The forms of the moves, with their trajectories, by variant.
        """
        found, first = np.unique(variant, return_index=True)
        forms = {}
        for at in np.argsort(first).tolist():
            here.row = int(rows[first[at]])
            number = int(found[at])
            statement, form = quiet.statements[number], quiet.forms[number]
            if quiet.calls[number]:
                calls_in_expressions(self.machine, here, statement)
            if isinstance(statement, ir.Instruction):
                call_statement(self.machine, here, statement)
            elif isinstance(statement, ast.Move) and form is not None:
                motion, reason = motion_of(here, statement, here.store.settings)
                forms[number] = replace(form, motion=motion, reason=reason)
        return forms


def _points(
    here: Execution, quiet: PlainMoves, rows: Ints, variant: Ints
) -> tuple[Ints, dict[int, Pdl2Goal]]:
    """Look up the variables that moves go to, see `MoveBlock`."""
    program, initial = here.place.program, here.world.initial
    point = np.full(len(rows), WRITTEN, dtype=np.int64)
    goals: dict[int, Pdl2Goal] = {}
    to_points = [form is not None and not form.slots for form in quiet.forms]
    named = np.flatnonzero(np.array(to_points, dtype=bool)[variant])
    shapes = program.lines.shape[rows[named]]
    own = quiet.name[rows[named] - quiet.first]
    point[named] = HELD
    point[named[own >= 0]] = quiet.rows[own[own >= 0]]
    asked = (point[named] < 0) | _find_assigned(here, quiet, own)
    some = (named[asked], shapes[asked], own[asked])
    for at, shape, name in zip(*(column.tolist() for column in some), strict=True):
        if name >= 0:
            key = quiet.prefix + quiet.names[name]
        else:
            key = _key(program.lines, int(rows[at]), *quiet.points[shape])
        value = here.store.get_assigned(key) if key else _NO_INDEX
        point[at] = initial.point(key) if value is None else HELD
        if point[at] < 0:
            value = value or here.store.read(key)
            if isinstance(value, Nothing):
                here.world.pin(value, UNSURE)
            point[at], goals[at] = HELD, from_value(value)
    initial.used[point[point >= 0]] = True
    return point, goals


def _find_assigned(here: Execution, quiet: PlainMoves, names: Ints) -> Bools:
    """Tell which of the program's own variables it has given a value itself, (m,)."""
    values, found = here.store.values, np.zeros(len(names), dtype=bool)
    own, prefix = np.flatnonzero(names >= 0), quiet.prefix
    given = [*islice(values, len(own))]
    if len(given) < len(own):  # all that there are
        known = NameColumn(k[len(prefix) :] for k in given if k.startswith(prefix))
        found[own] = (known.find(quiet.names) >= 0)[names[own]]
    else:
        keys = (prefix + quiet.names[name] for name in names[own].tolist())
        found[own] = [values.get(key) is not None for key in keys]
    return found


def _key(lines: ProgramLines, row: int, key: str, slots: tuple[int, ...]) -> str:
    """Return where the point of a move is stored, "" where its index is not known."""
    index = [float(lines.value[lines.first[row] + slot]) for slot in slots]
    if not all(number.is_integer() for number in index):
        return ""
    element = ",".join(str(int(number)) for number in index)
    return f"{key}[{element}]" if slots else key
