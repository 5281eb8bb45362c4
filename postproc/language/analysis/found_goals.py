"""Where a move goes, and that the arm arrives there, as an analysis finds it."""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from postproc.arrays import Ints
from postproc.diagnostics import NO_REASON, Reason
from postproc.language.analysis.origins import Origins
from postproc.language.shifts import Shift
from postproc.language.visits import Meaning
from postproc.robot.trajectory import Motion


@dataclass(frozen=True)
class FoundShift:
    """How a move shifts the point that it names, and where that is written.

    Attributes:
        shift: The shift.
        slots: Which numbers of the job say it, w as of a target, -1 where nothing is
            written; the first one is -1 where the shift keeps its numbers.
        pins: Why they must stay, "" where they need not.
    """

    shift: Shift
    slots: tuple[int, ...] = (-1,)
    pins: str = ""


@dataclass(frozen=True)
class FoundGoal:
    """Where a move goes.

    Attributes:
        target: What the numbers mean.
        values: w numbers, NaN where not known.
        slots: Which numbers of the job they are, -1 for those that are computed; the
            first one tells literals apart.
        follows: Likewise of the point that it is shifted from.
        name: Of the point, "" where it is written in the move.
        aux: External axes, NaN where there is none.
        why: Why it cannot be compensated.
        pins: Why the numbers must stay, "" where they need not.
        shared: Other programs may read it too.
        shift: How it is shifted from a point, None where it is not, or not known.
        stays: The point that it is made from keeps its numbers for this move.
        holds: First numbers of shifts that keep their numbers for this move.
        names: Of data that assignments made it from.
        doubtful: Names of data of which only the run tells what they hold.
    """

    target: Meaning
    values: tuple[float, ...]
    slots: tuple[int, ...] = (-1,)
    follows: tuple[int, ...] = (-1,)
    name: str = ""
    aux: tuple[float, ...] = (math.nan,) * 6
    why: Reason = NO_REASON
    pins: str = ""
    shared: bool = False
    shift: FoundShift | None = None
    stays: bool = False
    holds: frozenset[int] = frozenset()
    names: frozenset[str] = frozenset()
    doubtful: frozenset[str] = frozenset()

    def behind(self, offset: int, name: str) -> Self:
        """Return a goal that is written alike, so many numbers behind this one."""
        slots, follows = (
            tuple([at + offset if at >= 0 else -1 for at in some])
            for some in (self.slots, self.follows)
        )
        return replace(self, slots=slots, follows=follows, name=name)

    @property
    def writes(self) -> tuple[int, ...]:
        """The numbers that may be rewritten for this move."""
        if self.is_rewritten_by_shift:
            assert self.shift is not None
            return self.shift.slots
        return self.slots

    @property
    def is_rewritten_by_shift(self) -> bool:
        """Whether it is the numbers of the shift that may be written anew."""
        return self.shift is not None and self.shift.slots[0] >= 0

    @property
    def origin(self) -> tuple[int, ...]:
        """The numbers that it holds, or that it moves along with."""
        return self.follows if self.slots[0] < 0 <= self.follows[0] else self.slots

    @property
    def point(self) -> int:
        """The first number of its point, or of what it is shifted from; -1 for none."""
        return max(self.slots[0], self.follows[0])


def hold_numbers(
    base: FoundGoal,
    name: str,
    why: Reason,
    pins: str,
    meaning: Meaning = Meaning.UNKNOWN,
    values: tuple[float, ...] = (),
    aux: tuple[float, ...] = (math.nan,) * 6,
) -> FoundGoal:
    """Return a goal that is computed from what a point was given: that stays.

    Args:
        base: What the point was given.
        name: Of the point.
        why: Why the goal cannot be compensated.
        pins: Why the numbers of the base stay.
        meaning: What the values mean.
        values: Numbers of the goal, none where they are not known.
        aux: External axes.
    """
    own = {base.writes[0]} if base.is_rewritten_by_shift else set[int]()
    unknown = meaning == Meaning.UNKNOWN and base.origin[0] < 0
    return FoundGoal(
        meaning, values or tuple(math.nan for _ in base.values),
        tuple(-1 for _ in base.values), base.origin,
        whole_name(name) if unknown else name, aux, why, pins or why.text, stays=True,
        holds=base.holds | own, names=base.names,
    )  # fmt: skip


def not_reached(goal: FoundGoal, why: Reason) -> FoundGoal:
    """Return the goal of a move that need not reach it: its numbers stay.

    Args:
        goal: What the move names.
        why: Why it need not reach it.
    """
    return FoundGoal(
        Meaning.UNKNOWN, tuple(math.nan for _ in goal.values), follows=(goal.point,),
        name=goal.name, aux=goal.aux, why=why, pins=goal.pins or why.text,
    )  # fmt: skip


def whole_name(name: str) -> str:
    """Return the name of data without an index.

    >>> whole_name("xs[1]"), whole_name("p1")
    ('xs', 'p1')
    """
    return re.split(r"[{\[]", name, maxsplit=1)[0]


def array_of(name: str) -> str:
    """Return the array of an element, "" for other data.

    >>> array_of("xs[1]"), array_of("list{1,2}"), array_of("p1")
    ('xs', 'list', '')
    """
    array, *index = re.split(r"[{\[]", name, maxsplit=1)
    return array if index else ""


@dataclass
class FoundVisit:
    """One arrival, as it is found.

    Attributes:
        scope: Where the move stands: its file and its row there.
        motion, via: `Motion`, and whether it is the point of an arc.
        goal: Where it goes.
        modes: What holds there.
        origins: Where it may come from.
        why: Why it cannot be compensated.
        arc_angle: As in `Visits` [rad].
        block: Tells the curves apart that visits are points of, None for none.
        curved: As in `Visits`.
        count: How many moves it stands for, which differ only in where they go.
        points: What points hold where it was read.
        left: With what the program went on behind it the last time: modes, points, and
            where else the arm may come from.
    """

    scope: Any
    motion: Motion
    via: bool
    goal: FoundGoal
    modes: Any
    origins: Origins = frozenset()
    why: Reason = NO_REASON
    arc_angle: float = math.nan
    block: Hashable = None
    curved: bool = False
    count: int = 1
    points: Any = None
    left: tuple[Any, Any, Origins] | None = None

    @property
    def row(self) -> int:
        """The row of the move in its file."""
        row: int = self.scope.row
        return row

    @property
    def rows(self) -> Sequence[int] | Ints:
        """The rows of all moves that it stands for."""
        return [self.row]

    @property
    def arrivals(self) -> Sequence[FoundVisit]:
        """What tells the arrivals that it stands for apart."""
        return [self]
