"""Visits: every arrival at a target, and the literals that hold the numbers.

What a language hands to everything else; nothing after it knows how a program is spelt.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import (
    Bools,
    Floats,
    Indices,
    Ints,
    chunks,
    narrow,
    read_only,
    take_rows,
)
from postproc.diagnostics import Code, Reason
from postproc.language.pose_encoding import Dialect
from postproc.language.shifts import ANGLES, Shift, Shifts
from postproc.language.text.symbol_column import NameColumn

NO_LINES: Mapping[str, Collection[int]] = MappingProxyType({})
START = -1  # predecessor: wherever the arm stands when the program starts
ELSEWHERE = -2  # predecessor: a place that the program text does not tell


class Meaning(IntEnum):
    """What the numbers of a visit mean."""

    POSE = 0  # x, y, z [mm] and orientation of the tool in the user frame
    JOINTS = 1  # the first six: controller joint angles [deg]
    HOME = 2  # the arm's home: the numbers are in the cell file
    CALIBRATION = 3  # its calibration pose, likewise
    RELATIVE_TOOL = 4  # x, y, z [mm] from where the arm is, in the tool frame
    RELATIVE_BASE = 5  # .. in the base frame
    RELATIVE_UFRAME = 6  # .. in the user frame
    AWAY = 7  # x: distance [mm] back along the tool's approach vector
    NEAR = 8  # numbers of the pose as POSE, `distance_mm` short of it along approach
    ABOUT = 9  # x, y, z: axis, a: angle [deg], e: frame (4, 5 or 6 as above)
    BY = 10  # joint increments [deg]
    FOR = 11  # numbers of the pose as POSE, gone towards for `distance_mm`
    PARTIAL_POSE = 12  # x, y, z [mm] in the user frame; NaN, and the orientation: stay
    PARTIAL_JOINTS = 13  # joint angles [deg]; those that are NaN stay
    UNKNOWN = 99  # the arm moves, the program text does not tell where to


class Switch(IntEnum):
    """A setting that is TRUE or FALSE, as far as the program tells."""

    UNSET = 0
    ON = 1
    OFF = 2
    UNKNOWN = 3  # it is set, to what only the run tells


class Blend(IntEnum):
    """How a point that is passed without stopping is rounded."""

    UNSET = 0
    OVERLAP = 1  # the next move begins before this one ends
    ZONE = 2  # a curve replaces the corner inside of a zone


class OrientationLaw(IntEnum):
    """How the tool turns on its way along a line or an arc."""

    UNSET = 0
    ONE_AXIS = 1  # about one axis that stands still
    ALONG_PATH = 2  # with the direction of the path
    EULER_ANGLES = 3  # three angles in proportion
    ROLL_PITCH_YAW = 4  # .. other ones
    WRIST_JOINTS = 5  # the wrist's joints in proportion
    UNKNOWN = 6  # it is set, to what only the run tells
    START_TO_END = 7  # of an arc: about one axis, whatever the point on its way says


class ZoneRule(IntEnum):
    """What the size of a zone is."""

    UNSET = 0
    AUTO = 1
    PASS = 2  # the point is passed exactly
    WITHIN = 3  # the path passes the point at this distance
    FROM = 4  # the path is left at this distance from the point
    UNKNOWN = 5  # the arm may stop there, or pass it in a zone of any size


def texts_of(n: int, told: Mapping[int, str]) -> tuple[str, ...]:
    """Return n texts of which few are told, and the others "".

    >>> texts_of(3, {1: "a"})
    ('', 'a', '')
    """
    if not told:
        return _nothing(n)
    texts = [""] * n
    for row, text in told.items():
        texts[row] = text
    return tuple(texts)


@lru_cache(maxsize=2)  # of visits, and of literals
def _nothing(n: int) -> tuple[str, ...]:
    """Return n times "", once for all that say nothing of a long program."""
    return ("",) * n


@dataclass(frozen=True)
class NumberPlaces:
    """Where the w numbers of m targets stand, in 4 + 2 w bytes a target as a rule.

    Attributes:
        first: Byte offset of the first of them in its file, (m,).
        offset: How far behind that each begins, (m, w).
        length: Its bytes, (m, w); 0 where a component is not written as a number.
    """

    first: Indices
    offset: NDArray[np.unsignedinteger[Any]]
    length: NDArray[np.unsignedinteger[Any]]

    @classmethod
    def of(cls, start: Indices, end: Indices) -> Self:
        """Take byte offsets, (m, w) each, -1 where a component is no number."""
        rows = chunks(max(len(start), 1))
        return cls.join([cls._of(start[k], end[k]) for k in rows])

    @classmethod
    def _of(cls, start: Indices, end: Indices) -> Self:
        written, none = start >= 0, np.iinfo(np.int32).max
        first = np.where(written, start, none).min(axis=1, initial=none)
        offset = np.where(written, start - first[:, None], 0)
        return cls(
            first.astype(np.int32), narrow(offset), narrow((end - start) * written)
        )

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """Put places one after the other."""
        columns = ([vars(part)[f.name] for part in parts] for f in fields(cls))
        return cls(*map(np.concatenate, columns))

    def __len__(self) -> int:
        """Return the number of targets."""
        return len(self.first)

    def __getitem__(self, rows: Ints | Bools | slice) -> NumberPlaces:
        """Take the places of some targets."""
        return NumberPlaces(self.first[rows], self.offset[rows], self.length[rows])

    @property
    def start(self) -> Ints:
        """Return where numbers begin, (m, w), -1 where there is none."""
        return np.where(self.length > 0, self.first[:, None] + self.offset, -1)

    @property
    def end(self) -> Ints:
        """Return where they end, (m, w), -1 where there is none."""
        behind = self.first[:, None] + self.offset + self.length
        return np.where(self.length > 0, behind, -1)


def _take(column: Any, rows: Ints | slice) -> Any:
    """Take rows of a column, which is an array, texts, or places of numbers."""
    if isinstance(rows, slice):
        return column[rows]
    if isinstance(column, np.ndarray):
        return take_rows(column, rows)
    if isinstance(column, NameColumn):
        return column.take(rows)
    if isinstance(column, Sequence):
        return tuple(map(column.__getitem__, rows.tolist()))
    return column[rows]


@dataclass(frozen=True)
class Literals:
    """m places in the text that hold the numbers of a target.

    Attributes:
        file: Index into `Visits.files`, (m,).
        line: 1-based line of the first number, (m,).
        places: Where each number stands, w a literal as in `Visits.values`.
        joints: True where the numbers are joint angles, (m,).
        name: Variable or array element, or "" for an inline literal; m strings.
        shared: True where another program may read it too (exported), (m,).
        taught: True where the point was taught with the robot, (m,).
        pinned: What else depends on the numbers, so that they must stay as they are, or
            ""; m strings.
    """

    file: Indices
    line: Indices
    places: NumberPlaces
    joints: Bools
    name: Sequence[str]
    shared: Bools
    taught: Bools
    pinned: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of literals."""
        return len(self.file)

    def take(self, rows: Ints) -> Literals:
        """Take some literals, (k,)."""
        return Literals(
            **{f.name: _take(getattr(self, f.name), rows) for f in fields(self)}
        )

    @cached_property
    def pins(self) -> dict[str, Ints]:
        """The literals (k,) by what pins them; free ones are not there."""
        found: dict[str, list[int]] = {}
        for row, why in enumerate(self.pinned if any(self.pinned) else ()):
            if why:
                found.setdefault(why, []).append(row)
        return {why: np.array(found[why]) for why in sorted(found)}


