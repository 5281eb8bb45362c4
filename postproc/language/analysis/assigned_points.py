"""Points that a program assigns: what they hold on the ways to a statement."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from postproc.language import ir
from postproc.language.analysis.found_goals import FoundGoal
from postproc.language.analysis.shared_map import SharedMap
from postproc.language.analysis.values import Value

Place = tuple[int, str, str, str]
"""File, module and routine that declare data, "" for none, and their name."""
Key = tuple[Place, tuple[int, ...]]
"""The place of a point, and its index in an array, () for none."""


@dataclass(frozen=True)
class Component:
    """A component of a point that the program has set.

    Attributes:
        name: As it is spelt behind the point: ``trans.z``, ``x``.
        value: Its number [mm, deg], None where only the run tells it.
        file, row: The statement that sets it.
        along: It is what the point is given there, and a number that is added.
    """

    name: str
    value: float | None
    file: int
    row: int
    along: bool = False


@dataclass(frozen=True)
class AssignedPoint:
    """What assignments give to a point, or to an element of an array.

    Attributes:
        place: File, module and routine that declare the point, and its name.
        index: Of the element, () for a point.
        base: What it is given whole, None where that is not known.
        goal: Where a move to that leads, None where it is no point, or not given whole.
        components: What is set in it by itself since then, by name.
        copied: Points that it is a copy of, by their places.
        names: Of all data that its value depends on.
    """

    place: Place
    index: tuple[int, ...] = ()
    base: Value | None = None
    goal: FoundGoal | None = None
    components: tuple[Component, ...] = ()
    copied: frozenset[Place] = frozenset()
    names: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """The name of the point, or of its array."""
        return self.place[-1]

    @property
    def key(self) -> Key:
        """What tells it apart."""
        return self.place, self.index

    @property
    def chain(self) -> list[Place]:
        """Its place, and the places of what it is a copy of."""
        return [self.place, *sorted(self.copied - {self.place})]

    def copy_to(
        self, place: Place, index: tuple[int, ...], names: frozenset[str]
    ) -> AssignedPoint:
        """Return what another point holds that is given it, and depends on data."""
        copied = (self.copied | {self.place}) - {place}
        names = self.names | names
        return replace(self, place=place, index=index, copied=copied, names=names)

    def with_components(
        self, found: Iterable[Component], names: frozenset[str]
    ) -> AssignedPoint:
        """Return it with other components.

        Args:
            found: What is set; something is added to those that go along.
            names: Of data that their values depend on.
        """
        known = {one.name: one for one in self.components}
        for one in found:
            before = known.get(one.name, one)
            known[one.name] = replace(one, along=one.along and before.along)
        components = tuple(known[name] for name in sorted(known))
        return replace(self, components=components, names=self.names | names)


@dataclass(frozen=True)
class Points:
    """What points hold on every way to a statement.

    Attributes:
        held: What they are given, by key.
        routines: File, module and routine that declare points in it, and maybe others.
        alike: Tells whether two assignments gave the same to a point.
    """

    held: SharedMap[Key, AssignedPoint] = field(default_factory=SharedMap, hash=False)
    routines: frozenset[tuple[int, str, str]] = field(
        default=frozenset(), compare=False
    )
    alike: Callable[[AssignedPoint, AssignedPoint], bool] = field(
        default=operator.eq, compare=False
    )

    def give(self, point: AssignedPoint) -> Points:
        """Return it with what an assignment gives to a point."""
        held = self.held.copy()
        held[point.key] = point
        return Points(held, self.routines | {point.place[:3]}, self.alike)

    def forget_shared(self) -> Points:
        """Return it with what routines declare alone: nothing else knows that."""
        return self._without(lambda key: not key[0][2])

    def forget(self, place: Place) -> Points:
        """Return it without any element of an array, or without a point."""
        return self._without(lambda key: key[0] == place)

    def leave(self, routine: tuple[int, str, str]) -> Points:
        """Return it without the points that a routine declares, by its place."""
        if routine not in self.routines:
            return self
        return self._without(lambda key: key[0][:3] == routine)

    def join(self, other: Points) -> Points:
        """Keep what is the same on another way here."""
        lost = [
            key for key in self.held.differing(other.held)
            if (mine := self.held.get(key)) and not other._holds(mine)
        ]  # fmt: skip
        return self._drop(lost)

    def _holds(self, given: AssignedPoint) -> bool:
        held = self.held.get(given.key)
        return held == given or (held is not None and self.alike(held, given))

    def _without(self, lost: Callable[[Key], bool]) -> Points:
        return self._drop([key for key in self.held if lost(key)])

    def _drop(self, lost: Sequence[Key]) -> Points:
        if not lost:
            return self
        held = self.held.copy()
        for key in lost:
            del held[key]
        return replace(self, held=held)


NO_POINTS = Points()


@dataclass(frozen=True)
class Scope:
    """Where a statement stands, and what loop variables hold there.

    Attributes:
        file: Index of its file.
        module, routine: Names, "" outside of all.
        parameters: Of the routine.
        loops: Values of loop variables that are known.
        given: What the routine is called with, by parameter: the operand, and where
            that stands. Parameters without an entry are not known.
        points: What points hold that assignments have changed, where a move is read.
        row: The statement, -1 where a whole routine is meant.
    """

    file: int
    module: str
    routine: str
    parameters: frozenset[str] = frozenset()
    loops: tuple[tuple[str, float], ...] = ()
    given: tuple[tuple[str, ir.Operand, Scope], ...] = ()
    points: Points = NO_POINTS
    row: int = -1

    @property
    def place(self) -> tuple[int, str, str]:
        """Its file, module and routine."""
        return self.file, self.module, self.routine

    def at(self, row: int) -> Scope:
        """Return where another statement of the routine stands."""
        return replace(self, row=row)


@dataclass(frozen=True)
class PointPart:
    """A point that a statement names, or a part of it.

    Attributes:
        place: Where it is declared.
        index: Of an element, () for a point; None where only the run tells it, and for
            whole arrays.
        component: As it is spelt behind the point, "" for all of it.
    """

    place: Place
    index: tuple[int, ...] | None
    component: str = ""


def source_of(operand: ir.Operand | None) -> ir.DataObject | None:
    """Return the point that an operand names, or shifts, None where it does neither."""
    while isinstance(operand, ir.FunctionCall) and operand.arguments:
        operand = operand.arguments[0].value
    return operand if isinstance(operand, ir.DataObject) else None


def is_point(data: ir.DataObject) -> bool:
    """Return True if data are named whole, or an element of them is."""
    return all(isinstance(step, ir.ElementStep) for step in data.steps)


def find_added(target: ir.DataObject, value: ir.Operand) -> list[ir.Operand]:
    """Return what is added to a component of data, or subtracted; none for all else.

    >>> z = ir.DataObject("p", ("z",))
    >>> find_added(z, ir.Operation("+", (z, ir.Num(0))))
    [Num(slot=0)]
    >>> find_added(z, ir.Operation("-", (ir.Num(0), z)))
    []
    """
    added, rest = list[ir.Operand](), value
    while isinstance(rest, ir.Operation) and rest.operator in ("+", "-"):
        first, *other = rest.operands
        if rest.operator == "+" and other == [target]:
            first, other = target, [first]
        added += other
        rest = first if other else ir.Operand()
    alone = all(data.name != target.name for data in ir.data_in(*added))
    return added if rest == target and alone and not is_point(target) else []
