"""Blocks of moves of a task: where they go, and which arrivals stand for many."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from postproc.arrays import Ints
from postproc.language import ir
from postproc.language.analysis.assigned_points import Points, Scope
from postproc.language.analysis.call_context import At, Context
from postproc.language.analysis.found_goals import FoundVisit
from postproc.language.analysis.goals import GoalReader
from postproc.language.analysis.interpreter import Interpreter, S
from postproc.language.analysis.move_blocks import (
    MoveBlock,
    PlainMove,
    PlainMoves,
    Runs,
    Stages,
    TargetSlots,
    choose_examples,
    find_plain,
    find_runs,
    find_sound,
    numbers_at,
    rows_of_lines,
    split_by,
)
from postproc.language.analysis.symbols import TaskSymbols, element_of, whole
from postproc.language.text.symbol_column import NameColumn

OUTSIDE = 6  # external axes
ALONE = -1  # kind of a target that is read by itself


@dataclass(frozen=True)
class PointKind:
    """What targets have in common that are written alike.

    Attributes:
        file: The file that they are written in.
        target: Which numbers of their statements they are.
        shared: Other programs may read them too.
    """

    file: int
    target: TargetSlots
    shared: bool = False


@dataclass
class BlockTargets:
    """Where k moves go.

    Attributes:
        variant: The variant of each move, (k,).
        kind: The kind of each target, (k,), or `ALONE`.
        origin: First number of the statement that it is written in, (k,).
        names: What each is called, k, "" where it is written in the move.
    """

    variant: Ints
    kind: Ints
    origin: Ints
    names: list[str]


@dataclass(kw_only=True)
class BlockMachine(Interpreter[S]):
    """The ways through a task, whose plain moves are read at once.

    Attributes:
        reader: Reads where moves lead.
        ends_apart: The first and the last of a block are read by themselves: what comes
            before or behind tells of these.
        task: What its names mean.
        at_once: Moves that differ only in where they go are read at once.
    """

    reader: ClassVar[type[GoalReader]]
    ends_apart: ClassVar[bool] = False
    task: TaskSymbols[Any]
    at_once: bool = True
    _kinds: list[PointKind] = field(default_factory=list)
    _number: dict[tuple[int, int, bool], int] = field(default_factory=dict)
    _alike: dict[TargetSlots, TargetSlots] = field(default_factory=dict)
    _plain: dict[int, PlainMoves] = field(default_factory=dict)
    _runs: dict[tuple[int, int], Runs] = field(default_factory=dict)
    _points: dict[tuple[object, ...], tuple[int, int]] = field(default_factory=dict)
    _near: dict[int, TargetSlots] = field(default_factory=dict)

    # What a language says.

    def reads_at_once(self, context: Context) -> bool:
        """Return True if moves in a call, or a round of a loop, are read at once."""
        return self.at_once

    def list_apart(self, file: int) -> set[int]:
        """Return the rows of moves that are read by themselves."""
        return set()

    def planner_of(self, one: Any) -> str:
        """Return what plans a move, where there are several that tell moves apart."""
        return ""

    def is_setting(self, one: Any) -> bool:
        """Return True if a statement does nothing but change modes, whatever they are.

        Moves before and behind it are read at once. What it sets goes by its numbers,
        and by data; it has no part in where the arm is and stops, nor in points.
        """
        return False

    @abstractmethod
    def set_modes(self, at: At, here: Any) -> Any:
        """Return what a statement makes of what holds that does nothing but set modes.

        Args:
            at: The statement.
            here: How the arm comes to it.
        """

    @abstractmethod
    def read_visits(
        self, one: ir.SourceStatement, scope: Scope, here: Any
    ) -> Iterable[Any]:
        """Read the visits of a move, nothing for all else.

        Args:
            one: The statement.
            scope: Where it stands.
            here: How the arm comes to it, None where that does not count.
        """

    # Which moves are read at once.

    @property
    def texts(self) -> Sequence[Any]:
        """The statements of all files, the main one first."""
        return self.task.numbering.texts

    def runs_of(self, context: Context) -> Runs:
        """Return which moves are read at once in a call, or a round of a loop.

        They are found in the statements of a routine once for all calls of it.
        """
        place = context.place
        key = place.scope.file, place.flow.first
        if not self.reads_at_once(context):
            return {}
        if key not in self._runs:
            plain = self._find_plain(place.scope.file)
            flow, ends = place.flow, self.ends_apart
            own = plain.variant[flow.first : flow.last]
            self._runs[key] = find_runs(flow.first, flow.joins, plain, own, ends)
        return self._runs[key]

    def _find_plain(self, file: int) -> PlainMoves:
        if file not in self._plain:

            def read(one: ir.SourceStatement) -> PlainMove | None:
                if self.is_setting(one):
                    return PlainMove("")
                end, planner = self.task.plain_end(one), self.planner_of(one)
                return PlainMove.to(end, self.task.slots_of, planner)

            sound, text = self.reader.are_sound, self.texts[file]
            apart = rows_of_lines(text, self.task.taught_lines[file])
            apart |= self.list_apart(file)
            alike = self.task.find_alike(file)
            self._plain[file] = find_plain(text, read, sound, apart, alike)
        return self._plain[file]

    # What a block stands for.

    def read_block(
        self, at: At, behind: int, here: Any, old: MoveBlock | None = None
    ) -> MoveBlock:
        """Read the moves of a block.

        Args:
            at: The first of them.
            behind: The row behind the last.
            here: How the arm comes to it.
            old: What it was read as before, None where it was not.
        """
        plain = self._plain[at.place.scope.file]
        every = np.arange(at.row, behind)
        rows = every[plain.going[plain.variant[every]]]
        stages, modes = self._follow_settings(at, every, here), here.modes
        if old is not None and old.stages is not None:
            stages, modes = stages.join(old.stages), old.modes.join(modes)
        targets = self._find_targets(at.place.scope, rows, here.points)
        made = [here.with_modes(one) for one in stages.modes]
        chosen = choose_examples(
            [*self._tell_apart(targets), stages.stage], targets.kind == ALONE,
            lambda k: self._read_one(at, int(rows[k]), made[stages.stage[k]]),
            lambda k: self._slots_at(targets, k),
        )  # fmt: skip
        names = NameColumn(targets.names) if any(targets.names) else None
        return MoveBlock.of(
            chosen, rows, targets.origin, modes=modes, points=here.points, names=names,
            stages=stages,
        )  # fmt: skip

    def _follow_settings(self, at: At, rows: Ints, here: Any) -> Stages:
        """Follow what statements between the moves of a block set, each kind once.

        Args:
            at: The first row of the block.
            rows: Its rows, (n,).
            here: How the arm comes to it.
        """
        plain = self._plain[at.place.scope.file]
        kinds = plain.variant[rows]
        going = plain.going[kinds]
        between, now = np.flatnonzero(~going), 0
        states, behind = [here], [0] * (len(between) + 1)
        number, after = {here.modes: 0}, dict[tuple[int, int], int]()
        pairs = zip(rows[between].tolist(), kinds[between].tolist(), strict=True)
        for k, (row, kind) in enumerate(pairs, start=1):
            if (now, kind) not in after:
                found = self.set_modes(at.to(row), states[now])
                after[now, kind] = number.setdefault(found.modes, len(states))
                states += [found] if after[now, kind] == len(states) else []
            behind[k] = now = after[now, kind]
        modes = [one.modes for one in states]
        at_moves = np.searchsorted(between, np.flatnonzero(going))
        return Stages(modes[0], modes[now], modes, np.array(behind)[at_moves])

    def _read_one(self, at: At, row: int, here: Any) -> FoundVisit:
        """Read a move of a block by itself."""
        statement, scope = at.place.statement(row), replace(at.place.scope, row=row)
        (found,) = self.read_visits(statement, scope, here)
        one: FoundVisit = found
        return one

    def _slots_at(self, targets: BlockTargets, k: int) -> tuple[int, ...]:
        """Return the numbers of the job that a target is written in."""
        kind = self._kinds[targets.kind[k]]
        begin = int(targets.origin[k]) + self.task.numbering.first[kind.file]
        return tuple(begin + at if at >= 0 else -1 for at in kind.target.slots)

    def _tell_apart(self, targets: BlockTargets) -> list[Ints]:
        """Return what tells moves apart of which one cannot stand for the other."""
        columns, width = [targets.variant, targets.kind], len(self.reader.told_apart)
        for at in range(width + OUTSIDE):
            own = np.zeros(len(targets.kind))
            for mine, text, target in self._by_kind(targets.kind):
                flags = [target.slots[k] for k in self.reader.told_apart]
                slot = [*flags, *target.aux][at : at + 1]
                own[mine] = numbers_at(text, targets.origin[mine], slot)[:, 0]
            bits = own.view(np.int64)
            columns += [bits] if (bits != bits[:1]).any() else []
        return columns

    def _by_kind(self, kind: Ints) -> Iterator[tuple[Ints, Any, TargetSlots]]:
        """Yield the moves of each kind, and the text that says where they go, and how.

        Args:
            kind: The kind of each move, (k,).
        """
        for number, mine in split_by(kind):
            if number != ALONE:
                own = self._kinds[number]
                yield mine, self.texts[own.file], own.target

    # Where moves go.

    def _find_targets(self, scope: Scope, rows: Ints, points: Points) -> BlockTargets:
        """Find where moves go, and which of them are read by themselves."""
        text, plain = self.texts[scope.file], self._plain[scope.file]
        variant, kind = plain.variant[rows], np.full(len(rows), ALONE, dtype=np.int64)
        found = BlockTargets(variant, kind, text.first[rows].astype(np.int64), [])
        hidden = {key[0][-1] for key in points.held}.union(scope.parameters)
        hidden |= {*dict(scope.loops)}.union(one[0] for one in scope.given)
        for number, mine in split_by(variant):
            move = plain.moves[number]
            if move.target is not None:
                kind[mine] = self._kind_of(scope.file, move.target)
            else:
                found.names = found.names or [""] * len(rows)
                self._find_named(scope, rows[mine], mine, move, hidden, found)
        named = np.where(plain.named[variant], kind, ALONE)  # others are sound
        for mine, other, target in self._by_kind(named):
            test = self.reader.are_sound
            kind[mine[~find_sound(other, found.origin[mine], target, test)]] = ALONE
        return found

    def _find_named(
        self, scope: Scope, rows: Ints, mine: Ints, move: PlainMove,
        hidden: Collection[str], found: BlockTargets,
    ) -> None:  # fmt: skip
        """Find the points that moves of one variant go to.

        Args:
            scope: Where they stand.
            rows: The moves, (m,).
            mine: Where they are in `found`, (m,).
            move: What they have in common.
            hidden: Names that are something else there, or have been given a value.
            found: What is filled.
        """
        text, plain = self.texts[scope.file], self._plain[scope.file]
        own = plain.name[rows]
        names: Sequence[str] = [move.name] * len(rows)
        if own[0] >= 0:
            names = [*text.shapes.names.take(own.astype(np.int64)).lower()]
        numbers = numbers_at(text, text.first[rows], move.index).tolist()
        spell = self.reader.spell_index
        for k, name, number in zip(mine.tolist(), names, numbers, strict=True):
            index = tuple([whole(x) or 0 for x in number])
            key = *scope.place, name, index
            if key not in self._points:
                self._points[key] = self._find_point(name, index, scope)
            found.names[k] = name + spell(index) if index else name
            if name not in hidden:
                found.kind[k], found.origin[k] = self._points[key]

    def _find_point(
        self, name: str, index: tuple[int, ...], scope: Scope
    ) -> tuple[int, int]:
        """Find a point that is written in numbers and holds them as long as it runs.

        Returns:
            Its kind, `ALONE` for all others; the first number of its statement.
        """
        task, reader = self.task, self.reader(self.task, scope)
        apart = task.apart and bool(index)
        found = task.constant(name, scope, index if apart else ())
        if found is None or reader.read_special(ir.DataObject(name)) is not None:
            return ALONE, 0
        file, datum = found
        target = task.slots_of(element_of(datum.value, () if apart else index))
        if target is None or task.files[file].is_system:
            return ALONE, 0
        first = int(task.files[file].text.first[datum.row])
        slot = task.numbering.first[file] + first + target.slots[0]
        marked = name in task.start.taught or bool(task.taught_lines[file])
        marked = marked and task.is_taught(name, file, datum.row)
        if marked or reader.explain_pinned(name, slot):
            return ALONE, 0
        of_all = found if not apart else task.datum(name, scope)
        shared = of_all is not None and task.is_exported(of_all[1])
        if id(target) not in self._near:
            alike = target.relative()
            self._near[id(target)] = self._alike.setdefault(alike, alike)
        near = self._near[id(target)]
        return self._kind_of(file, near, shared), first + target.begin

    def _kind_of(self, file: int, target: TargetSlots, shared: bool = False) -> int:
        """Return the number of a kind of targets."""
        key = file, id(target), shared
        if key not in self._number:
            self._number[key] = len(self._kinds)
            self._kinds.append(PointKind(file, target, shared))
        return self._number[key]