@dataclass(frozen=True)
class VisitPart:
    """Columns of n visits that belong together, and tables that they point into.

    No two parts have a column of the same name.

    Attributes:
        TABLES: Names of what is no column.
    """

    TABLES: ClassVar[frozenset[str]] = frozenset()

    def __post_init__(self) -> None:
        read_only(self)

    @classmethod
    def column_names(cls) -> list[str]:
        """Return the names of the columns."""
        return [f.name for f in fields(cls) if f.name not in cls.TABLES]

    def take(self, rows: Ints | slice) -> Self:
        """Take some visits, (k,); tables stay whole."""
        taken = {name: _take(getattr(self, name), rows) for name in self.column_names()}
        return replace(self, **taken)


@dataclass(frozen=True)
class PlaceColumns(VisitPart):
    """Where moves stand.

    Attributes:
        file: Index into `Visits.files`, (n,).
        line: 1-based line of the move statement, (n,).
        measure_id: Ids of ``MEASURE <id>`` comments, n strings or "" where none.
    """

    file: Indices
    line: Indices
    measure_id: tuple[str, ...]


@dataclass(frozen=True)
class TargetColumns(VisitPart):
    """Where moves go.

    Attributes:
        meaning: `Meaning` of the numbers, (n,).
        values: The numbers of the target as the dialect spells them, (n, w), NaN where
            not known, or not written (see `Meaning`).
        distance_mm: For NEAR and FOR, (n,).
        aux: Auxiliary axis values, (n, k), NaN where there is none.
        config: Index into `configs`, (n,).
        configs: Configuration strings verbatim; "" where none was written.
        config_given: True where configuration flags were written, (n,).
        literal: Index into `Visits.literals`, (n,), -1 where no number may be edited.
        follows: Literal that a computed target moves along with (its numbers are those
            of the literal plus constants), (n,), -1 where there is none.
        name: Index into `names`, (n,); names[0] is "" (inline literal).
        shift: Index into `shifts`, (n,), -1 where the move shifts no point. Where such
            a visit has a literal, it is that of the numbers of its shift.
        shifts: How moves shift the points that they name.
    """

    TABLES = frozenset({"configs", "names", "shifts"})

    meaning: Indices
    values: Floats
    distance_mm: Floats
    aux: Floats
    config: Ints
    configs: tuple[str, ...]
    config_given: Bools
    literal: Indices
    follows: Indices
    name: Ints
    names: Sequence[str]
    shift: Ints
    shifts: tuple[Shift, ...] = ()


