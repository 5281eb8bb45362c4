"""From the records of the analysis to the arrays of `Visits`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, Protocol

import numpy as np

from postproc.arrays import Bools, Indices, Interned, Ints
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.disturbances import disturbance
from postproc.language.pdl2.job import FilePoints, World, base_variable
from postproc.language.pdl2.machine import HERE, Key, Machine, MoveRun, Visit
from postproc.language.pdl2.moves import UNSURE, from_value
from postproc.language.pdl2.program import Program
from postproc.language.pdl2.store import MANY, Settings
from postproc.language.pdl2.values import Nothing, Position, Value
from postproc.language.source import Source
from postproc.language.visits import (
    ELSEWHERE,
    FlyTrajectory,
    FlyType,
    Literals,
    Meaning,
    OrntType,
    Switch,
    Visits,
    slim,
)

# Frames and motion variables of visits as columns.

_FRAMES = ("tool", "base", "uframe")
_CARE = ("cnfg_care", "turn_care", "jnt_mturn")
_OVERRIDES = ("arm_spd_ovr", "prog_spd_ovr", "gen_ovr")
_WITHOUT_UFRAME = (Meaning.JOINTS, Meaning.HOME, Meaning.CALIBRATION, Meaning.BY)


class SettingColumns:
    """Each distinct state of the settings becomes one row, read off once."""

    def __init__(self, payload_kg: float) -> None:
        self._payload_kg = payload_kg
        self._kept: list[Settings] = []
        self._rows = Interned[int]()
        self._problems: list[tuple[str, str]] = []
        self._frames = Interned[tuple[tuple[float, ...], bool]]()
        self._table: dict[str, list[Any]] = {}

    def index(self, settings: Settings) -> int:
        """Return the row of a state of the settings."""
        row = self._rows[id(settings)]
        if row == len(self._kept):
            self._kept.append(settings)  # keeps its id from being used again
            for name, value in _row(settings, self._frame).items():
                self._table.setdefault(name, []).append(value)
            found = disturbance(settings, self._payload_kg)
            tool = ("tool", "tool_rmt")
            pose = found or _unknown(settings, ("uframe", "base", *tool))
            self._problems.append((pose, found or _unknown(settings, tool)))
        return row

    def kept(self, row: int) -> Settings:
        """Return the state of the settings of a row."""
        return self._kept[row]

    def problem(self, row: int, target: Meaning) -> str:
        """Return why a visit cannot be compensated under these settings, or ""."""
        pose, joints = self._problems[row]
        return joints if target in _WITHOUT_UFRAME else pose

    def _frame(self, value: object) -> int:
        if not isinstance(value, Position) or value.joints or not value.complete:
            return -1
        numbers = tuple(float(n) for n in value.numbers if n is not None)
        return self._frames[numbers, value.taught]

    def columns(self, rows: Ints) -> dict[str, Any]:
        """Return the columns of `Visits` that come from settings."""
        frames = list(self._frames)
        columns: dict[str, Any] = {
            name: slim(np.array(values)[rows]) for name, values in self._table.items()
        }
        if not columns:
            empty = _row({}, lambda value: -1)
            columns = {name: np.array([value])[:0] for name, value in empty.items()}
        columns["frames"] = np.array([f for f, _ in frames], float).reshape(-1, 6)
        columns["frame_taught"] = np.array([taught for _, taught in frames], bool)
        return columns


def _row(settings: Settings, frame: Any) -> dict[str, Any]:
    return {
        **{name: frame(settings.get(name)) for name in _FRAMES},
        "tool_remote": settings.get("tool_rmt") is True,
        "nearest_turn": settings.get("jnt_mturn") is False,
        "care": [_switch(settings.get(name)) for name in _CARE],
        "fly_dist_mm": _number(settings, "fly_dist"),
        "fly_per": _number(settings, "fly_per"),
        "fly_type": _word(settings, "fly_type", FlyType),
        "fly_traj": _word(settings, "fly_traj", FlyTrajectory),
        "lin_spd": _number(settings, "lin_spd"),
        "rot_spd": _number(settings, "rot_spd"),
        "override": _override(settings),
        "wrist_joint": settings.get("ornt_type") == "wrist_jnt",
        "ornt_type": _ornt_type(settings),
    }


def _number(settings: Settings, name: str) -> float:
    value = settings.get(name)
    return value if isinstance(value, float) else np.nan


def _word(settings: Settings, name: str, words: type[IntEnum]) -> int:
    """Return the number of a predefined word, 0 where it is not set or not known."""
    said = str(settings.get(name)).upper()
    return int(words[said]) if said in words.__members__ else 0


def _ornt_type(settings: Settings) -> OrntType:
    if "ornt_type" not in settings:
        return OrntType.UNSET
    return OrntType(_word(settings, "ornt_type", OrntType) or OrntType.UNKNOWN)


def _switch(value: Value | None) -> Switch:
    if value is None:
        return Switch.UNSET
    if isinstance(value, bool):
        return Switch.ON if value else Switch.OFF
    return Switch.UNKNOWN


def _override(settings: Settings) -> float:
    product = 1.0
    for name in _OVERRIDES:
        value = _number(settings, name)
        if value > 0:
            product *= min(value, 100.0) / 100.0
    return product


def _unknown(settings: Settings, names: tuple[str, ...]) -> str:
    """Say which of some settings are not known, and why, "" where all are."""
    alike: dict[str, list[str]] = {}
    for name in names:
        if why := _why_not_known(settings, name):
            alike.setdefault(why, []).append(f"${name.upper()}")
    return "; ".join(
        f"{', '.join(some)} {'is' if len(some) == 1 else 'are'} not known here: {why}"
        for why, some in alike.items()
    )


def _why_not_known(settings: Settings, name: str) -> str:
    """Say why a setting is not known, "" where it is."""
    value = settings.get(name)
    if isinstance(value, Nothing):
        return value.why
    if name not in _FRAMES or (
        isinstance(value, Position) and value.complete and not value.joints
    ):
        return ""
    partly = isinstance(value, Position) and not value.joints
    return "a part of it is not known" if partly else "it is no known position"


# Columns of visits, filled record by record.

_COMPUTED = (Meaning.POSE, Meaning.NEAR, Meaning.FOR)  # may move along with a literal


class VisitColumns:
    """Columns of n visits, filled visit by visit or stretch by stretch."""

    def __init__(self, n: int, axes: int, slots: int) -> None:
        """Make room.

        Args:
            n: Visits.
            axes: The last auxiliary axis.
            slots: Numbers in all files: theirs are the longest columns.
        """
        short = np.int32 if slots < 2**31 else np.int64
        self.file = np.zeros(n, dtype=np.int64)
        self.line = np.zeros(n, dtype=np.int64)
        self.motion = np.zeros(n, dtype=np.int64)
        self.target = np.zeros(n, dtype=np.int64)
        self.via = np.zeros(n, dtype=bool)
        self.fly = np.zeros(n, dtype=bool)
        self.values = np.full((n, 6), np.nan)
        self.distance_mm = np.full(n, np.nan)
        self.aux = np.full((n, axes), np.nan)
        self.config = np.zeros(n, dtype=np.int64)
        self.config_given = np.zeros(n, dtype=bool)
        self.name = np.zeros(n, dtype=np.int64)
        self.reason = np.zeros(n, dtype=np.int64)
        self.setting = np.zeros(n, dtype=np.int64)
        self.slots = np.full((n, 6), -1, dtype=short)
        self.bases: dict[int, tuple[int, ...]] = {}
        self.taught = np.zeros(n, dtype=bool)
        self.shared = np.zeros(n, dtype=bool)
        self.measure_id = [""] * n


@dataclass
class Collector:
    """Fills the columns; holds the tables that they index."""

    machine: Machine
    columns: VisitColumns
    settings: SettingColumns
    configs: Interned[str] = field(default_factory=lambda: Interned([""]))
    names: Interned[str] = field(default_factory=lambda: Interned([""]))
    reasons: Interned[str] = field(default_factory=lambda: Interned([""]))
    marks: dict[int, tuple[Ints, list[str]]] = field(default_factory=dict)

    def arrival(self, at: int, arrival: Visit) -> None:
        """Fill one visit."""
        c, program = self.columns, arrival.place.program
        c.file[at] = self.machine.world.files.index(program.lines.source.name)
        c.line[at] = program.lines.line[arrival.row]
        c.motion[at], c.target[at] = arrival.motion, arrival.target
        c.via[at], c.fly[at] = arrival.via, arrival.fly
        c.values[at] = [np.nan if v is None else v for v in arrival.numbers]
        if arrival.distance is not None:
            c.distance_mm[at] = arrival.distance
        c.setting[at] = self.settings.index(arrival.settings)
        if not arrival.via:
            c.measure_id[at] = self._mark(program, arrival.row)
        self._position(at, arrival)
        c.reason[at] = self.reasons[
            arrival.reason
            or self.recursion(arrival)
            or self.settings.problem(c.setting[at], arrival.target)
            or (arrival.position and self.aux_problem(_aux_axes(arrival.position)))
            or ""
        ]

    def _position(self, at: int, arrival: Visit) -> None:
        c, position = self.columns, arrival.position
        if position is None:
            return
        world = self.machine.world
        c.name[at] = self.names[position.name]
        c.config[at] = self.configs[position.config or ""]
        c.config_given[at] = position.config is not None
        for axis, value in position.aux or ():
            if 1 <= axis <= c.aux.shape[1] and value is not None:
                c.aux[at, axis - 1] = value
        if position.editable and arrival.target in (Meaning.POSE, Meaning.JOINTS):
            c.slots[at] = position.slots
        elif -1 not in position.slots and arrival.target in _COMPUTED:
            c.bases[at] = position.slots
        else:
            world.pin(position, "a target is computed from a part of it")
        lines = world.taught_lines[arrival.place.program.lines.source.name]
        inline = not position.name and int(c.line[at]) in lines
        listed = self.is_listed(position.name)
        c.taught[at] = position.taught or inline or listed
        c.shared[at] = position.shared

    def recursion(self, record: Visit | MoveRun) -> str:
        """Return why visits of a routine that calls itself stay, "" for others."""
        if id(record.place.body) not in self.machine.recursive:
            return ""
        return "it stands in a routine that calls itself, which is not followed"

    def aux_problem(self, axes: tuple[int, ...] | None) -> str:
        """Return why a target with some auxiliary axes stays, None: not known which."""
        kinds = self.machine.world.start.aux
        if axes is None:
            if kinds and all(kind == "gun" for kind in kinds.values()):
                return ""
            return "its auxiliary axes are not known before the program runs"
        for axis in axes:
            kind = kinds.get(axis)
            if kind is None:
                return (
                    f"auxiliary axis {axis} is not declared: say under [aux] in the "
                    "cell file whether it is a gun, a track or a positioner"
                )
            if kind != "gun":
                return f"auxiliary axis {axis} is a {kind}: it moves arm or part"
        return ""

    def is_listed(self, name: str) -> bool:
        """Tell whether the cell file says that a point was taught."""
        taught = self.machine.world.start.taught
        name = name.lower()
        return name in taught or base_variable(name) in taught

    def _mark(self, program: Program, row: int) -> str:
        rows, ids = self.measured(program)
        k = int(np.searchsorted(rows, row)) if len(rows) else 0
        return ids[k] if k < len(rows) and rows[k] == row else ""

    def measured(self, program: Program) -> tuple[Ints, list[str]]:
        """Return the rows of moves with a ``-- MEASURE`` comment, and its ids."""
        known = self.marks.get(id(program))
        if known is None:
            known = self.marks[id(program)] = _measured(program)
        return known


def _aux_axes(position: Position) -> tuple[int, ...] | None:
    return None if position.aux is None else tuple(axis for axis, _ in position.aux)


def _measured(program: Program) -> tuple[Ints, list[str]]:
    lines = program.lines
    moves = program.statements.which(lambda said: isinstance(said, ast.Move))
    rows = np.flatnonzero(moves[lines.shape])
    found: dict[int, str] = {}
    for line, mark in lines.marks("MEASURE"):
        at = int(np.searchsorted(lines.line[rows], line))
        if at < len(rows):
            found.setdefault(int(rows[at]), mark)
    return np.array([*found], dtype=np.int64), [*found.values()]


# Columns of the visits of a stretch of moves: a few array passes for each variant.

KINDS = max(Meaning) + 1  # what a target can be is less


def fill_run(collector: Collector, at: int, run: MoveRun) -> None:
    """Fill the visits of a stretch, the first of which is visit `at`."""
    c, lines = collector.columns, run.place.program.lines
    here = slice(at, at + len(run))
    c.file[here] = collector.machine.world.files.index(lines.source.name)
    c.line[here] = lines.line[run.rows]
    for variant, (motion, _) in run.ways.items():
        mine = np.flatnonzero(run.variant == variant)
        move = run.moves[variant]
        c.motion[at + mine], c.fly[at + mine] = motion, move.fly
        c.setting[at + mine] = _settings(collector, run, move, run.rows[mine])
        if not isinstance(move.where[0], ast.Reference):
            _written(collector, at + mine, run, variant, run.rows[mine])
    points = collector.machine.world.initial.points
    if points is not None and (run.point >= 0).any():
        _points(collector, at, run, points)
    for k, value in run.held.items():
        collector.arrival(at + k, _held(collector, at + k, run, k, value))
    _marks(collector, at, run)


def _settings(
    collector: Collector, run: MoveRun, move: ast.Move, rows: Ints
) -> Ints | int:
    """Return the settings at moves of one variant; WITH may set numbers for them."""
    if not move.settings:
        return collector.settings.index(run.settings)
    lines = run.place.program.lines
    names = [reference.name.lstrip("$") for reference, _ in move.settings]
    slots = [v.slot for _, v in move.settings if isinstance(v, ast.Number)]
    numbers = lines.value[lines.first[rows][:, None] + np.array(slots)]
    distinct, which = np.unique(numbers, axis=0, return_inverse=True)
    index = [
        collector.settings.index({**run.settings, **_set(names, row)})
        for row in distinct.tolist()
    ]
    return np.array(index, dtype=np.int64)[which.ravel()]


def _set(names: list[str], numbers: list[float]) -> dict[str, Value]:
    """Return the settings that WITH changes to some numbers."""
    unread = Nothing("the number cannot be read")
    pairs = zip(names, numbers, strict=True)
    return {name: unread if n != n else n for name, n in pairs}


def _written(
    collector: Collector, mine: Ints, run: MoveRun, variant: int, rows: Ints
) -> None:
    """Fill moves of one variant to six numbers that stand in them."""
    c, world = collector.columns, collector.machine.world
    lines = run.place.program.lines
    literal = run.moves[variant].where[0]
    items = literal_items(literal)
    slots = np.array([i.slot for i in items[:6] if isinstance(i, ast.Number)])
    numbers = lines.first[rows][:, None] + slots[None, :]
    c.values[mine] = lines.value[numbers]
    c.slots[mine] = numbers + world.slot_base[lines.source.name]
    joints = isinstance(literal, ast.Aggregate)
    c.target[mine] = Meaning.JOINTS if joints else Meaning.POSE
    config = items[6] if len(items) > 6 else None
    if isinstance(config, ast.Text):
        c.config[mine] = collector.configs[config.value]
        c.config_given[mine] = True
    _reasons(collector, mine, run, variant, "")
    wrong = mine[~np.isfinite(c.values[mine]).all(axis=1)]
    if len(wrong):
        c.target[wrong] = Meaning.UNKNOWN
        c.slots[wrong] = -1
        c.values[wrong] = np.nan
        c.reason[wrong] = collector.reasons["a number of the target cannot be read"]
    taught = world.taught_lines[lines.source.name]
    if taught:
        c.taught[mine] = np.isin(c.line[mine], np.array(sorted(taught)))


def _reasons(
    collector: Collector, mine: Ints, run: MoveRun, variant: int, otherwise: str
) -> None:
    """Say why moves of one variant must not be compensated."""
    c = collector.columns
    known = run.reason or run.ways[variant][1] or collector.recursion(run)
    pairs = c.setting[mine] * KINDS + c.target[mine]  # many rows, few pairs
    distinct, which = np.unique(pairs, return_inverse=True)
    reason = [
        collector.reasons[
            known or collector.settings.problem(setting, Meaning(target)) or otherwise
        ]
        for setting, target in (divmod(pair, KINDS) for pair in distinct.tolist())
    ]
    c.reason[mine] = np.array(reason, dtype=np.int64)[which]


def _points(collector: Collector, at: int, run: MoveRun, points: FilePoints) -> None:
    """Fill moves to points that the variable file tells, layout by layout."""
    c, entries = collector.columns, points.entries
    some = np.flatnonzero(run.point >= 0)
    rows, visits = run.point[some], at + some
    c.values[visits] = entries.numbers[rows]
    c.slots[visits] = entries.slots[rows] + points.base
    c.taught[visits], c.shared[visits] = points.taught[rows], points.shared[rows]
    names = [entries.name[row] for row in rows.tolist()]
    c.name[visits] = collector.names.of(names)
    if collector.machine.world.start.taught:
        c.taught[visits] |= [collector.is_listed(name) for name in names]
    found, first = np.unique(entries.layout[rows], return_index=True)
    for number in found[np.argsort(first)].tolist():
        layout = entries.layouts[number]
        mine = np.flatnonzero(entries.layout[rows] == number)
        c.config[visits[mine]] = collector.configs[layout.config or ""]
        c.config_given[visits[mine]] = layout.config is not None
        joints = layout.kind == "JNTP"
        c.target[visits[mine]] = Meaning.JOINTS if joints else Meaning.POSE
        for column, axis in enumerate(layout.axes):
            if 1 <= axis <= c.aux.shape[1]:
                c.aux[visits[mine], axis - 1] = entries.aux[rows[mine], column]
        otherwise = collector.aux_problem(layout.axes)
        variants = run.variant[some[mine]]
        for variant in np.unique(variants).tolist():
            own = visits[mine[variants == variant]]
            _reasons(collector, own, run, variant, otherwise)


def _held(
    collector: Collector, visit: int, run: MoveRun, k: int, value: Value
) -> Visit:
    """Return a move to a variable that holds something else than the file says."""
    variant = int(run.variant[k])
    if isinstance(value, Nothing):
        collector.machine.world.pin(value, UNSURE)
    goal, (motion, reason) = from_value(value), run.ways[variant]
    return Visit(
        run.place,
        int(run.rows[k]),
        run.predecessors,
        collector.settings.kept(int(collector.columns.setting[visit])),
        motion,
        goal.target,
        goal.numbers,
        goal.position,
        fly=run.moves[variant].fly,
        reason=goal.reason or run.reason or reason,
    )


def _marks(collector: Collector, at: int, run: MoveRun) -> None:
    """Enter the ids of moves that are measured."""
    rows, ids = collector.measured(run.place.program)
    first, last = np.searchsorted(rows, [run.rows[0], run.rows[-1] + 1]).tolist()
    for row, mark in zip(rows[first:last].tolist(), ids[first:last], strict=True):
        k = int(np.searchsorted(run.rows, row))
        if run.rows[k] == row:
            collector.columns.measure_id[at + k] = mark


def literal_items(
    literal: ast.Expression,
) -> tuple[ast.Expression | None, ...]:
    """Return what stands between the brackets of ``{..}`` or ``POS(..)``."""
    if isinstance(literal, ast.Aggregate):
        return literal.items
    return literal.arguments if isinstance(literal, ast.Invoke) else ()


# Which numbers of which file belong to which target.


class SlotColumns(Protocol):
    """What is needed of the visits' columns."""

    slots: Indices
    target: Indices
    name: Indices
    taught: Bools
    shared: Bools


