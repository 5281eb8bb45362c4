"""Visits: every arrival at a target, and the literals that hold the numbers.

What a language hands to everything else; nothing after it knows how a program is spelt.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Indices, Ints, chunks, narrow, read_only
from postproc.diagnostics import Code, Reason
from postproc.language.pose_encoding import Dialect
from postproc.language.shifts import ANGLES, Shift, Shifts

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

    @cached_property
    def pins(self) -> dict[str, Ints]:
        """The literals (k,) by what pins them; free ones are not there."""
        found: dict[str, list[int]] = {}
        for row, why in enumerate(self.pinned):
            if why:
                found.setdefault(why, []).append(row)
        return {why: np.array(found[why]) for why in sorted(found)}


@dataclass(frozen=True)
class Visits:
    """n arrivals in program order (structure of arrays).

    A CIRCULAR move makes two visits: its VIA point (`via` True), then its end, whose
    predecessor is the VIA visit. Moves that hold no target are visits too, because they
    turn the joints; their `literal` is -1.

    Attributes:
        files: Names of the files; index 0 is the program itself.
        file, line: Where the move statement stands, (n,), line 1-based.
        motion: `Motion`, (n,).
        target: `Meaning`, (n,).
        via: True at the VIA point of an arc, (n,).
        values: The numbers of the target as `dialect` spells them, (n, w), NaN where
            not known, or not written (see `Meaning`).
        distance_mm: For NEAR and FOR, (n,).
        aux: Auxiliary axis values, (n, k), NaN where there is none.
        config: Index into `configs`, (n,).
        configs: Configuration strings verbatim; "" where none was written.
        config_given: True where configuration flags were written, (n,).
        literal: Index into `literals`, (n,), -1 where no number may be edited.
        follows: Literal that a computed target moves along with (its numbers are those
            of the literal plus constants), (n,), -1 where there is none.
        name: Index into `names`, (n,); names[0] is "" (inline literal).
        tool, base, uframe: Index into `frames`, (n,), -1 where not known.
        frames: Poses (k, 4, 4) [m].
        frame_taught: True where the text marks the frame as taught, (k,).
        tool_remote: The tool stands still and the arm holds the part, (n,).
        nearest_turn: Joints go to the nearest turn, whatever the flags say, (n,).
        care: Whether branch and turn are checked, and turns may be far, `Switch`,
            (n, 3).
        fly: True where the arm passes the target without stopping, (n,).
        zone_mm: Size of the zone, (n,), NaN where unset; negative: none.
        overlap_percent: Overlap of moves [%], (n,), NaN where unset.
        blend, zone_rule: `Blend` and `ZoneRule`, (n,).
        lin_spd: Speed along a path [m/s], (n,), NaN where unset.
        rot_spd: Speed of turning [rad/s], (n,), NaN where unset.
        override: Product of the speed overrides that hold, (n,) in (0, 1].
        wrist_joint: On a line the wrist turns joint by joint, (n,).
        orientation_law: `OrientationLaw`, (n,).
        arc_angle: Angle at which an arc ends instead of at the point that is written
            as its end, the way on that its points follow, (n,) [rad]; NaN for all else.
        block: First visit of the curve that the visit is a point of, (n,), -1 where it
            is of none: one point alone would change all of the curve.
        curved: The way to it is a part of a curve whose shape is the controller's own,
            (n,).
        reason: Index into `reasons`, (n,); 0 means that the visit may be compensated.
        reasons: Why a visit keeps its numbers; reasons[0] is `NO_REASON`.
        pred_start: Offsets into `pred`, (n + 1,).
        pred: Predecessor visits; START or ELSEWHERE where it is no visit.
        measure_id: Ids of ``MEASURE <id>`` comments, n strings or "" where none.
        literals: The places in the text.
        dialect: What numbers and flags of the program mean, and its words.
        load: Index into `loads`, (n,).
        loads: Loads that the program states: mass [kg] and its centre in the flange
            frame [m], (k, 4), NaN for what it does not state; loads[0] states nothing.
        weaves: The tool weaves on the way, or may, (n,).
        shift: Index into `shifts`, (n,), -1 where the move shifts no point. Where such
            a visit has a literal, it is that of the numbers of its shift.
        shifts: How moves shift the points that they name.
    """

    files: tuple[str, ...]
    file: Indices
    line: Indices
    motion: Indices
    target: Indices
    via: Bools
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
    tool: Ints
    base: Ints
    uframe: Ints
    frames: Floats
    frame_taught: Bools
    tool_remote: Bools
    nearest_turn: Bools
    care: Ints
    fly: Bools
    zone_mm: Floats
    overlap_percent: Floats
    blend: Ints
    zone_rule: Ints
    lin_spd: Floats
    rot_spd: Floats
    override: Floats
    wrist_joint: Bools
    orientation_law: Ints
    arc_angle: Floats
    block: Ints
    curved: Bools
    reason: Ints
    reasons: tuple[Reason, ...]
    pred_start: Indices
    pred: Indices
    measure_id: tuple[str, ...]
    literals: Literals
    dialect: Dialect
    load: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    loads: Floats = field(default_factory=lambda: np.full((1, 4), np.nan))
    weaves: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    shift: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    shifts: tuple[Shift, ...] = ()

    def __post_init__(self) -> None:
        for name, nothing in (
            ("load", np.int8(0)),
            ("weaves", np.False_),
            ("shift", np.int8(-1)),
        ):
            if len(getattr(self, name)) != len(self.line):
                none = np.broadcast_to(nothing, (len(self.line),))
                object.__setattr__(self, name, none)
        read_only(self)

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.line)

    def predecessors(self, visit: int) -> Ints:
        """Return the possible predecessors of a visit."""
        return self.pred[self.pred_start[visit] : self.pred_start[visit + 1]]

    @cached_property
    def shifted(self) -> Shifts:
        """The targets that are shifted from points, in columns."""
        rows = np.flatnonzero(self.shift >= 0)
        own = [self.shifts[k] for k in self.shift[rows].tolist()]
        literal = self.literal[rows].astype(np.int64)
        turns = np.zeros(len(rows), dtype=bool)
        has = np.flatnonzero(literal >= 0)
        written = self.literals.places.length[literal[has], ANGLES] > 0
        turns[has] = written.all(axis=1)
        return Shifts.of(
            rows, own, literal, self.follows[rows].astype(np.int64),
            self.values[rows], turns, self.dialect,
        )  # fmt: skip

    @cached_property
    def before(self) -> Ints:
        """The only visit that leads to each, (n,), -1 where none or several do."""
        if len(self) == 0:
            return np.empty(0, dtype=np.int64)
        single = np.diff(self.pred_start) == 1
        first = self.pred[np.minimum(self.pred_start[:-1], len(self.pred) - 1)]
        return np.where(single & (first >= 0), first, -1)

    @cached_property
    def run_mates(self) -> Ints:
        """The visit before in the same fly run, (n,), -1 where there is none."""
        before = self.before
        return np.where((before >= 0) & self.fly[before], before, -1)


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
    missed: Mapping[str, Ints], begin: str, caller: str
) -> list[Diagnostic]:
    """List the files with moves to targets that no way from the start leads to.

    Such a move stands in a routine that nobody calls, or behind a jump. From where it
    is reached cannot be known, so that it is not compensated; what calls the routine
    from elsewhere would run it uncompensated.

    Args:
        missed: Lines of such moves, ascending, by file.
        begin: Where ways begin, in the words of the language.
        caller: What may call the routine from elsewhere.
    """
    return [
        Diagnostic(
            name,
            int(lines[0]),
            Code.NEVER_REACHED,
            f"moves that are never reached from {begin}: {len(lines)} (lines "
            f"{line_ranges(lines)}). They are not compensated: give the {caller} that "
            "calls their routine, or remove them",
        )
        for name, lines in missed.items()
    ]
