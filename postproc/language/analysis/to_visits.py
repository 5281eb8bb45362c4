"""From the arrivals that a `TaskMachine` has found to `Visits`."""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import (
    Callable,
    Collection,
    Hashable,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
    Set,
)
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, Interned, Ints, slim
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.analysis.assigned_points import AssignedPoint, Scope
from postproc.language.analysis.call_context import in_program_order
from postproc.language.analysis.move_runs import unfold, within
from postproc.language.analysis.task_machine import TaskMachine
from postproc.language.pose_encoding import Dialect
from postproc.language.shifts import Shift
from postproc.language.text.comment_directives import MEASURE, Comments
from postproc.language.text.statement_table import StatementText
from postproc.language.visits import (
    Blend,
    FrameColumns,
    Graph,
    Literals,
    Meaning,
    MotionColumns,
    NumberPlaces,
    OrientationLaw,
    PlaceColumns,
    SpeedColumns,
    Switch,
    TargetColumns,
    Visits,
    ZoneColumns,
    ZoneRule,
)
from postproc.robot.pose import pose_from_record
from postproc.robot.trajectory import Motion

TOO_COMPLEX = Reason(Code.TOO_COMPLEX, "the program is too complex to be followed")
ONLY_SHIFTED = Reason(
    Code.NUMBERS_NOT_OWN,
    "it is shifted from a point that no move goes to: what to correct?",
)
_NO_FRAME = -1
MOST_NAMED, MOST_PARTS = 3, 6  # lines or data, components, in a reason
NO_LOAD: tuple[float, ...] = (math.nan,) * 4  # one object: NaN differs from itself
Pose = tuple[float, ...]
"""The rows of a pose (4, 4) [m] one after the other, empty where it is not known."""
IDENTITY: Pose = (1.0, *(0.0,) * 4, 1.0, *(0.0,) * 4, 1.0, *(0.0,) * 4, 1.0)


def flat(pose: Floats) -> Pose:
    """Write the rows of a pose, (4, 4) [m], one after the other."""
    return tuple(pose.ravel().tolist())


def compose_poses(first: Pose, second: Pose) -> Pose:
    """Compose two poses."""
    one, other = np.array([first, second]).reshape(2, 4, 4)
    return flat(one @ other)


def cell_pose(record: Sequence[float] | None) -> Pose:
    """Take a position record [mm, deg] over from the cell."""
    return flat(pose_from_record(np.array(record, float))) if record else ()


@dataclass(frozen=True)
class FoundShift:
    """How a move shifts the point that it names, and where that is written.

    Attributes:
        shift: The shift.
        file: Index of the file that holds its numbers.
        slots: Which numbers of that file they are, w as of a target, -1 where nothing
            is written; the first one is -1 where the shift keeps its numbers.
        pins: Why they must stay, "" where they need not.
    """

    shift: Shift
    file: int = -1
    slots: tuple[int, ...] = (-1,)
    pins: str = ""