@dataclass(frozen=True)
class FrameColumns(VisitPart):
    """The frames that hold at targets.

    Attributes:
        tool, base, uframe: Index into `poses`, (n,), -1 where not known.
        poses: Frames (k, 4, 4) [m].
        taught: True where the text marks the frame as taught, (k,).
        tool_remote: The tool stands still and the arm holds the part, (n,).
    """

    TABLES = frozenset({"poses", "taught"})

    tool: Ints
    base: Ints
    uframe: Ints
    poses: Floats
    taught: Bools
    tool_remote: Bools


@dataclass(frozen=True)
class MotionColumns(VisitPart):
    """How the arm moves.

    Attributes:
        kind: `Motion`, (n,).
        via: True at the VIA point of an arc, (n,).
        fly: True where the arm passes the target without stopping, (n,).
        nearest_turn: Joints go to the nearest turn, whatever the flags say, (n,).
        care: Whether branch and turn are checked, and turns may be far, `Switch`,
            (n, 3).
        wrist_joint: On a line the wrist turns joint by joint, (n,).
        orientation_law: `OrientationLaw`, (n,).
        arc_angle: Angle at which an arc ends instead of at the point that is written
            as its end, the way on that its points follow, (n,) [rad]; NaN for all else.
        block: First visit of the curve that the visit is a point of, (n,), -1 where it
            is of none: one point alone would change all of the curve.
        curved: The way to it is a part of a curve whose shape is the controller's own,
            (n,).
        weaves: The tool weaves on the way, or may, (n,).
        load: Index into `loads`, (n,).
        loads: Loads that the program states: mass [kg] and its centre in the flange
            frame [m], (k, 4), NaN for what it does not state; loads[0] states nothing.
    """

    TABLES = frozenset({"loads"})

    kind: Indices
    via: Bools
    fly: Bools
    nearest_turn: Bools
    care: Ints
    wrist_joint: Bools
    orientation_law: Ints
    arc_angle: Floats
    block: Ints
    curved: Bools
    weaves: Bools
    load: Ints
    loads: Floats


@dataclass(frozen=True)
class ZoneColumns(VisitPart):
    """How targets are passed that the arm does not stop at.

    Attributes:
        size_mm: Size of the zone, (n,), NaN where unset; negative: none.
        overlap_percent: Overlap of moves [%], (n,), NaN where unset.
        blend, rule: `Blend` and `ZoneRule`, (n,).
    """

    size_mm: Floats
    overlap_percent: Floats
    blend: Ints
    rule: Ints


