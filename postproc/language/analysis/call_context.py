"""Calls and loop rounds that led to a place of a program, however deep."""

from __future__ import annotations

from collections.abc import Iterator
from functools import total_ordering
from typing import Any, NamedTuple

CALLED, HANDLED, HERE = -1, -3, -2


class Context:
    """One call, or one round of a loop, inside of those around it.

    Contexts are made by `within` alone, so that the same calls and rounds are the same
    object: to compare two of them, or to look one up, costs the same at any depth.

    Attributes:
        outer: What is around it; the outermost context is its own.
        at: Job-wide index of the row of the call or loop.
        kind: The round of a loop, or CALLED or HANDLED.
        depth: How many are around it.
        place: Where its statements stand: what the language knows of the routine.
    """

    __slots__ = ("_inner", "_jump", "at", "depth", "kind", "outer", "place")

    def __init__(
        self,
        outer: Context | None = None,
        at: int = -1,
        kind: int = HERE,
        place: Any = None,
    ):
        """Make the outermost context; `within` makes all others."""
        self.outer: Context = outer or self
        self.at, self.kind, self.place = at, kind, place
        self.depth: int = 0 if outer is None else outer.depth + 1
        self._inner: dict[tuple[int, int], Context] = {}
        self._jump: Context = self if outer is None else outer._far()

    def _far(self) -> Context:
        """Return where a context within this one jumps to, far outside of it.

        Jumps are so long that any context around is a logarithmic number of them away
        (Myers, An applicative random-access stack, 1983).
        """
        near, far = self._jump, self._jump._jump
        return far if self.depth - near.depth == near.depth - far.depth else self

    def find(self, at: int, kind: int) -> Context | None:
        """Return the context of a call or round inside of this one, if it is known."""
        return self._inner.get((at, kind))

    def within(self, at: int, kind: int, place: Any) -> Context:
        """Return the context of a call or round inside of this one.

        Args:
            at: Job-wide index of the row of the call or loop.
            kind: The round, or CALLED or HANDLED.
            place: Where its statements stand, where it is met first.
        """
        found = self._inner.get((at, kind))
        if found is None:
            found = self._inner[at, kind] = Context(self, at, kind, place)
        return found

    def forget(self) -> None:
        """Let go of the contexts within: they hold this one, and what is read there."""
        self._inner.clear()

    @property
    def is_round(self) -> bool:
        """Tell whether this is a round of a loop."""
        return self.kind >= 0

    @property
    def begun_at(self) -> At:
        """The call or the loop that it is inside of."""
        return At(self.outer, self.at - self.outer.place.offset)

    @property
    def call(self) -> Context:
        """The call of the routine in whose loops this is, or itself."""
        one = self
        while one.is_round:
            one = one.outer
        return one

    def around(self) -> Iterator[Context]:
        """Go through this context and those around it, up to the outermost one."""
        one = self
        while one.outer is not one:
            yield one
            one = one.outer
        yield one

    def up_to(self, depth: int) -> Context:
        """Return the context of a depth around this one, or itself."""
        one = self
        while one.depth > depth:
            one = one._jump if one._jump.depth >= depth else one.outer
        return one


class At(NamedTuple):
    """A row of a routine, and the calls and rounds that have led to it."""

    context: Context
    row: int

    @property
    def place(self) -> Any:
        """Where the statements of the routine stand."""
        return self.context.place

    @property
    def statement(self) -> Any:
        """What the row says."""
        return self.context.place.statement(self.row)

    @property
    def job_row(self) -> int:
        """The job-wide index of the row."""
        return int(self.context.place.offset + self.row)

    @property
    def behind(self) -> At:
        """The row behind it."""
        return At(self.context, self.row + 1)

    def to(self, row: int) -> At:
        """Return another row of the routine."""
        return At(self.context, row)


def split_contexts(a: Context, b: Context) -> tuple[Context, Context]:
    """Return the outermost contexts around two of one depth in which they differ."""
    while a.outer is not b.outer:
        if a._jump is not b._jump:
            a, b = a._jump, b._jump
        else:
            a, b = a.outer, b.outer
    return a, b


@total_ordering
class Point:
    """A row in a context; points are in the order in which a program comes to them."""

    __slots__ = ("at", "context")

    def __init__(self, context: Context, at: int) -> None:
        """Stand at a row, by its job-wide index."""
        self.context, self.at = context, at

    def __eq__(self, other: object) -> bool:
        """Tell whether it is the same row in the same context."""
        return (
            isinstance(other, Point)
            and self.context is other.context
            and self.at == other.at
        )

    def __lt__(self, other: Point) -> bool:
        """Compare calls and rounds from the outermost one on, then the rows."""
        mine, theirs = self.context, other.context
        if mine is theirs:
            return self.at < other.at
        depth = min(mine.depth, theirs.depth)
        a, b = mine.up_to(depth), theirs.up_to(depth)
        if a is not b:
            a, b = split_contexts(a, b)
            return (a.at, a.kind) < (b.at, b.kind)
        if mine is a:
            b = theirs.up_to(depth + 1)
            return (self.at, HERE) < (b.at, b.kind)
        a = mine.up_to(depth + 1)
        return (a.at, a.kind) < (other.at, HERE)