@dataclass(frozen=True)
class FoundGoal:
    """Where a move goes.

    Attributes:
        target: What the numbers mean.
        values: w numbers, NaN where not known.
        file: Index of the file that holds them.
        slots: Which numbers of that file they are, -1 for those that are computed;
            the first one tells literals apart.
        follows: Likewise of the point that it is shifted from.
        name: Of the point, "" where it is written in the move.
        aux: External axes, NaN where there is none.
        why: Why it cannot be compensated.
        pins: Why the numbers must stay, "" where they need not.
        shared: Other programs may read it too.
        shift: How it is shifted from a point, None where it is not, or not known.
        stays: The point that it is made from keeps its numbers for this move.
        holds: Files and first numbers of shifts that keep their numbers for this move.
        given: What assignments gave to the data that the move names.
        doubtful: Names of data of which only the run tells what they hold.
    """

    target: Meaning
    values: tuple[float, ...]
    file: int = -1
    slots: tuple[int, ...] = (-1,)
    follows: tuple[int, ...] = (-1,)
    name: str = ""
    aux: tuple[float, ...] = (math.nan,) * 6
    why: Reason = NO_REASON
    pins: str = ""
    shared: bool = False
    shift: FoundShift | None = None
    stays: bool = False
    holds: frozenset[tuple[int, int]] = frozenset()
    given: frozenset[AssignedPoint] = frozenset()
    doubtful: frozenset[str] = frozenset()

    @property
    def lost(self) -> FoundGoal:
        """The goal where data that it names hold different values on the ways here."""
        names = sorted({point.name for point in self.given})
        why = explain_disagreement(Code.RUNTIME_VALUE, self.given)
        goal = hold_numbers(self, self.name, why, self.pins, aux=self.aux)
        return replace(goal, doubtful=frozenset({*names, _array_of(self.name)} - {""}))

    @property
    def writes(self) -> tuple[int, tuple[int, ...]]:
        """The file and the numbers in it that may be written anew for this move."""
        if self.is_rewritten_by_shift:
            assert self.shift is not None
            return self.shift.file, self.shift.slots
        return self.file, self.slots

    @property
    def is_rewritten_by_shift(self) -> bool:
        """Whether it is the numbers of the shift that may be written anew."""
        return self.shift is not None and self.shift.slots[0] >= 0

    @property
    def origin(self) -> tuple[int, ...]:
        """The numbers that it holds, or that it moves along with."""
        return self.follows if self.slots[0] < 0 <= self.follows[0] else self.slots

    @property
    def point(self) -> tuple[int, int]:
        """The file of its point, or the point that it is shifted from, and its place.

        The place is that of the first number, -1 where it is not written.
        """
        return self.file, max(self.slots[0], self.follows[0])


def explain_disagreement(code: Code, given: Iterable[AssignedPoint]) -> Reason:
    """Say that assigned data hold different values on the ways to a move."""
    names = sorted({point.name for point in given})
    text = f"{', '.join(names[:MOST_NAMED])} is given different values on the ways "
    return Reason(code, f"{text}here, or beside them")


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
    own = set[tuple[int, int]]()
    if base.is_rewritten_by_shift:
        file, slots = base.writes
        own = {(file, slots[0])}
    unknown = meaning == Meaning.UNKNOWN and base.origin[0] < 0
    return FoundGoal(
        meaning, values or tuple(math.nan for _ in base.values), base.file,
        tuple(-1 for _ in base.values), base.origin, _whole(name) if unknown else name,
        aux, why, pins or why.text, stays=True,
        holds=base.holds | own,
    )  # fmt: skip


def spell_element(held: AssignedPoint, brackets: str) -> str:
    """Spell a point, or an element of an array.

    Args:
        held: The point.
        brackets: Those around an index.
    """
    index = ",".join(map(str, held.index))
    return held.name + (index and f"{brackets[0]}{index}{brackets[1]}")


def explain_components(
    held: AssignedPoint, name: str, files: Sequence[Any], known: bool
) -> Reason:
    """Say which components of a point are set by themselves, and where.

    Args:
        held: The point.
        name: As it is spelt.
        files: Of the task.
        known: All of its numbers are known.
    """
    late = [one for one in held.components if one.value is None]
    meant = late or held.components
    lines = defaultdict[int, set[int]](set)
    for one in meant:
        lines[one.file].add(files[one.file].text.line(one.row))
    places = [
        f"line{'s' * (len(own) > 1)} {', '.join(map(str, sorted(own)[:MOST_NAMED]))} "
        f"of {files[at].text.source.name}"
        for at, own in sorted(lines.items())
    ]
    parts = ", ".join(one.name for one in meant[:MOST_PARTS])
    more = len(meant) - MOST_PARTS
    parts += f" and {more} more" if more > 0 else ""
    text = f"{name}: {parts} set in {', '.join(places)}"
    if late:
        text = f"{text} to what is known only when the program runs"
    elif not known:
        text = f"{text}; its other numbers are known only when the program runs"
    return Reason(Code.COMPUTED_TARGET if known else Code.RUNTIME_VALUE, text)


