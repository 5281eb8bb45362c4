"""One arrival over a Cartesian path: a line, or a part of an arc."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Floats
from postproc.motion.arrival import NO_PATH, Arrival
from postproc.motion.branches import LOST, follow
from postproc.motion.path import Segments, arcs, lines
from postproc.motion.reasons import (
    ARC_END,
    CODE,
    NO_CIRCLE,
    OTHER_BRANCH,
    OUT_OF_REACH,
    PATH_JUMP,
    PATH_REACH,
)
from postproc.motion.targets import Kind
from postproc.motion.ways import Solved, Ways
from postproc.motion.workspace import Workspace


def along_line(
    work: Workspace, v: int, edge: int, flange: Floats, end: Arrival
) -> Arrival:
    """Follow a Cartesian path; where that fails, keep the end and say why."""
    joints = work.targets.kind[v] == Kind.JOINTS
    if work.samples.ready[edge]:
        span = work.span(edge)
        ways = work.ways(slice(span.start, span.stop - joints))
    else:
        tool = work.targets.tool[v]
        line = lines(
            (work.flange[work.source[edge]] @ tool)[None], (flange @ tool)[None]
        )
        ways = _ways(work, v, edge, line, not joints)
    return _followed(work, v, edge, flange, end, ways)


def along_late_arc(
    work: Workspace, v: int, edge: int, flange: Floats, end: Arrival
) -> Arrival:
    """Follow a part of an arc whose points were not all known beforehand."""
    t, begins = work.targets, int(work.samples.begins[edge])
    unknown = Arrival(end.q, flange, end.slot, NO_PATH, end.reason)
    if begins < 0 or t.wrist_joint[v] or work.source[begins] < 0:
        return unknown
    via, start = v if t.via[v] else v - 1, work.source[begins]
    places = np.array(work.flange[[start, via, via + 1]])
    places[1 + v - via] = flange
    if np.isnan(places[0]).any():
        return unknown
    if np.isnan(places).any():
        return replace(unknown, reason=end.reason or CODE[ARC_END])
    parts = arcs(*(places @ t.tool[v])[:, None])
    part = parts[0 if t.via[v] else 1]
    if not part.valid[0]:
        return replace(unknown, reason=CODE[NO_CIRCLE])
    ways = _ways(work, v, edge, part, t.kind[v] != Kind.JOINTS)
    return _followed(work, v, edge, flange, end, ways)


def _followed(
    work: Workspace, v: int, edge: int, flange: Floats, end: Arrival, ways: Ways
) -> Arrival:
    """Follow a Cartesian path through solutions; see `along_line`."""
    near = work.q[work.source[edge]]
    joints = work.targets.kind[v] == Kind.JOINTS
    done = follow(near, ways)
    if len(done.q) < len(ways):
        lost = OUT_OF_REACH if len(end.path) == 0 else PATH_REACH
        reason = CODE[PATH_JUMP if done.reached else lost]
        return Arrival(end.q, flange, end.slot, NO_PATH, reason)
    if not joints:
        before = work.branch_at(int(work.source[edge]))
        single = (done.slot == (done.slot[0] if before < 0 else before)).all()
        reason = 0 if single else CODE[PATH_JUMP]
        return Arrival(done.q[-1], flange, int(done.slot[-1]), done.q, reason)
    last = done.q[-1] if len(done.q) else near
    if np.abs(last - end.q).max() > LOST:
        return Arrival(end.q, flange, -1, NO_PATH, CODE[OTHER_BRANCH])
    return Arrival(end.q, flange, -1, np.vstack([done.q, end.q]), 0)


def _ways(work: Workspace, v: int, edge: int, path: Segments, target: bool) -> Ways:
    """Solve along one path to v, with or without the target itself."""
    k = work.samples.count(edge)
    u = np.arange(1, k + (1 if target else 0)) / k
    tcp = path.poses(np.zeros(len(u), dtype=np.int64), u)
    return Solved(work.arm.inverse(tcp @ work.tool_inverse[v]).q)
