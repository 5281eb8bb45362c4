"""From the arrivals of a RAPID task to `Visits`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from postproc.arrays import Interned, Ints
from postproc.language.marks import MEASURE
from postproc.language.rapid.dialect import COMMENTS, RAPID_DIALECT, WIDTH
from postproc.language.rapid.interpreter import RapidMachine
from postproc.language.rapid.modes import NO_SHIFT, UNKNOWN_SHIFT
from postproc.language.rapid.moves import (
    FrameOfMove,
    RapidVisit,
    composed,
    flat,
    pose_of_numbers,
)
from postproc.language.rapid.program import RapidFile
from postproc.language.rapid.task import RapidTask, WrittenNumber
from postproc.language.visits import (
    Blend,
    Literals,
    Meaning,
    Visits,
    ZoneRule,
    slim,
)
from postproc.robot.pose import pose_from_record
from postproc.robot.trajectory import Motion

TOO_COMPLEX = "the program is too complex to be followed"
_ONLY_SHIFTED = "it is shifted from a point that no move goes to: what to correct?"
_SHIFT = "the program displacement (PDispOn, PDispSet) is not known here"
_NO_FRAME = -1


@dataclass
class _Tables:
    """What columns point into."""

    frames: Interned[tuple[tuple[float, ...], bool]]
    reasons: Interned[str]
    names: Interned[str]

    def frame(self, pose: tuple[float, ...], taught: bool = False) -> int:
        return self.frames[pose, taught] if pose else _NO_FRAME


def visits_of(machine: RapidMachine) -> Visits:
    """Put the arrivals into the order of the program, as columns."""
    order = sorted(range(len(machine.visits)), key=machine.order.__getitem__)
    found = [machine.visits[k] for k in order]
    files = machine.task.files
    tables = _Tables(Interned(), Interned([""]), Interned([""]))
    literals, literal, follows = _literals(found, machine.task)
    reasons = [_reason(v, machine.exhausted) for v in found]
    for k in np.flatnonzero(follows == _NO_LITERAL).tolist():
        reasons[k] = reasons[k] or _ONLY_SHIFTED
    follows[follows == _NO_LITERAL] = -1
    pred_start, pred = _predecessors(machine, order)
    base = tables.frame(flat(pose_from_record(np.array(machine.start.base, float)))
                        if machine.start.base else ())  # fmt: skip
    n = len(found)
    return Visits(
        files=tuple(file.text.source.name for file in files),
        file=slim(np.array([v.scope.file for v in found], np.int64)),
        line=np.array([files[v.scope.file].text.line(v.row) for v in found], np.int64),
        values=np.array([v.goal.values for v in found], float).reshape(n, WIDTH),
        aux=_aux(found),
        literal=literal,
        follows=slim(follows),
        name=slim(np.array(tables.names.of([v.goal.name for v in found]), np.int64)),
        base=slim(np.full(n, base)),
        reason=slim(np.array(tables.reasons.of(reasons), np.int64)),
        **_moves(found),
        **_settings(found),
        **_frames(found, tables),
        names=tuple(tables.names),
        reasons=tuple(tables.reasons),
        frames=np.array([f for f, _ in tables.frames], float).reshape(-1, 4, 4),
        frame_taught=np.array([taught for _, taught in tables.frames], bool),
        pred_start=pred_start,
        pred=pred,
        measure_id=tuple(_measured(found, files)),
        literals=literals,
        dialect=RAPID_DIALECT,
    )


def _measured(found: Sequence[RapidVisit], files: Sequence[RapidFile]) -> list[str]:
    """Return the id that a comment gives to every visit, "" where none does."""
    ids: dict[tuple[int, int], str] = {}
    for k, file in enumerate(files):
        rows = np.array([move.row for move in file.moves], np.int64)
        last = np.array([file.text.source.line_of(file.text.span(row).end)
                         for row in rows.tolist()], np.int64)  # fmt: skip
        for line, mark in COMMENTS.marks(file.text.source, MEASURE):
            at = int(np.searchsorted(last, line))
            if at < len(rows):
                ids.setdefault((k, int(rows[at])), mark)
    return ["" if v.via else ids.get((v.scope.file, v.row), "") for v in found]


def _moves(found: Sequence[RapidVisit]) -> dict[str, Any]:
    """Columns of how the arm moves."""
    n = len(found)
    zone = np.array([v.zone_mm for v in found], float)
    via = np.array([v.via for v in found], bool)
    fly = (zone >= 0.0) | via  # nothing stops at the point of an arc
    pose = np.array([v.goal.target == Meaning.POSE for v in found], bool)
    return {
        "motion": slim(np.array([v.motion for v in found], np.int64)),
        "target": slim(np.array([v.goal.target for v in found], np.int64)),
        "via": slim(via),
        "distance_mm": slim(np.full(n, np.nan)),
        "config": slim(np.zeros(n, dtype=np.int64)),
        "configs": ("",),
        "config_given": slim(pose),
        "fly": slim(fly),
        "zone_mm": slim(np.where(zone >= 0.0, zone, np.nan)),
        "overlap_percent": slim(np.full(n, 100.0)),
        "blend": slim(np.where(fly, Blend.ZONE, Blend.UNSET)),
        "zone_rule": slim(np.where(fly, ZoneRule.FROM, ZoneRule.UNSET)),
        "lin_spd": slim(np.array([v.speed for v in found], float)),
        "rot_spd": slim(np.full(n, np.nan)),
    }


def _settings(found: Sequence[RapidVisit]) -> dict[str, Any]:
    """Columns of what holds at moves."""
    joint = [v.motion == Motion.JOINT for v in found]
    check = [
        v.modes.confj if v.motion == Motion.JOINT else v.modes.confl for v in found
    ]
    law = [
        v.modes.arc_law if v.motion == Motion.CIRCULAR else v.modes.law for v in found
    ]
    share = np.array([v.modes.override for v in found], float)
    wrist = np.array([bool(v.modes.wrist) for v in found], bool)
    care = np.repeat(np.array(check, np.int64)[:, None], 3, axis=1)
    return {
        "nearest_turn": slim(np.zeros(len(found), dtype=bool)),
        "care": care.reshape(-1, 3),
        "override": slim(np.where(share > 0.0, share, 1.0)),
        "wrist_joint": slim(wrist & ~np.array(joint, bool)),
        "orientation_law": slim(np.array(law, np.int64)),
    }


def _frames(found: Sequence[RapidVisit], tables: _Tables) -> dict[str, Any]:
    """Columns of tools and work objects."""
    remote = [not v.tool.held or v.wobj.held for v in found]
    placed: dict[tuple[FrameOfMove, tuple[float, ...]], tuple[float, ...]] = {}
    uframe = []
    for v in found:
        key = v.wobj, v.modes.shift
        if key not in placed:
            placed[key] = _displaced(*key)
        uframe.append(tables.frame(placed[key], v.wobj.taught))
    tool = [tables.frame(v.tool.pose, v.tool.taught) for v in found]
    return {
        "tool": slim(np.array(tool, np.int64)),
        "uframe": slim(np.array(uframe, np.int64)),
        "tool_remote": slim(np.array(remote, bool)),
    }


def _displaced(wobj: FrameOfMove, shift: tuple[float, ...]) -> tuple[float, ...]:
    """Place a work object with the program displacement in it."""
    if shift == UNKNOWN_SHIFT or not wobj.pose:
        return ()
    if shift == NO_SHIFT:
        return wobj.pose
    return composed(wobj.pose, pose_of_numbers(shift))


def _reason(v: RapidVisit, exhausted: bool) -> str:
    """Say why a visit cannot be compensated, "" where it can."""
    if exhausted:
        return TOO_COMPLEX
    given = (*sorted(v.modes.blocked), v.why, v.goal.why, v.tool.why)
    placed = v.goal.target != Meaning.JOINTS
    if placed:
        given += (v.wobj.why,)
        if v.modes.shift == UNKNOWN_SHIFT:
            given += (_SHIFT,)
    return next((why for why in given if why), "")


def _aux(found: Sequence[RapidVisit]) -> np.ndarray:
    """External axes that have a value, (n, k): up to the last that is used."""
    aux = np.array([v.goal.aux for v in found], float).reshape(len(found), 6)
    used = np.flatnonzero(~np.isnan(aux).all(axis=0))
    return aux[:, : int(used.max(initial=-1)) + 1]


# Where the numbers stand.

_NO_LITERAL = -2  # follows numbers that are no literal


def _literals(
    found: Sequence[RapidVisit], task: RapidTask
) -> tuple[Literals, Ints, Ints]:
    """Find the distinct literals; also those of visits, and those they follow."""
    index: dict[tuple[int, int], int] = {}
    rows: list[RapidVisit] = []
    literal = np.full(len(found), -1, dtype=np.int64)
    for k, v in enumerate(found):
        key = v.goal.file, v.goal.slots[0]
        if key[1] >= 0:
            if key not in index:
                index[key] = len(rows)
                rows.append(v)
            literal[k] = index[key]
    follows = np.full(len(found), -1, dtype=np.int64)
    pinned = [""] * len(rows)
    for k, v in enumerate(found):
        key = v.goal.file, max(v.goal.slots[0], v.goal.follows[0])
        at = index.get(key, -1)
        if v.goal.slots[0] < 0 <= v.goal.follows[0]:
            known = v.goal.target == Meaning.POSE
            follows[k] = (at if at >= 0 else _NO_LITERAL) if known else -1
        if at >= 0:
            pinned[at] = pinned[at] or v.goal.pins
    return _places(rows, task, pinned), literal, follows


def _places(
    rows: Sequence[RapidVisit], task: RapidTask, pinned: Sequence[str]
) -> Literals:
    """Say where the numbers of literals stand."""
    m = len(rows)
    file = np.array([v.goal.file for v in rows], np.int64)
    slots = np.array([v.goal.slots for v in rows], np.int64).reshape(m, WIDTH)
    start, end = np.full((m, WIDTH), -1), np.full((m, WIDTH), -1)
    line = np.zeros(m, dtype=np.int64)
    for number, one in enumerate(task.files):
        mine = np.flatnonzero(file == number)
        own, written = slots[mine], slots[mine] >= 0
        start[mine] = np.where(written, np.append(one.text.start, -1)[own], -1)
        end[mine] = np.where(written, np.append(one.text.stop, -1)[own], -1)
        starts = one.text.source.line_starts
        line[mine] = np.searchsorted(starts, start[mine, 0], side="right")
    first = [WrittenNumber(0.0, v.goal.file, v.goal.slots[0]) for v in rows]
    taught = [task.is_taught(v.goal.name, one)
              for v, one in zip(rows, first, strict=True)]  # fmt: skip
    return Literals(
        file=file,
        line=line,
        start=start,
        end=end,
        joints=np.array([v.goal.target == Meaning.JOINTS for v in rows], bool),
        name=tuple(v.goal.name for v in rows),
        shared=np.zeros(m, dtype=bool),
        taught=np.array(taught, bool),
        pinned=tuple(pinned),
    )


def _predecessors(machine: RapidMachine, order: Sequence[int]) -> tuple[Ints, Ints]:
    """Translate origins to visits in program order, in CSR form."""
    place = {number: k for k, number in enumerate(order)}
    found = [
        sorted(place[p] if p >= 0 else p for p in machine.visits[k].origins)
        for k in order
    ]
    start = np.concatenate([[0], np.cumsum([len(f) for f in found])]).astype(np.int64)
    return start, np.array([p for f in found for p in f], dtype=np.int64)