def not_reached(goal: FoundGoal, why: Reason) -> FoundGoal:
    """Return the goal of a move that need not reach it: its numbers stay.

    Args:
        goal: What the move names.
        why: Why it need not reach it.
    """
    numbers = (max(goal.slots[0], goal.follows[0]),)
    return FoundGoal(
        Meaning.UNKNOWN, tuple(math.nan for _ in goal.values), goal.file,
        follows=numbers, name=goal.name, aux=goal.aux, why=why,
        pins=goal.pins or why.text,
    )  # fmt: skip


@dataclass
class FoundVisit:
    """One arrival, as it is found.

    Attributes:
        scope, row: The move.
        motion, via: `Motion`, and whether it is the point of an arc.
        goal: Where it goes.
        modes: What holds there.
        origins: Where it may come from.
        why: Why it cannot be compensated.
        arc_angle: As in `Visits` [rad].
        block: Tells the curves apart that visits are points of, None for none.
        curved: As in `Visits`.
        count: How many moves it stands for that follow each other and differ only in
            where they go: this one is the first.
        agreed: The points that it names hold the same on every way here.
        taken: What assignments gave to the frames and other data that it names.
        kept: These hold the same on every way here.
    """

    scope: Scope
    row: int
    motion: Motion
    via: bool
    goal: FoundGoal
    modes: Any
    origins: frozenset[int] = frozenset()
    why: Reason = NO_REASON
    arc_angle: float = math.nan
    block: Hashable = None
    curved: bool = False
    count: int = 1
    agreed: bool = True
    taken: frozenset[AssignedPoint] = frozenset()
    kept: bool = True

    def forget_conditions(self) -> None:
        """Forget what it is carried out with, where that differs on the ways here."""


@dataclass(frozen=True)
class Conditions:
    """What an arrival is carried out with, in neutral terms.

    Attributes:
        tool, base, uframe: Frames.
        taught: Tool and user frame were taught with the arm, and contain its error.
        remote: The tool stands still, and the arm holds the part.
        reasons: Why it cannot be compensated; `NO_REASON` does not count.
        flags: Whether its configuration flags are checked.
        flagged: It has such flags.
        law: How the tool turns on the way.
        zone_mm: Size of its zone, NaN where it stops.
        speed: Along the path [m/s], NaN where not known.
        wrist: On a line the wrist turns joint by joint.
        override: Share of the programmed speed, 0 or NaN where not known.
        overlap: Of moves that begin before the last has ended [%], NaN for a zone.
        exact: It is passed exactly, without stopping.
        unsized: It may be a stop, or be passed in a zone of any size.
        load: What the program states that the arm carries: mass [kg] and its centre in
            the flange frame [m], empty where it states nothing.
    """

    tool: Pose
    base: Pose
    uframe: Pose
    taught: tuple[bool, bool]
    remote: bool
    reasons: Sequence[Reason]
    flags: Switch
    flagged: bool
    law: OrientationLaw
    zone_mm: float
    speed: float
    wrist: bool = False
    override: float = 1.0
    overlap: float = math.nan
    exact: bool = False
    unsized: bool = False
    load: tuple[float, ...] = ()


def visits_of(
    machine: TaskMachine,
    dialect: Dialect,
    conditions: Callable[[Any], Conditions],
    comments: Comments,
    moves: Mapping[int, Sequence[int]],
) -> Visits:
    """Put the arrivals into the order of the program, as columns.

    Args:
        machine: It has followed all ways.
        dialect: What the numbers mean.
        conditions: Says what an arrival is carried out with.
        comments: How the language writes them.
        moves: Rows of statements that move, by file.
    """
    order = in_program_order(machine.keys)
    found = [machine.visits[k] for k in order]
    held = [conditions(v) for v in found]
    texts, n = machine.texts, len(found)
    numbers = Interned[Reason]([NO_REASON])
    other = [*_goals_beside(machine, moves)]
    literals, literal, follows, copies = _literals(
        found, machine, dialect.width, comments, other
    )
    reasons = [_reason(c, machine.exhausted) for c in held]
    for k in np.flatnonzero(follows == _NO_LITERAL).tolist():
        reasons[k] = reasons[k] or ONLY_SHIFTED
    follows[follows == _NO_LITERAL] = -1
    counts = np.array([v.count for v in found], np.int64)
    ids = _read_measure_ids(found, texts, comments, moves)
    visits = Visits(
        files=tuple(text.source.name for text in texts),
        place=_place(found, texts, ("",) * n if (counts > 1).any() else tuple(ids)),
        target=_target(found, held, dialect.width, literal, follows),
        frame=_frames(held),
        motion=_motion(found, held),
        zone=_zone(found, held),
        speed=_speed(held),
        graph=_graph(machine, order),
        reason=slim(np.array(numbers.of(reasons), np.int64)),
        reasons=tuple(numbers),
        literals=literals,
        dialect=dialect,
    )
    if (counts <= 1).all():
        return visits
    values, line = _each(found, counts, visits.target.values, machine)
    return unfold(visits, counts, copies, values, line, tuple(ids))