@dataclass(frozen=True)
class Numbering:
    """All numbers of all files of a job.

    Attributes:
        sources: The files.
        first: Index of each file's first number, (f,).
        start, end: Byte offsets in its file, (m,).
    """

    sources: tuple[Source, ...]
    first: Indices
    start: Indices
    end: Indices

    @staticmethod
    def of(world: World) -> Numbering:
        """Number the files of a job as its slots are."""
        numbered = [
            (p.lines.source, p.lines.start, p.lines.end) for p in world.programs()
        ]
        if world.variables is not None:
            v = world.variables
            numbered.append((v.source, v.start, v.end))
        first = [world.slot_base[source.name] for source, _, _ in numbered]
        return Numbering(
            tuple(source for source, _, _ in numbered),
            np.array(first, dtype=np.int64),
            _together([start for _, start, _ in numbered]),
            _together([end for _, _, end in numbered]),
        )

    def apart(self, slots: Indices) -> Bools:
        """Tell which targets have their numbers in more than one file, (k,).

        Args:
            slots: Six numbers of each target, (k, 6).
        """
        if len(self.first) == 1:
            return np.zeros(len(slots), dtype=bool)
        file = np.searchsorted(self.first, slots, side="right")
        different: Bools = (file != file[:, :1]).any(axis=1)
        return different


