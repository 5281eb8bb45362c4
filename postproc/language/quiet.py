"""Lines that are run a thousand at a time: moves to known places, idle calls.

Such a line changes the store, if at all, in the same way however often it is run, and
reads nothing that another one changes: running one line of every variant runs them all.
Whether a line is quiet is told by the text alone, so that a stretch of them is the same
stretch each time that the analysis comes to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.language import pdl2 as ast
from postproc.language.effects import CHANGING, PURE, invocations, references
from postproc.language.forms import name_index
from postproc.language.reach import HANDS_OVER
from postproc.language.world import Place, World

Ints = NDArray[np.int64]

_POINTS = ("position", "xtndpos", "jointpos")
_NOT_WITH = ("$move_type", "$tool", "$base", "$uframe")


@dataclass(frozen=True)
class Point:
    """A variable that moves go to.

    Attributes:
        key: Where it is stored; of an array's elements the beginning.
        index: Number slots of an element's index.
    """

    key: str
    index: tuple[int, ...]


@dataclass(frozen=True)
class Quiet:
    """The quiet lines of a body.

    Attributes:
        first: Row of the first line that `variant` tells of.
        variant: Index into `statements` of every row, (n,), -1 where it is not quiet.
        statements: What the lines of each variant say, but for numbers and points.
        calls: Which of them call something.
        named: Which of them are moves to points.
        points: The point that lines of a shape go to.
        ends: Rows at which stretches end, ascending.
    """

    first: int
    variant: Ints
    statements: tuple[ast.Statement, ...]
    calls: tuple[bool, ...]
    named: tuple[bool, ...]
    points: Mapping[int, Point]
    ends: Ints

    def end(self, row: int) -> int:
        """Return the row after the stretch of a move, the row itself if none."""
        at = self.variant[row - self.first] if self.first <= row else -1
        if at < 0 or not isinstance(self.statements[at], ast.Move):
            return row
        return int(self.ends[np.searchsorted(self.ends, row, side="right")])


def find_quiet(world: World, place: Place, volatile: frozenset[str]) -> Quiet:
    """Find the quiet lines of a body.

    Args:
        world: The files of the job.
        place: The body.
        volatile: Names that condition handlers change.
    """
    program, body = place.program, place.body
    first = body.first + 1
    rows = program.lines.shape[first : body.last]
    may_be = program.statements.which(_may_be_quiet)
    variants = _Variants(world, place, volatile)
    of_shape = np.full(len(program.lines.shapes), -1, dtype=np.int64)
    shapes = np.unique(rows[may_be[rows]])
    forms = program.statements.form[shapes]
    for form in np.unique(forms).tolist():
        mine = shapes[forms == form].tolist()
        of_shape[mine] = variants.add(form, mine)
    variant = of_shape[rows]
    joins = np.array(sorted(body.blocks.joins), dtype=np.int64)
    ends = np.concatenate([first + np.flatnonzero(variant < 0), joins, [body.last]])
    return Quiet(
        first,
        variant,
        tuple(variants.statements),
        tuple(any(_calls(world, place, s)) for s in variants.statements),
        tuple(_goes_to_point(s) for s in variants.statements),
        variants.points,
        np.unique(ends),
    )


def _may_be_quiet(said: ast.Statement) -> bool:
    if isinstance(said, ast.Call):
        return not said.program
    return isinstance(said, ast.Move) and _is_plain(said)


def _is_plain(move: ast.Move) -> bool:
    """Tell whether a move goes to numbers or a variable; WITH may set numbers."""
    if move.how != "TO" or move.trajectory not in ("JOINT", "LINEAR", ""):
        return False
    if move.arm or move.via or move.til or move.sync:
        return False
    for reference, value in move.settings:
        plain = reference.name.startswith("$") and not reference.steps
        if not (plain and isinstance(value, ast.Number)) or reference.name in _NOT_WITH:
            return False
    match move.where[0]:
        case ast.Invoke("pos", (*items, ast.Text(_))) | ast.Aggregate(items):
            return _six_numbers(items)
        case ast.Invoke("pos", items):
            return _six_numbers(items)
        case ast.Reference(name, () | (ast.Index(_),)):
            return not name.startswith("$")
    return False


def _goes_to_point(said: ast.Statement) -> bool:
    return isinstance(said, ast.Move) and isinstance(said.where[0], ast.Reference)


def _six_numbers(items: object) -> bool:
    assert isinstance(items, tuple | list)
    return len(items) == 6 and all(isinstance(i, ast.Number) for i in items)


@dataclass
class _Variants:
    """The variants of quiet lines of a body, as they are found."""

    world: World
    place: Place
    volatile: frozenset[str]

    def __post_init__(self) -> None:
        self.statements: list[ast.Statement] = []
        self.points: dict[int, Point] = {}
        self._known: dict[tuple[int, tuple[str, ...]], int] = {}
        self._parameters = {p.name for p in self.place.body.parameters}

    def add(self, form: int, shapes: list[int]) -> list[int]:
        """Return the variants of shapes of one form, -1 where one is not quiet."""
        said = self.place.program.statements
        one = said.said[form]
        where = one.where[0] if isinstance(one, ast.Move) else None
        if not isinstance(where, ast.Reference):
            return [
                self._variant(shape, said.shapes.names_of(shape)) for shape in shapes
            ]
        index = _number_slots(where.steps)
        at = name_index(where.name)
        found = []
        for shape in shapes:
            names = said.shapes.names_of(shape)
            name = names[at].lower() if at >= 0 else where.name
            if index is None or not self._is_point(name, array=bool(where.steps)):
                found.append(-1)
                continue
            self.points[shape] = Point(self.world.root(self.place, name), index)
            others = names[:at] + names[at + 1 :] if at >= 0 else names
            found.append(self._variant(shape, others))
        return found

    def _variant(self, shape: int, names: tuple[str, ...]) -> int:
        """Return the variant of a shape, which its form and some names tell."""
        said = self.place.program.statements
        key = int(said.form[shape]), names
        variant = self._known.get(key)
        if variant is None:
            variant = -1
            if self._is_quiet(said[shape]):
                variant = len(self.statements)
                self.statements.append(said[shape])
            self._known[key] = variant
        return variant

    def _is_point(self, name: str, array: bool) -> bool:
        """Tell whether a name is a variable whose value no call changes unseen."""
        type_ = self.world.type_of(self.place, name)
        if type_ is None or type_.name not in _POINTS or type_.path:
            return False
        if name in self._parameters or name in self.volatile:
            return False
        return type_.array == array

    def _is_quiet(self, said: ast.Statement) -> bool:
        return all(self._does_nothing(c) for c in _calls(self.world, self.place, said))

    def _does_nothing(self, call: ast.Invoke) -> bool:
        """Tell whether a call neither moves the arm nor sets what moves depend on."""
        start, name = self.world.start, call.name
        if self.world.find_routine(self.place.program, name) is not None:
            return False
        if name in start.frame_tables or name.startswith(HANDS_OVER):
            return False
        if start.routines.get(name) not in (None, "still"):
            return False
        bare = name not in CHANGING and name not in PURE
        return all(self._keeps(a, bare) for a in call.arguments)

    def _keeps(self, argument: ast.Expression | None, bare: bool) -> bool:
        """Tell whether nothing that moves depend on is known by an argument's name."""
        match argument:
            case None | ast.Number() | ast.Text() | ast.Unary(_, ast.Number()):
                return True
            case ast.Reference(name, ()):
                type_ = self.world.type_of(self.place, name)
                safe = type_ is None or (
                    type_.name not in _POINTS and not type_.array and not type_.path
                )
                known = name.startswith("$") or name in self._parameters
                return bare and safe and not known
        return False


def _number_slots(steps: tuple[str | ast.Index, ...]) -> tuple[int, ...] | None:
    """Return the slots of an index that is written in numbers, None for any other."""
    index = [
        i for step in steps if isinstance(step, ast.Index) for i in step.subscripts
    ]
    slots = tuple(i.slot for i in index if isinstance(i, ast.Number))
    return slots if len(slots) == len(index) else None


def _calls(world: World, place: Place, said: ast.Statement) -> list[ast.Invoke]:
    """List the calls in a line, those by a function's name alone too."""
    found = [c for c in invocations(said) if c.name not in PURE]
    names = {r.name for r in references(said) if not r.steps}
    found += [ast.Invoke(n, ()) for n in names if world.is_function(place, n)]
    if isinstance(said, ast.Call):
        found.append(ast.Invoke(said.name, said.arguments))
    return found