def _each(
    found: Sequence[FoundVisit], counts: Ints, values: Floats, machine: TaskMachine
) -> tuple[Floats, Ints]:
    """Return the numbers and the line of each move that visits stand for."""
    owner, inside = within(counts)
    out, begin = values[owner], np.cumsum(counts) - counts
    for k in np.flatnonzero(counts > 1).tolist():
        v, text = found[k], machine.texts[found[k].scope.file]
        own = np.flatnonzero(np.array(v.goal.slots) >= 0)
        first = np.array(v.goal.slots, np.int64)[own]
        places = first + _stride(v, machine) * np.arange(v.count)[:, None]
        out[begin[k] : begin[k] + v.count, own] = text.value[places]
    file = np.array([v.scope.file for v in found], np.int64)[owner]
    row = np.array([v.row for v in found], np.int64)[owner] + inside
    line = np.zeros(len(owner), np.int64)
    for number, text in enumerate(machine.texts):
        mine = file == number
        line[mine] = text.source.lines_of(text.begin[row[mine]])
    return out, line


def _stride(v: FoundVisit, machine: TaskMachine) -> int:
    """Return how many numbers the statement of a visit has."""
    first = machine.texts[v.scope.file].first
    return int(first[v.row + 1] - first[v.row])


def _read_measure_ids(
    found: Sequence[FoundVisit],
    texts: Sequence[StatementText[Any]],
    comments: Comments,
    moves: Mapping[int, Sequence[int]],
) -> list[str]:
    """Return the id that a comment gives to every visit, "" where none does."""
    ids: dict[tuple[int, int], str] = {}
    for file, rows in moves.items():
        text = texts[file]
        last = text.source.lines_of(text.end[np.asarray(rows, np.int64)])
        for line, mark in comments.marks(text.source, MEASURE):
            at = int(np.searchsorted(last, line))
            if at < len(rows):
                ids.setdefault((file, rows[at]), mark)
    return [
        "" if v.via else ids.get((v.scope.file, v.row + k), "")
        for v in found
        for k in range(v.count)
    ]


def _reason(held: Conditions, exhausted: bool) -> Reason:
    """Say why a visit cannot be compensated."""
    if exhausted:
        return TOO_COMPLEX
    return next((why for why in held.reasons if why), NO_REASON)


def _place(
    found: Sequence[FoundVisit],
    texts: Sequence[StatementText[Any]],
    ids: tuple[str, ...],
) -> PlaceColumns:
    lines = [texts[v.scope.file].line(v.row) for v in found]
    return PlaceColumns(
        file=slim(np.array([v.scope.file for v in found], np.int64)),
        line=np.array(lines, np.int64),
        measure_id=ids,
    )


def _target(
    found: Sequence[FoundVisit],
    held: Sequence[Conditions],
    width: int,
    literal: Ints,
    follows: Ints,
) -> TargetColumns:
    n, names, shifts = len(found), Interned([""]), Interned[Shift]()
    own = [v.goal.shift if v.goal.target == Meaning.POSE else None for v in found]
    shift = [-1 if one is None else shifts[one.shift] for one in own]
    values = np.array([v.goal.values for v in found], float)
    return TargetColumns(
        meaning=slim(np.array([v.goal.target for v in found], np.int64)),
        values=values.reshape(n, -1) if n else np.empty((0, width)),
        distance_mm=slim(np.full(n, np.nan)),
        aux=_aux(found),
        config=slim(np.zeros(n, dtype=np.int64)),
        configs=("",),
        config_given=slim(np.array([c.flagged for c in held], bool)),
        literal=literal,
        follows=slim(follows),
        name=slim(np.array(names.of([v.goal.name for v in found]), np.int64)),
        names=tuple(names),
        shift=slim(np.array(shift, np.int64)),
        shifts=tuple(shifts),
    )