@dataclass(frozen=True)
class SpeedColumns(VisitPart):
    """How fast the arm moves.

    Attributes:
        linear: Along a path [m/s], (n,), NaN where unset.
        turning: Of the tool [rad/s], (n,), NaN where unset.
        override: Product of the speed overrides that hold, (n,) in (0, 1].
    """

    linear: Floats
    turning: Floats
    override: Floats


@dataclass(frozen=True)
class Graph:
    """From where the arm comes to each of n visits.

    Attributes:
        pred_start: Offsets into `pred`, (n + 1,).
        pred: Predecessor visits; START or ELSEWHERE where it is no visit.
    """

    pred_start: Indices
    pred: Indices

    def __post_init__(self) -> None:
        read_only(self)

    def predecessors(self, visit: int) -> Ints:
        """Return the possible predecessors of a visit."""
        return self.pred[self.pred_start[visit] : self.pred_start[visit + 1]]

    @cached_property
    def before(self) -> Ints:
        """The only visit that leads to each, (n,), -1 where none or several do."""
        if len(self.pred_start) == 1:
            return np.empty(0, dtype=np.int64)
        single = np.diff(self.pred_start) == 1
        first = self.pred[np.minimum(self.pred_start[:-1], len(self.pred) - 1)]
        return np.where(single & (first >= 0), first, -1)


@dataclass(frozen=True)
class Visits:
    """n arrivals in program order (structure of arrays).

    A CIRCULAR move makes two visits: its VIA point (`via` True), then its end, whose
    predecessor is the VIA visit. Moves that hold no target are visits too, because they
    turn the joints; their `literal` is -1.

    Attributes:
        files: Names of the files; index 0 is the program itself.
        place: Where the moves stand.
        target: Where they go.
        frame: In which frames.
        motion, zone, speed: How.
        graph: Where the arm comes from.
        reason: Index into `reasons`, (n,); 0 means that the visit may be compensated.
        reasons: Why a visit keeps its numbers; reasons[0] is `NO_REASON`.
        literals: The places in the texts.
        dialect: What numbers and flags of the program mean, and its words.
    """

    files: tuple[str, ...]
    place: PlaceColumns
    target: TargetColumns
    frame: FrameColumns
    motion: MotionColumns
    zone: ZoneColumns
    speed: SpeedColumns
    graph: Graph
    reason: Ints
    reasons: tuple[Reason, ...]
    literals: Literals
    dialect: Dialect

    def __post_init__(self) -> None:
        read_only(self)

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.place.line)

    def file_name(self, visit: int) -> str:
        """Return the name of the file that the move of a visit stands in."""
        return self.files[int(self.place.file[visit])]

    def list_lines(self, visits: Ints, file: int) -> list[str]:
        """List the lines of the moves of visits, each once.

        Those that stand in another file than the one of an index have its name.
        """
        numbers, lines = self.place.file[visits], self.place.line[visits]
        places = zip(numbers.tolist(), lines.tolist(), strict=True)
        return [
            str(line) if k == file else f"{self.files[k]}:{line}"
            for k, line in dict.fromkeys(places)
        ]

    def target_name(self, visit: int) -> str:
        """Return the variable of the target of a visit, "" where it is inline."""
        return str(self.target.names[self.target.name[visit]])

    @property
    def parts(self) -> dict[str, VisitPart]:
        """The parts that have columns, by name."""
        return {
            k: part for k, part in vars(self).items() if isinstance(part, VisitPart)
        }

    @property
    def columns(self) -> dict[str, Any]:
        """The columns of all parts, by name."""
        parts = self.parts.values()
        return {k: getattr(part, k) for part in parts for k in part.column_names()}

    def take(self, rows: Ints | slice, graph: Graph) -> Visits:
        """Take some visits, (k,), that come from where a graph says."""
        parts: dict[str, Any] = {k: part.take(rows) for k, part in self.parts.items()}
        return replace(self, reason=self.reason[rows], graph=graph, **parts)

    def with_columns(self, **columns: Any) -> Visits:
        """Put other columns in the place of some, of whichever part.

        Raises:
            TypeError: No part has such a column.
        """
        changed: dict[str, Any] = {}
        for name, part in self.parts.items():
            if own := {k: columns.pop(k) for k in vars(part) if k in columns}:
                changed[name] = replace(part, **own)
        if columns:
            raise TypeError(f"visits have no columns {', '.join(columns)}")
        return replace(self, **changed)

    @cached_property
    def shifted(self) -> Shifts:
        """The targets that are shifted from points, in columns."""
        target = self.target
        rows = np.flatnonzero(target.shift >= 0)
        own = [target.shifts[k] for k in target.shift[rows].tolist()]
        literal = target.literal[rows].astype(np.int64)
        turns = np.zeros(len(rows), dtype=bool)
        has = np.flatnonzero(literal >= 0)
        written = self.literals.places.length[literal[has], ANGLES] > 0
        turns[has] = written.all(axis=1)
        return Shifts.of(
            rows, own, literal, target.follows[rows].astype(np.int64),
            target.values[rows], turns, self.dialect,
        )  # fmt: skip

    @cached_property
    def run_mates(self) -> Ints:
        """The visit before in the same fly run, (n,), -1 where there is none."""
        before = self.graph.before
        return np.where((before >= 0) & self.motion.fly[before], before, -1)