def _together(columns: list[Indices]) -> Indices:
    """Put the columns of files one after the other; one by itself is not copied."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def find_literals(
    columns: SlotColumns, numbering: Numbering, names: Iterable[str]
) -> tuple[Literals, Indices]:
    """Find the distinct literals; also return the literal of every visit.

    Visits whose numbers partly belong to another target, or to another file, get none
    (-1).
    """
    literal = np.full(len(columns.slots), -1, dtype=np.int64)
    rows = np.flatnonzero(columns.slots[:, 0] >= 0)
    slots = columns.slots[rows]
    _, example, inverse = np.unique(slots[:, 0], return_index=True, return_inverse=True)
    distinct = slots[example]
    mixed = np.zeros(len(distinct), dtype=bool)
    mixed[inverse[(slots != distinct[inverse]).any(axis=1)]] = True
    used = np.bincount(distinct.ravel(), minlength=len(numbering.start))
    mixed |= (used[distinct] > 1).any(axis=1) | numbering.apart(distinct)
    kept = np.flatnonzero(~mixed)
    index = np.full(len(distinct), -1, dtype=np.int64)
    index[kept] = np.arange(len(kept))
    literal[rows] = index[inverse]
    first = rows[example[kept]]
    return _literals(columns, numbering, names, distinct[kept], first, literal), literal


def _literals(
    columns: SlotColumns,
    numbering: Numbering,
    names: Iterable[str],
    slots: Indices,
    visit: Indices,
    literal: Indices,
) -> Literals:
    file = np.searchsorted(numbering.first, slots[:, 0], side="right") - 1
    start, end = numbering.start[slots], numbering.end[slots]
    line = np.zeros(len(slots), dtype=np.int64)
    for i, source in enumerate(numbering.sources):
        mine = file == i
        places = start[mine].min(axis=1) if mine.any() else start[mine][:, 0]
        line[mine] = np.searchsorted(source.line_starts, places, side="right")
    texts = tuple(names)
    return Literals(
        file=file.astype(np.int64),
        line=line,
        start=start,
        end=end,
        joints=columns.target[visit] == Meaning.JOINTS,
        name=tuple(map(texts.__getitem__, columns.name[visit].tolist())),
        shared=_any(columns.shared, literal, len(slots)),
        taught=_any(columns.taught, literal, len(slots)),
        pinned=("",) * len(slots),
    )


def _any(flags: Bools, literal: Indices, m: int) -> Bools:
    """Tell for each literal whether any of its visits is flagged."""
    found = np.zeros(m, dtype=bool)
    found[literal[flags & (literal >= 0)]] = True
    return found


# What else depends on the numbers of a target than the moves that go to it.

_IN_PART = "a target is computed from a part of it"


def find_uses(
    literals: Literals,
    slots: Ints,
    bases: Mapping[int, tuple[int, ...]],
    literal: Ints,
    pinned: Mapping[int, str],
) -> tuple[Literals, Ints]:
    """Find which literals computed targets move along with, and which must stay.

    Args:
        literals: m literals.
        slots: Numbers of every visit's literal, (n, 6), -1 where it has none.
        bases: The six numbers that computed targets are made of, by visit.
        literal: Literal of every visit, (n,), -1 where it has none.
        pinned: Numbers that must stay, and why.

    Returns:
        The literals with what pins them, and for every visit the literal that it moves
        along with, (n,), -1 where there is none.
    """
    direct = np.flatnonzero(literal >= 0)
    numbers = np.full((len(literals), 6), -1, dtype=slots.dtype)
    numbers[literal[direct]] = slots[direct]
    most = max([-1, *pinned, *map(max, bases.values()), numbers.max(initial=-1)])
    owner = np.full(int(most) + 2, -1, dtype=slots.dtype)  # the last is that of slot -1
    owner[numbers] = np.arange(len(literals))[:, None]
    owner[-1] = -1
    stay = {int(owner[slot]): why for slot, why in pinned.items() if owner[slot] >= 0}
    follows = np.full(len(literal), -1, dtype=np.int64)
    for visit, base in bases.items():
        rows = owner[[*base]]
        if rows[0] >= 0 and (numbers[rows[0]] == base).all():
            follows[visit] = rows[0]
        else:
            stay |= {row: _IN_PART for row in rows.tolist() if 0 <= row not in stay}
    if not stay:
        return literals, follows
    why = tuple(stay.get(row, "") for row in range(len(literals)))
    return replace(literals, pinned=why), follows


# All of it: visits in program order.

MOST_AXES = 12  # auxiliary axes that are told


def collect(machine: Machine) -> Visits:
    """Put the visits in program order and make arrays of them."""
    ordered = sorted(machine.arrivals.items(), key=lambda item: _order(item[0]))
    counts = [len(record) for _, record in ordered]
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    axes = max((_most_axes(record, machine.world) for _, record in ordered), default=0)
    settings = SettingColumns(machine.world.start.payload_kg)
    numbering = Numbering.of(machine.world)
    columns = VisitColumns(int(offsets[-1]), axes, len(numbering.start))
    collector = Collector(machine, columns, settings)
    for at, (_, record) in zip(offsets.tolist(), ordered, strict=False):
        if isinstance(record, MoveRun):
            fill_run(collector, at, record)
        else:
            collector.arrival(at, record)
    c, world = collector.columns, machine.world
    if machine.exhausted:
        c.reason[:] = collector.reasons["the program is too complex to be followed"]
    literals, literal = find_literals(c, numbering, collector.names)
    literals, follows = find_uses(literals, c.slots, c.bases, literal, world.pinned)
    overlapping = (literal < 0) & (c.slots[:, 0] >= 0) & (c.reason == 0)
    if overlapping.any():
        apart = overlapping & numbering.apart(c.slots)
        why = "a number of the target belongs to another target too"
        c.reason[overlapping] = collector.reasons[why]
        if apart.any():
            why = (
                "some of its numbers stand in the program, others in another file: "
                "write them in one"
            )
            c.reason[apart] = collector.reasons[why]
    pred_start, pred = _predecessors(machine, ordered, offsets)
    return Visits(
        files=tuple(world.files),
        file=slim(c.file),
        line=slim(c.line),
        motion=slim(c.motion),
        target=slim(c.target),
        via=slim(c.via),
        values=c.values,
        distance_mm=slim(c.distance_mm),
        aux=slim(c.aux),
        config=slim(c.config),
        configs=tuple(collector.configs),
        config_given=slim(c.config_given),
        literal=literal,
        follows=slim(follows),
        name=slim(c.name),
        names=tuple(collector.names),
        fly=slim(c.fly),
        reason=slim(c.reason),
        reasons=tuple(collector.reasons),
        pred_start=pred_start,
        pred=pred,
        measure_id=tuple(c.measure_id),
        literals=literals,
        **settings.columns(c.setting),
    )


def _order(key: Key) -> tuple[tuple[tuple[int, int], ...], int]:
    context, at, sub = key
    return (*context, (at, HERE)), sub


def _most_axes(record: Visit | MoveRun, world: World) -> int:
    """Return the last auxiliary axis that targets give a value of."""
    if isinstance(record, Visit):
        return _last_axis([record.position])
    held = [value for value in record.held.values() if isinstance(value, Position)]
    points, rows = world.initial.points, record.point[record.point >= 0]
    if points is None:
        return _last_axis(held)
    used: list[int] = np.unique(points.entries.layout[rows]).tolist()
    axes = [axis for k in used for axis in points.entries.layouts[k].axes]
    return max([_last_axis(held), *(min(axis, MOST_AXES) for axis in axes)])


def _last_axis(positions: Iterable[Position | None]) -> int:
    found = [axis for p in positions if p is not None for axis, _ in p.aux or ()]
    return max([0, *(min(axis, MOST_AXES) for axis in found)])


def _predecessors(
    machine: Machine, ordered: list[tuple[Key, Visit | MoveRun]], offsets: Ints
) -> tuple[Ints, Ints]:
    """Translate predecessor ids to visits, in CSR form."""
    n = int(offsets[-1])
    visit = np.zeros(machine.next_id, dtype=np.int64)
    for at, (key, record) in zip(offsets.tolist(), ordered, strict=False):
        base = machine.ids[key]
        visit[base : base + len(record)] = np.arange(at, at + len(record))
    counts = np.ones(n, dtype=np.int64)
    sets: list[tuple[int, list[int]]] = []
    for at, (_, record) in zip(offsets.tolist(), ordered, strict=False):
        found = {int(visit[p]) if p >= 0 else p for p in record.predecessors - {MANY}}
        if MANY in record.predecessors:
            found.add(ELSEWHERE)
        if id(record.place.body) in machine.recursive:
            found.add(ELSEWHERE)
        origins = sorted(found)
        counts[at] = len(origins)
        sets.append((at, origins))
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    pred = np.repeat(np.arange(n) - 1, counts)
    for at, origins in sets:
        pred[start[at] : start[at] + len(origins)] = origins
    return start, pred