def _frames(held: Sequence[Conditions]) -> FrameColumns:
    poses = Interned[tuple[Pose, bool]]()

    def index(frames: Iterable[tuple[Pose, bool]]) -> Ints:
        rows = [poses[frame] if frame[0] else _NO_FRAME for frame in frames]
        return slim(np.array(rows, np.int64))

    return FrameColumns(
        base=index((c.base, False) for c in held),
        tool=index((c.tool, c.taught[0]) for c in held),
        uframe=index((c.uframe, c.taught[1]) for c in held),
        poses=np.array([pose for pose, _ in poses], float).reshape(-1, 4, 4),
        taught=np.array([taught for _, taught in poses], bool),
        tool_remote=slim(np.array([c.remote for c in held], bool)),
    )


def _motion(found: Sequence[FoundVisit], held: Sequence[Conditions]) -> MotionColumns:
    n, loads = len(held), Interned[tuple[float, ...]]([NO_LOAD])
    care = np.repeat(np.array([c.flags for c in held], np.int64)[:, None], 3, axis=1)
    return MotionColumns(
        kind=slim(np.array([v.motion for v in found], np.int64)),
        via=slim(np.array([v.via for v in found], bool)),
        fly=slim(_is_passed(found, held)),
        nearest_turn=slim(np.zeros(n, dtype=bool)),
        care=care.reshape(-1, 3),
        wrist_joint=slim(np.array([c.wrist for c in held], bool)),
        orientation_law=slim(np.array([c.law for c in held], np.int64)),
        arc_angle=slim(np.array([v.arc_angle for v in found], float)),
        block=slim(_blocks(found)),
        curved=slim(np.array([v.curved for v in found], bool)),
        weaves=slim(np.zeros(n, dtype=bool)),
        load=slim(np.array(loads.of([c.load or NO_LOAD for c in held]), np.int64)),
        loads=np.array(list(loads), float).reshape(-1, 4),
    )


def _is_passed(found: Sequence[FoundVisit], held: Sequence[Conditions]) -> Bools:
    """Tell which visits the arm passes without stopping, or may, (n,)."""
    passed = [
        v.via or c.exact or c.unsized or c.zone_mm >= 0.0 or c.overlap >= 0.0
        for v, c in zip(found, held, strict=True)
    ]
    return np.array(passed, bool)


def _zone(found: Sequence[FoundVisit], held: Sequence[Conditions]) -> ZoneColumns:
    size = np.array([c.zone_mm for c in held], float)
    overlap = np.array([c.overlap for c in held], float)
    via, fly = np.array([v.via for v in found], bool), _is_passed(found, held)
    overlaps, unsized = overlap >= 0.0, np.array([c.unsized for c in held], bool)
    rounded = np.where(overlaps, Blend.OVERLAP, Blend.ZONE)
    rule = np.where([c.exact for c in held], ZoneRule.PASS, ZoneRule.FROM)
    rule = np.where(unsized & ~via, ZoneRule.UNKNOWN, rule)
    return ZoneColumns(
        size_mm=slim(np.where(size >= 0.0, size, np.nan)),
        overlap_percent=slim(np.where(overlaps, overlap, 100.0)),
        blend=slim(np.where(fly, rounded, Blend.UNSET)),
        rule=slim(np.where(fly & ~overlaps, rule, ZoneRule.UNSET)),
    )


def _speed(held: Sequence[Conditions]) -> SpeedColumns:
    share = np.array([c.override for c in held], float)
    return SpeedColumns(
        linear=slim(np.array([c.speed for c in held], float)),
        turning=slim(np.full(len(held), np.nan)),
        override=slim(np.where(share > 0.0, share, 1.0)),
    )