def line_ranges(lines: Ints | Sequence[int]) -> str:
    """Name every one of some lines, ascending, those that follow each other as one.

    >>> line_ranges([2, 5, 6, 7, 7, 9])
    '2, 5-7, 9'
    """
    found = np.unique(np.asarray(lines, dtype=np.int64))
    first = np.flatnonzero(np.diff(found, prepend=-1) != 1)
    last = np.append(first[1:], len(found)) - 1
    pairs = zip(found[first].tolist(), found[last].tolist(), strict=True)
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in pairs)


# What a user's program can contain is no exception: it is collected and reported.

NOT_FOLLOWED = frozenset({Code.NEVER_REACHED, Code.MOTION_UNKNOWN, Code.OTHER_ARM})
"""Findings that tell of targets without a visit, or may: they keep their values."""


@dataclass(frozen=True, order=True)
class Diagnostic:
    """One finding about a program.

    Attributes:
        file: File name the line belongs to.
        line: 1-based line.
        code: What kind of finding it is.
        message: What was found, what it means and what the user can do.
    """

    file: str
    line: int
    code: Code
    message: str

    def __str__(self) -> str:
        """Write it as a line."""
        return f"{self.file}:{self.line}: {self.code}: {self.message}"


def deduplicate(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Join findings that say the same of the same line, and say how often.

    A line that is reached several times, in a routine or a loop, gives one for every
    visit.

    >>> deduplicate([Diagnostic("a.pdl", 1, Code.PAGE, "odd")] * 3)[0].message
    'odd (3 times)'
    """
    return tuple(
        one if times == 1 else replace(one, message=f"{one.message} ({times} times)")
        for one, times in Counter(found).items()
    )


def never_reached(
    missed: Mapping[str, Ints],
    begin: str,
    caller: str,
    beside: Mapping[str, Collection[int]] = NO_LINES,
) -> list[Diagnostic]:
    """List the files with moves to targets that no way from the start leads to.

    Such a move stands in a routine that nobody calls, or behind a jump. From where it
    is reached cannot be known, so that it is not compensated; what calls the routine
    from elsewhere would run it uncompensated.

    Args:
        missed: Lines of such moves, ascending, by file.
        begin: Where ways begin, in the words of the language.
        caller: What may call the routine from elsewhere.
        beside: Lines that run in ways that are not followed, by file.
    """
    found: list[Diagnostic] = []
    for name, lines in missed.items():
        runs = np.isin(lines, [*beside.get(name, ())])
        texts = (
            f"moves that are never reached from {begin}: {{}}. They are not "
            f"compensated: give the {caller} that calls their routine, or remove them",
            "moves that an interrupt, a trigger or another way that is not followed "
            "leads to: {}. They are not compensated: it is not known from where the "
            "arm comes",
        )
        for text, own in zip(texts, (lines[~runs], lines[runs]), strict=True):
            if len(own):
                told = text.format(f"{len(own)} (lines {line_ranges(own)})")
                found.append(Diagnostic(name, int(own[0]), Code.NEVER_REACHED, told))
    return found
