"""Blocks of moves that differ only in where they go: they are run at once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from postproc.arrays import Bools, Floats, Indices, Interned, Ints, chunks
from postproc.language import ir
from postproc.language.analysis.found_goals import FoundGoal, FoundVisit
from postproc.language.text.statement_table import Statements, StatementText
from postproc.language.text.symbol_column import NameColumn
from postproc.language.text.templates import name_index, number_in_order
from postproc.language.text.templates import split_by as split_by

LEAST = 4  # moves that are worth it
Runs = dict[int, int]
"""From the first row of a block to the row behind its last."""


@dataclass(frozen=True)
class TargetSlots:
    """Which numbers of a statement say where a move goes.

    Attributes:
        slots: Those of the target, w as of all targets, -1 for what is not written.
        aux: Those of external axes, likewise.
        joints: It is joint angles.
    """

    slots: tuple[int, ...]
    aux: tuple[int, ...] = ()
    joints: bool = False

    def relative(self) -> TargetSlots:
        """Return them by their distance to the first of all."""
        slots, aux = (
            tuple([at - self.begin if at >= 0 else -1 for at in some])
            for some in (self.slots, self.aux)
        )
        return TargetSlots(slots, aux, self.joints)

    @cached_property
    def begin(self) -> int:
        """The first of all."""
        return min(self.every)

    @property
    def every(self) -> frozenset[int]:
        """All of them."""
        return frozenset((*self.slots, *self.aux)) - {-1}


SoundTest = Callable[[TargetSlots, Floats], Bools]
"""Tells which numbers of targets, (m, w), need no word of their own, (m,)."""


@dataclass(frozen=True)
class PlainMove:
    """What moves of one variant have in common, but for names and numbers.

    Attributes:
        name: Of the data that they go to, "" where the target is written in them.
        target: Where it is written in them, None where it is named.
        index: Slots of the index of an element.
        planner: What plans them: of one block all go by one.
        counting: Slots of the other numbers that tell variants apart, None for all.
    """

    name: str
    target: TargetSlots | None = None
    index: tuple[int, ...] = ()
    planner: str = ""
    counting: tuple[int, ...] | None = None

    @classmethod
    def to(
        cls,
        end: ir.Operand | None,
        slots_of: Callable[[ir.Operand | None], TargetSlots | None],
        planner: str = "",
        counting: tuple[int, ...] | None = None,
    ) -> Self | None:
        """Return moves to data by name, an element, or numbers; None for all others.

        Args:
            end: Where they go.
            slots_of: Reads a target that is written in numbers.
            planner: See there.
            counting: See there.
        """
        if not isinstance(end, ir.DataObject):
            target = slots_of(end)
            return cls("", target, (), planner, counting) if target else None
        index = [part for step in end.steps if isinstance(step, ir.ElementStep)
                 for part in step.subscripts]  # fmt: skip
        slots = tuple(one.slot for one in index if isinstance(one, ir.Num))
        plain = len(end.steps) < 2 and len(slots) == len(index) >= len(end.steps)
        return cls(end.name, None, slots, planner, counting) if plain else None

    @property
    def moves(self) -> bool:
        """Whether they go anywhere; others stand between moves.

        Those do nothing at all, or set what the moves behind them are made with.
        """
        return bool(self.name or self.target)


@dataclass(frozen=True)
class PlainMoves:
    """Which of n statements are moves that do nothing but go somewhere.

    Attributes:
        moves: The variants: statements of one differ only in where they go.
        variant: Index into `moves`, (n,), -1 for all other statements.
        name: Index into the names of the text of where each goes, (n,), -1 where all of
            its variant go to one name, or to none.
    """

    moves: Sequence[PlainMove]
    variant: Indices
    name: Indices

    @cached_property
    def going(self) -> Bools:
        """Which variants move, then False for all other statements."""
        return np.array([*(one.moves for one in self.moves), False], dtype=bool)

    @cached_property
    def named(self) -> Bools:
        """Which move to data by name, likewise."""
        return np.array([*(bool(one.name) for one in self.moves), False], dtype=bool)

    @cached_property
    def indexed(self) -> Bools:
        """Which move to an element, likewise."""
        return np.array([*(bool(one.index) for one in self.moves), False], dtype=bool)

    @cached_property
    def planner(self) -> Ints:
        """The number of the planner of each variant, then of all other statements."""
        return Interned[str]().of([*(one.planner for one in self.moves), ""])


def find_plain(
    text: Statements[Any],
    read: Callable[[Any], PlainMove | None],
    are_sound: SoundTest,
    apart: Collection[int] = (),
    alike: Ints | None = None,
) -> PlainMoves:
    """Find the moves of a file that do nothing but go somewhere.

    Args:
        text: The statements.
        read: Reads a statement whose numbered names are open.
        are_sound: Tells which numbers of a target are those of one.
        apart: Rows of statements that are read by themselves.
        alike: Which name stands for each of the text: those of data that hold the same
            tell no moves apart that do not go there; None where all do.
    """
    moves = list[PlainMove]()
    variant, name = np.full((2, len(text)), -1, dtype=np.int32)
    read_forms = [read(one) for one in text.said.said]
    plain = np.array([one is not None for one in read_forms], dtype=bool)
    form = text.said.form[text.shape]
    sought = plain[form] if plain.any() else np.zeros(len(form), dtype=bool)
    sought[[*apart]] = False
    rows = np.flatnonzero(sought)
    for number, at in split_by(form[rows]):
        own, move = rows[at], read_forms[number]
        assert move is not None
        if move.target is not None:
            own = own[find_sound(text, text.first[own], move.target, are_sound)]
        if len(own):
            several, name[own] = _tell_apart(text, own, move, alike)
            variant[own] = len(moves) + several
            moves += [move] * (int(several.max()) + 1)
    return PlainMoves(moves, variant, name)


def _tell_apart(
    text: Statements[Any], rows: Ints, move: PlainMove, alike: Ints | None
) -> tuple[Ints, Indices]:
    """Number the moves of one form by all that they say but where they go.

    Returns:
        The number of each, (m,), and the name of where it goes, as in `PlainMoves`.
    """
    names, at = text.shapes.names_at(text.shape[rows]), name_index(move.name)
    goal = names[:, at] if at >= 0 else np.full(len(rows), -1, dtype=np.int32)
    other: Collection[int] = move.counting or ()
    if move.counting is None:
        count = int(text.first[rows[0] + 1] - text.first[rows[0]])
        target = move.target.every if move.target else frozenset[int]()
        other = {*range(count)} - target - {*move.index}
    columns = [names[:, k] for k in range(names.shape[1]) if k != at]
    columns = columns if alike is None else [alike[one] for one in columns]
    begin = text.first[rows]
    columns += [text.value[begin + k].view(np.int64) for k in sorted(other)]
    return number_rows(columns, len(rows))[0], goal


def find_sound(
    text: Statements[Any], begin: Ints | Indices, target: TargetSlots, test: SoundTest
) -> Bools:
    """Tell which targets that are written alike pass a test, and have all axes, (m,).

    Args:
        text: The statements that they are written in.
        begin: The first number of each of these, (m,).
        target: Their numbers.
        test: The test.
    """
    found = np.zeros(len(begin), dtype=bool)
    outside = [slot for slot in target.aux if slot >= 0]
    for k in chunks(len(begin)):
        found[k] = test(target, numbers_at(text, begin[k], target.slots))
        found[k] &= np.isfinite(numbers_at(text, begin[k], outside)).all(axis=1)
    return found


def number_rows(columns: Sequence[Ints | Indices], n: int) -> tuple[Ints, Ints]:
    """Number rows of n by what stands in some columns, in the order of appearance.

    Returns:
        The number of every row, (n,), and the first row of every number.
    """
    number, example = np.zeros(n, dtype=np.int64), np.zeros(min(n, 1), dtype=np.int64)
    for column in columns:
        own, values = number_in_order(column)
        number, example = number_in_order(number * len(values) + own)
    return number, example


def numbers_at(
    text: Statements[Any], begin: Ints | Indices, slots: Sequence[int]
) -> Floats:
    """Return numbers of statements, (m, s), NaN for slots that are -1.

    Args:
        text: The statements.
        begin: The first number of each, (m,).
        slots: How far behind it they stand, s.
    """
    at = np.array(slots, dtype=np.int64)
    found: Floats = np.full((len(begin), len(at)), np.nan)
    for column in np.flatnonzero(at >= 0).tolist():
        found[:, column] = text.value[begin + at[column]]
    return found


def find_runs(
    first: int, joins: Iterable[int], plain: PlainMoves, variant: Ints | Indices,
    ends: bool = False,
) -> Runs:  # fmt: skip
    """Find the blocks of a routine: plain moves on one way.

    Args:
        first: Its first row.
        joins: Rows that several ways lead to.
        plain: The moves of its file.
        variant: The variant of each of its rows, (n,), -1 for what is no plain move.
        ends: The first and the last move of a block are read by themselves: what comes
            before or behind tells of them.
    """
    n, loud = len(variant), np.flatnonzero(variant < 0)
    going = np.flatnonzero(plain.going[variant])
    planner = plain.planner[variant[going]]
    cuts = [row - first for row in joins if 0 <= row - first < n]
    cuts += going[np.flatnonzero(np.diff(planner)) + 1].tolist()
    begin = np.union1d(np.append(loud + 1, 0), cuts).astype(np.int64)
    end = np.append(begin[1:], n)
    at = np.searchsorted(going, begin)
    begin = np.append(going, n)[at]  # behind what does not move
    end = np.minimum(end, np.append(loud, n)[np.searchsorted(loud, begin)])
    if ends:
        last = np.append(-1, going)[np.searchsorted(going, end)]
        begin, end = begin + 1, last
    long = np.diff(np.searchsorted(going, [begin, end]), axis=0)[0] >= LEAST
    begin, end = first + begin[long], first + end[long]
    return dict(zip(begin.tolist(), end.tolist(), strict=True))


def rows_of_lines(text: StatementText[Any], lines: Collection[int]) -> set[int]:
    """Return the statements that stand on some lines."""
    return {row for line in lines for row in text.rows_on(line)}


# What comes out: arrivals that stand for many.


Chosen = tuple[Sequence[FoundVisit], Ints, Ints]
"""Arrivals, the one that stands for each move of k, and the move of each."""


@dataclass(frozen=True)
class Stages:
    """What the k moves of a block are made with.

    Attributes:
        begin, end: Modes where the program came to it the last time, and left it.
        modes: All that any of them is made with, m.
        stage: Index into `modes` of each move, (k,).
    """

    begin: Any
    end: Any
    modes: Sequence[Any]
    stage: Ints

    def join(self, before: Stages) -> Self:
        """Keep what is the same for each move as it was before."""
        pairs, first = number_rows([before.stage, self.stage], len(self.stage))
        olds, news = (
            [one.modes[k] for k in one.stage[first].tolist()] for one in (before, self)
        )
        joined = [a.join(b) for a, b in zip(olds, news, strict=True)]
        return replace(self, modes=joined, stage=pairs)


@dataclass
class MoveBlock(FoundVisit):
    """Moves that follow each other, each from the one before.

    Attributes:
        at_once: Their rows, (k,).
        examples: Arrivals of which each stands for some of them, which differ from it
            in names and numbers only.
        group: The one that stands for each, (k,).
        offset: How many numbers behind those of its example its own stand, (k,).
        names: What each goes to, k, or none where no name is said.
        aux: External axes of each, (k, a), None where they are those of the example.
        values: Numbers of each, (k, w), None where the text has them.
        stages: What they are made with, where statements between them may set that.
    """

    at_once: Ints = field(kw_only=True)
    examples: Sequence[FoundVisit] = field(kw_only=True)
    group: Ints = field(kw_only=True)
    offset: Ints = field(kw_only=True)
    names: NameColumn | None = field(kw_only=True, default=None)
    aux: Floats | None = field(kw_only=True, default=None)
    values: Floats | None = field(kw_only=True, default=None)
    stages: Stages | None = field(kw_only=True, default=None)

    @classmethod
    def of(cls, chosen: Chosen, rows: Ints, origin: Ints, **more: Any) -> Self:
        """Put a block together.

        Args:
            chosen: As `choose_examples` returns it.
            rows: Its moves, (k,).
            origin: First number of the statement that says where each goes, (k,).
            more: What else is said of it.
        """
        (one, *_), group, first = chosen
        return cls(
            one.scope, one.motion, False, one.goal, count=len(rows), at_once=rows,
            examples=chosen[0], group=group, offset=origin - origin[first][group],
            **more,
        )  # fmt: skip

    @property
    def rows(self) -> Ints:
        """The rows of all moves that it stands for."""
        return self.at_once

    @property
    def arrivals(self) -> Sequence[FoundVisit]:
        """What tells the arrivals that it stands for apart."""
        return self.examples

    @property
    def members(self) -> Sequence[Ints]:
        """The moves that each example stands for, by their place among these."""
        return [own for _, own in split_by(self.group)]


def choose_examples(
    columns: Sequence[Ints],
    alone: Bools,
    read: Callable[[int], FoundVisit],
    slots_of: Callable[[int], Sequence[int]],
) -> Chosen:
    """Find arrivals of which each stands for all that are alike, and read them.

    Args:
        columns: What tells k moves apart, (k,) each.
        alone: Which of them are read by themselves, (k,).
        read: Reads one.
        slots_of: Tells which numbers one that stands for others must go to.

    Returns:
        The arrivals, the one that stands for each move, (k,), and the move of each.
    """
    known, alone = dict[int, FoundVisit](), alone.copy()
    while True:
        apart = np.where(alone, np.arange(len(alone)), -1)
        group, first = number_rows([*columns, apart], len(alone))
        count, tops = np.bincount(group).tolist(), first.tolist()
        known |= {k: read(k) for k in tops if k not in known}
        odd = [g for g, k in enumerate(tops) if count[g] > 1 and not
               _stands_for_others(known[k].goal, slots_of(k))]  # fmt: skip
        if not odd:
            break
        alone[np.isin(group, odd)] = True
    for k, many in zip(tops, count, strict=True):
        known[k].count = many
    return [known[k] for k in tops], group, first


def _stands_for_others(goal: FoundGoal, slots: Sequence[int]) -> bool:
    """Tell whether nothing but names and numbers is said of a goal alone."""
    own = bool(goal.name and goal.pins) or bool(goal.names | goal.holds)
    return goal.slots == slots and goal.shift is None and not own