def _blocks(found: Sequence[FoundVisit]) -> Ints:
    """Return the first visit of the curve of each, -1 where it is on none."""
    first: dict[Hashable, int] = {}
    own = [-1 if v.block is None else first.setdefault(v.block, k)
           for k, v in enumerate(found)]  # fmt: skip
    return np.array(own, np.int64)


def _aux(found: Sequence[FoundVisit]) -> np.ndarray:
    """External axes that have a value, (n, k): up to the last that is used."""
    aux = np.array([v.goal.aux for v in found], float).reshape(len(found), 6)
    used = np.flatnonzero(~np.isnan(aux).all(axis=0))
    return aux[:, : int(used.max(initial=-1)) + 1]


# Where the numbers stand.

_NO_LITERAL = -2  # follows numbers that are no literal
MOST_NUMBERS = 17  # of a target
UNKNOWN_POINT = "its move shifts a point, too, whose numbers are not known or computed"
TAUGHT_SHIFT = "a target that is computed from it is marked as taught"
ANY_ELEMENT = "a move goes to an element of {} that only the run tells"
ANY_VALUE = "a move goes to {} where only the run tells what it holds"
BESIDE = (
    "the move in line {} of {} goes there too: how it is reached there is not followed"
)


def _literals(
    found: Sequence[FoundVisit],
    machine: TaskMachine,
    width: int,
    comments: Comments,
    other: Sequence[tuple[FoundGoal, str]],
) -> tuple[Literals, Ints, Ints, Ints]:
    """Find the distinct literals; also those of visits, and those they follow.

    The last are how many literals each of them stands for, as its visit does.

    Args:
        found: The visits.
        machine: It has followed all ways.
        width: Numbers of a target.
        comments: How the language writes them.
        other: Where moves go that run beside, and why their literals stay.
    """
    index: dict[tuple[int, int], int] = {}
    rows: list[FoundVisit] = []
    literal = np.full(len(found), -1, dtype=np.int64)
    for k, v in enumerate(found):
        file, slots = v.goal.writes
        if slots[0] >= 0:
            if (file, slots[0]) not in index:
                index[file, slots[0]] = len(rows)
                rows.append(v)
            literal[k] = index[file, slots[0]]
    pinned = _find_pinned(found, rows, index, other, machine.task.uses.copies)
    _hold_for_taught(pinned, found, index, machine, comments)
    taught = _find_taught(found, literal, len(rows), machine, comments)
    literals = _places(rows, machine, pinned, taught, width)
    counts = np.array([v.count for v in rows], np.int64)
    return literals, literal, _find_followed(found, index), counts


def _find_followed(
    found: Sequence[FoundVisit], index: Mapping[tuple[int, int], int]
) -> Ints:
    """Find the literals that computed targets move along with, (n,), -1 for none.

    Where a shift can make up for all, the point need be no move's own. Targets do not
    move along with a point that stays.
    """
    follows = np.full(len(found), -1, dtype=np.int64)
    for k, v in enumerate(found):
        if v.goal.slots[0] < 0 <= v.goal.follows[0]:
            none = -1 if v.goal.is_rewritten_by_shift else _NO_LITERAL
            known = v.goal.target == Meaning.POSE and not v.goal.stays
            follows[k] = index.get(v.goal.point, none) if known else -1
    return follows


