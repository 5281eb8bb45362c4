"""Points that a program assigns: what they hold on the ways to a statement."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

from postproc.language import ir
from postproc.language.analysis.shared_map import SharedMap

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
    """

    name: str
    value: float | None
    file: int
    row: int


@dataclass(frozen=True)
class AssignedPoint:
    """What assignments give to a point, or to an element of an array.

    Attributes:
        place: File, module and routine that declare the point, and its name.
        operand, row, scope: What it is given whole, None where that is not known, and
            where that stands.
        index: Of the element, () for a point.
        components: What is set in it by itself since then, by name.
        copied: Points that it is a copy of, by their places.
        names: Of all data that its value depends on.
    """

    place: Place
    operand: ir.Operand | None
    row: int
    scope: Scope
    index: tuple[int, ...] = ()
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

    def with_components(
        self, found: Iterable[Component], names: frozenset[str]
    ) -> AssignedPoint:
        """Return it with other components.

        Args:
            found: What is set.
            names: Of data that their values depend on.
        """
        known = {one.name: one for one in (*self.components, *found)}
        components = tuple(known[name] for name in sorted(known))
        return replace(self, components=components, names=self.names | names)


@dataclass(frozen=True)
class Points:
    """What points hold on every way to a statement.

    Attributes:
        held: What they are given, by key.
        used: What of it has been asked for, by everybody who wants to know that.
        places: Places of all points in it, and maybe of others.
        routines: File, module and routine of these.
    """

    held: SharedMap[Key, AssignedPoint] = field(default_factory=SharedMap, hash=False)
    used: tuple[set[Key], ...] = field(default=(), compare=False)
    places: SharedMap[Place, bool] = field(default_factory=SharedMap, compare=False)
    routines: frozenset[tuple[int, str, str]] = field(
        default=frozenset(), compare=False
    )

    def watch(self) -> Points:
        """Return the same, which notes what is asked for from now on."""
        return replace(self, used=(*self.used, set())) if self.routines else self

    @property
    def given(self) -> frozenset[AssignedPoint]:
        """What has been asked for since it is watched."""
        used = self.used[-1] if self.used else ()
        found = (self.held.get(key) for key in used)
        return frozenset(point for point in found if point is not None)

    def find(self, key: Key) -> AssignedPoint | None:
        """Return what a point holds, None where that is not known."""
        for used in self.used:
            used.add(key)
        return self.held.get(key)

    def __contains__(self, place: Place) -> bool:
        """Tell whether anything may be known of a point or an array."""
        return self.places.get(place) is not None

    def give(self, point: AssignedPoint) -> Points:
        """Return it with what an assignment gives to a point."""
        held, places, routines = self.held.copy(), self.places, self.routines
        held[point.key] = point
        if point.place not in self:
            places = places.copy()
            places[point.place] = True
            routines |= {point.place[:3]}
        return Points(held, self.used, places, routines)

    def forget(self, place: Place) -> Points:
        """Return it without any element of an array, or without a point."""
        if place not in self:
            return self
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
            if (mine := self.held.get(key)) and mine != other.held.get(key)
        ]  # fmt: skip
        return self._drop(lost)

    def agree(self, given: Iterable[AssignedPoint]) -> bool:
        """Return True if points hold what is given."""
        return all(self.held.get(point.key) == point for point in given)

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
        given: What the routine is called with, by parameter: the operand, its row and
            where that stands. Parameters without an entry are not known.
        points: What points hold that assignments have changed, where a move is read.
    """

    file: int
    module: str
    routine: str
    parameters: frozenset[str] = frozenset()
    loops: tuple[tuple[str, float], ...] = ()
    given: tuple[tuple[str, ir.Operand, int, Scope], ...] = ()
    points: Points = NO_POINTS


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


@dataclass(frozen=True)
class FunctionBody:
    """What a function does.

    Attributes:
        scope: Where its statements stand, with what it is called with.
        statements: Rows and statements, without declarations.
    """

    scope: Scope
    statements: Sequence[tuple[int, ir.SourceStatement]]


def source_of(operand: ir.Operand | None) -> ir.DataObject | None:
    """Return the point that an operand names, or shifts, None where it does neither."""
    while isinstance(operand, ir.FunctionCall) and operand.arguments:
        operand = operand.arguments[0].value
    return operand if isinstance(operand, ir.DataObject) else None


def is_point(data: ir.DataObject) -> bool:
    """Return True if data are named whole, or an element of them is."""
    return all(isinstance(step, ir.ElementStep) for step in data.steps)


@dataclass
class NamesUsed:
    """Names that the statements of a task change and take.

    Attributes:
        written: Those that assignments change; what takes a value does not read them.
        changed: Those that may be changed otherwise.
        read: Those that something but the destination of a move takes.
        copies: Points that are assigned, and those that they are made from.
    """

    written: set[str] = field(default_factory=set)
    changed: set[str] = field(default_factory=set)
    read: set[str] = field(default_factory=set)
    copies: set[tuple[str, str]] = field(default_factory=set)

    def pass_on(self) -> None:
        """Note of points what is noted of those that are made from them."""
        before = -1
        while before != len(self.read):
            before = len(self.read)
            self.read |= {one for target, one in self.copies if target in self.read}


@dataclass
class TaskSymbols(ABC):
    """What the names of a task mean, as far as ways through it ask."""

    _names: dict[int, tuple[ir.Operand, frozenset[str]]] = field(
        default_factory=dict, init=False
    )

    @property
    @abstractmethod
    def routines(self) -> Collection[str]:
        """The names of the task's routines."""

    @property
    @abstractmethod
    def uses(self) -> NamesUsed:
        """The names that statements change and take."""

    @abstractmethod
    def locate(self, data: ir.DataObject, row: int, here: Scope) -> PointPart | None:
        """Find the point that only assignments change, None for all other data."""

    @abstractmethod
    def evaluate_components(
        self, part: PointPart, value: ir.Operand, row: int, here: Scope
    ) -> Sequence[tuple[str, float | None]]:
        """Return the components that an assignment sets, and what it gives to them.

        Args:
            part: What is set.
            value: What it is given.
            row: The assignment.
            here: Where it stands.
        """

    def names_of(self, operand: ir.Operand) -> frozenset[str]:
        """Return the names of all data and functions in an operand."""
        key = id(operand)
        if key not in self._names:
            named = ir.DataObject | ir.FunctionCall
            parts = (x for x in ir.walk(operand) if isinstance(x, named))
            self._names[key] = operand, frozenset(one.name for one in parts)
        return self._names[key][1]

    def calls_routine(self, operand: ir.Operand) -> bool:
        """Return True if an operand calls a function of the task."""
        return not self.names_of(operand).isdisjoint(self.routines)

    def find_held(
        self, operand: ir.Operand | None, row: int, here: Scope
    ) -> AssignedPoint | None:
        """Return what assignments gave to the point that an operand names."""
        if not (here.points.routines and isinstance(operand, ir.DataObject)):
            return None
        part = self.locate(operand, row, here)
        if part is None or part.index is None or part.component:
            return None
        return here.points.find((part.place, part.index))

    def assign(
        self, points: Points, one: ir.Assignment, row: int, here: Scope
    ) -> Points:
        """Return what points hold behind an assignment.

        Args:
            points: What they hold before it.
            one: The assignment.
            row: Its row.
            here: Where it stands.
        """
        part = self.locate(one.target, row, here)
        if part is None:
            return points
        if part.index is None:
            return points.forget(part.place)
        there = replace(here, points=points.watch())
        return points.give(self._give_value(part, part.index, one.value, row, there))

    def _give_value(
        self, part: PointPart, index: tuple[int, ...], value: ir.Operand, row: int,
        here: Scope,
    ) -> AssignedPoint:  # fmt: skip
        """Return what a point holds that is given a value, or a component of it."""
        place, points, own = part.place, here.points, frozenset([part.place[-1]])
        plain = replace(here, points=NO_POINTS)
        known = self.find_held(value, row, here)
        if known is not None and not part.component:
            copied = known.copied | {known.place}
            return replace(
                known, place=place, index=index, copied=copied, names=known.names | own
            )
        names = self.names_of(value)
        if not (part.component or self._takes_held(value, row, here)):
            return AssignedPoint(place, value, row, plain, index, names=own | names)
        found = self.evaluate_components(part, value, row, here)
        numbers = [Component(name, number, here.file, row) for name, number in found]
        names = names.union(own, *(point.names for point in points.given))
        if part.component:
            before = points.held.get((place, index))
            point = before or AssignedPoint(place, None, row, plain, index)
            return point.with_components(numbers, names | own)
        if not points.given:  # what it is given never changes
            return AssignedPoint(place, value, row, plain, index, names=names)
        source = source_of(value)
        base = self.find_held(source, row, here)
        if base is None:
            point = AssignedPoint(place, source, row, plain, index)
        else:
            copied = base.copied | {base.place}
            point = replace(base, place=place, index=index, copied=copied)
        return point.with_components(numbers, names)

    @abstractmethod
    def open_function(
        self, call: ir.FunctionCall, row: int, here: Scope
    ) -> FunctionBody | None:
        """Return the statements of the function that a call means, None if unknown."""

    def find_returned(
        self, call: ir.FunctionCall, row: int, here: Scope
    ) -> tuple[ir.Operand, int, Scope] | None:
        """Return what a function returns, its row and where that stands.

        None for functions that do more than to set points of their own, or call others.

        Args:
            call: The call.
            row: Its row.
            here: Where it stands.
        """
        body = self.open_function(call, row, here)
        if body is None:
            return None
        scope, points = body.scope, here.points
        own = scope.file, scope.module, scope.routine
        for at, one in body.statements:
            scope = replace(scope, points=points)
            if not isinstance(one, ir.Assignment | ir.Leave) or one.value is None:
                return None
            if self.calls_routine(one.value):
                return None
            if isinstance(one, ir.Leave):
                return (one.value, at, scope) if one.word == "return" else None
            part = self.locate(one.target, at, scope)
            if part is None or part.place[:3] != own:
                return None
            points = self.assign(points, one, at, scope)
        return None

    def _takes_held(self, value: ir.Operand, row: int, here: Scope) -> bool:
        """Return True if a value may be made from what assigned points hold."""
        if not here.points.routines:
            return False
        if self.calls_routine(value):
            return True
        parts = (
            self.locate(ir.DataObject(name), row, here) for name in self.names_of(value)
        )
        return any(part and part.place in here.points for part in parts)