def _find_pinned(
    found: Sequence[FoundVisit],
    rows: Sequence[FoundVisit],
    index: Mapping[tuple[int, int], int],
    other: Sequence[tuple[FoundGoal, str]],
    copies: Set[tuple[str, str]],
) -> list[str]:
    """Say why literals must stay, "" where they need not; args as of `_literals`."""
    goals = [(v.goal, ANY_ELEMENT.format(v.goal.name)) for v in found]
    # Of moves to an element of an array that is not known.
    elements = {goal.name: why for goal, why in (*goals, *other)
                if goal.name and max(goal.slots[0], goal.follows[0]) < 0
                and not _array_of(goal.name)}  # fmt: skip
    elements |= {
        name: ANY_VALUE.format(name) for v in found for name in v.goal.doubtful
    }
    stays = {goal.point: why for goal, why in other}
    stays |= {(f, slots[0]): why for g, why in other for f, slots in [g.writes]}
    pinned = []
    for v in rows:
        file, slots = v.goal.writes
        by = v.goal.shift if v.goal.is_rewritten_by_shift else None
        own = elements.get(_array_of(v.goal.name), "") if by is None else by.pins
        pinned.append(stays.get((file, slots[0]), "") or own)
    uncertain = _find_uncertain({*elements}, copies)
    copied = uncertain - elements.keys()
    for v in found:
        unknown = {v.goal.name} & copied
        for point in v.goal.given:
            unknown |= point.names & uncertain
        if unknown:
            place = v.goal.writes[0], v.goal.writes[1][0]
            for at in {index.get(v.goal.point, -1), index.get(place, -1)} - {-1}:
                pinned[at] = pinned[at] or ANY_VALUE.format(min(unknown))
        at = index.get(v.goal.point, -1)
        if at >= 0:
            pinned[at] = pinned[at] or v.goal.pins
        for shift in {index.get(place, -1) for place in v.goal.holds} - {-1}:
            pinned[shift] = pinned[shift] or UNKNOWN_POINT
    return pinned


def _find_uncertain(names: set[str], copies: Set[tuple[str, str]]) -> set[str]:
    """Add what points are made from that moves go to where they are not known.

    >>> sorted(_find_uncertain({"q"}, {("q", "p1"), ("p1", "p0"), ("r", "p2")}))
    ['p0', 'p1', 'q']
    """
    found = set[str]()
    while names - found:
        found |= names
        names = {source for target, source in copies if target in found}
    return found


def _hold_for_taught(
    pinned: list[str],
    found: Sequence[FoundVisit],
    index: Mapping[tuple[int, int], int],
    machine: TaskMachine,
    comments: Comments,
) -> None:
    """Hold the points of targets that are computed and marked as taught, in place."""
    lines = [comments.list_taught(text.source) for text in machine.texts]
    if not any(lines):
        return
    for v in found:
        at, file = index.get(v.goal.point, -1), v.scope.file
        if at < 0 or v.goal.slots[0] >= 0 or v.goal.is_rewritten_by_shift:
            continue
        if not lines[file].isdisjoint(machine.texts[file].lines(v.row)):
            pinned[at] = pinned[at] or TAUGHT_SHIFT


def _goals_beside(
    machine: TaskMachine, moves: Mapping[int, Sequence[int]]
) -> Iterator[tuple[FoundGoal, str]]:
    """Yield where moves go that run in ways that are not followed, and say so."""
    known = {(file, row) for file, rows in moves.items() for row in rows}
    for file, row in sorted(known.intersection(machine.rows_beside())):
        text = machine.texts[file]
        why = BESIDE.format(text.line(row), text.source.name)
        for goal in machine.goals_of(file, row):
            yield goal, why


def _whole(name: str) -> str:
    """Return the name of data without an index.

    >>> _whole("xs[1]"), _whole("p1")
    ('xs', 'p1')
    """
    return re.split(r"[{\[]", name, maxsplit=1)[0]


def _array_of(name: str) -> str:
    """Return the array of an element, "" for other data.

    >>> _array_of("xs[1]"), _array_of("list{1,2}"), _array_of("p1")
    ('xs', 'list', '')
    """
    array, *index = re.split(r"[{\[]", name, maxsplit=1)
    return array if index else ""


def _places(
    rows: Sequence[FoundVisit],
    machine: TaskMachine,
    pinned: Sequence[str],
    taught: Sequence[bool],
    width: int,
) -> Literals:
    """Say where the numbers of literals stand."""
    held = [v.goal.writes for v in rows]
    shifts = [v.goal.is_rewritten_by_shift for v in rows]
    owner, inside = within(np.array([v.count for v in rows], np.int64))
    m, each = len(owner), owner.tolist()
    file = np.array([at for at, _ in held], np.int64)[owner]
    slots = np.array([own for _, own in held], np.int64).reshape(-1, width)[owner]
    stride = np.array([_stride(v, machine) for v in rows], np.int64)[owner]
    slots = np.where(slots >= 0, slots + (stride * inside)[:, None], -1)
    start, end = np.full((m, width), -1), np.full((m, width), -1)
    line = np.zeros(m, dtype=np.int64)
    for number, one in enumerate(machine.texts):
        mine = np.flatnonzero(file == number)
        own, written = slots[mine], slots[mine] >= 0
        start[mine] = np.where(written, np.append(one.start, -1)[own], -1)
        end[mine] = np.where(written, np.append(one.stop, -1)[own], -1)
        line[mine] = one.source.lines_of(start[mine, 0])
    joints = [v.goal.target == Meaning.JOINTS for v in rows]
    shared = [v.goal.shared and not own for v, own in zip(rows, shifts, strict=True)]
    return Literals(
        file=file,
        line=line,
        places=NumberPlaces.of(start, end),
        joints=np.array(joints, bool)[owner],
        name=tuple(rows[k].goal.name for k in each),
        shared=np.array(shared, bool)[owner],
        taught=np.array(taught, bool)[owner],
        pinned=tuple(pinned[k] for k in each),
    )


def _find_taught(
    found: Sequence[FoundVisit],
    literal: Ints,
    count: int,
    machine: TaskMachine,
    comments: Comments,
) -> list[bool]:
    """Tell which literals are those of taught points, or of targets shifted from one.

    Args:
        found: The visits.
        literal: The literal of each, -1 where it has none.
        count: Number of literals.
        machine: It has followed all ways.
        comments: How the language writes them.
    """
    lines = [comments.list_taught(text.source) for text in machine.texts]
    if not (any(lines) or machine.start.taught):
        return [False] * count
    places = [{(v.goal.writes[0], v.goal.writes[1][0]), v.goal.point} for v in found]
    written = {place for some in places for place in some if place[1] >= 0}
    marked = _find_marked(written, machine, lines)
    out = [False] * count
    for v, own, some in zip(found, literal.tolist(), places, strict=True):
        if own >= 0 and not out[own]:
            named = (
                re.split(r"[{\[]", v.goal.name)[0].strip().lower()
                in machine.start.taught
            )
            out[own] = named or not marked.isdisjoint(some)
    return out


def _find_marked(
    places: Collection[tuple[int, int]],
    machine: TaskMachine,
    lines: Sequence[Collection[int]],
) -> set[tuple[int, int]]:
    """Find the targets that a comment marks as taught.

    It speaks of those whose numbers stand on its line; where none do, of all in its
    statement.

    Args:
        places: File and first number of targets.
        machine: It has read the files.
        lines: Lines of such comments, by file.
    """
    found = set[tuple[int, int]]()
    for file, text in enumerate(machine.texts):
        own = sorted(slot for at, slot in places if at == file) if lines[file] else []
        rows = {slot: text.row_of(slot) for slot in own}
        for line in lines[file]:
            there = _on_line(own, rows, text, line)
            near = (slot for slot in own if line in text.lines(rows[slot]))
            found |= {(file, slot) for slot in there or near}
    return found


def _on_line(
    own: Sequence[int], rows: Mapping[int, int], text: StatementText[Any], line: int
) -> set[int]:
    """Return the targets, by their first numbers, with numbers on a line."""
    starts = text.source.line_starts
    begin, end = (*starts[line - 1 : line + 1].tolist(), len(text.source.data))[:2]
    first, last = np.searchsorted(text.start, [begin, end]).tolist()
    found = set[int]()
    for slot in range(first, last):
        at = bisect_right(own, slot) - 1
        if at >= 0 and slot - own[at] < MOST_NUMBERS:
            found |= {own[at]} if text.row_of(slot) == rows[own[at]] else set()
    return found


def _graph(machine: TaskMachine, order: Sequence[int]) -> Graph:
    """Translate origins to visits in program order, in CSR form."""
    place = {number: k for k, number in enumerate(order)}
    found = [
        sorted(place[p] if p >= 0 else p for p in machine.visits[k].origins)
        for k in order
    ]
    start = np.concatenate([[0], np.cumsum([len(f) for f in found])]).astype(np.int64)
    return Graph(start, np.array([p for f in found for p in f], dtype=np.int64))
