"""The geometric path of a whole program in joint space."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.motion.arrival import Arrival
from postproc.motion.arrive import arrive, choose
from postproc.motion.at_once import at_once
from postproc.motion.branches import follow, on_other_turns, on_written_turns
from postproc.motion.pull import Pull
from postproc.motion.reasons import (
    AMBIGUOUS,
    CODE,
    LIMITS,
    NO_BRANCH,
    NO_START,
    NO_TARGET,
    OUT_OF_REACH,
    PATH_JUMP,
    PATH_LIMITS,
)
from postproc.motion.targets import Kind, Move, Targets
from postproc.motion.workspace import Known, Workspace
from postproc.robot.arm import Arm
from postproc.robot.play import Edges
from postproc.robot.pose import is_unknown

AGREE = 1e-6  # [rad] several predecessors lead to the same joint angles
SLACK = 1e-9  # [rad] rounding at a joint limit
FEW = 256  # targets whose solutions are looked at together
WINDOW = 4096  # targets followed at a time, so that a break costs little


@dataclass(frozen=True)
class Trace:
    """Joint angles at n targets and along the paths between them.

    Attributes:
        q: (n, 6) [rad], NaN where not known.
        flange: (n, 4, 4) [m] at the targets themselves, NaN where not known.
        slot: Branch taken, (n,), -1 where it was not looked up.
        edges: The paths from every predecessor; source -1 where a path is not known.
        reason: Index into `REASONS`, (n,).
        length, turning: TCP path length [m] and reorientation [rad] of each edge, (e,);
            0 for JOINT moves and where they are not known.
        share: Part of its edge's way that leads to each sample of the edges, (s,).
        overruled: Continuity took another branch or turn than the string says, (n,).
        aside: From the targets to where the path passes them, (n, 3) [m], NaN where not
            known.
        pull: How rounded fly points move with their neighbours.
    """

    q: Floats
    flange: Floats
    slot: Ints
    edges: Edges
    length: Floats
    turning: Floats
    share: Floats
    reason: Ints
    overruled: Bools
    aside: Floats
    pull: Pull = field(default_factory=Pull)


def trace(arm: Arm, targets: Targets, known: Known | None = None) -> Trace:
    """Find the joint angles at all targets and along all paths.

    Args:
        arm: The arm.
        targets: The moves.
        known: Targets whose joint angles are known beforehand.

    Raises:
        PlanError: The arm has no closed-form inverse kinematics.
    """
    work = Workspace(arm, targets, known)
    settled = _from_strings(work) | work.given
    work.told = ~np.isnan(work.q[:, 0])
    settled |= at_once(work, work.single & ~settled, WINDOW)
    work.solve(settled)
    _in_order(work, np.flatnonzero(~settled), work.single & ~settled)
    return _finished(work)


def _from_strings(work: Workspace) -> Bools:
    """Settle what does not depend on where the arm comes from; tell which."""
    t, rows = work.targets, np.flatnonzero(work.by_string)
    work.reason[t.kind == Kind.UNKNOWN] = CODE[NO_TARGET]
    slot = t.slot[rows]
    q = work.arm.into_range(work.arm.on_branch(work.flange[rows], slot))
    work.q[rows] = on_written_turns(q, t.turns[rows])
    work.slot[rows] = slot
    missing = rows[np.isnan(q[:, 0])]
    work.reason[missing] = CODE[NO_BRANCH]
    nowhere = np.isnan(work.arm.inverse(work.flange[missing]).q[..., 0]).all(axis=1)
    work.reason[missing[nowhere]] = CODE[OUT_OF_REACH]
    joints = (t.move == Move.JOINT) & (t.kind == Kind.JOINTS)
    return np.asarray(work.by_string | (t.kind == Kind.UNKNOWN) | joints)


def _in_order(work: Workspace, visits: Ints, smooth: Bools) -> None:
    """Go through targets in program order, smooth stretches at once."""
    late: list[int] = []
    poses = smooth & (work.targets.kind == Kind.POSE)
    i = 0
    while i < len(visits):
        v = int(visits[i])
        if smooth[v] and work.is_known(v - 1):
            breaks = ~smooth[v : v + WINDOW]
            count = int(np.argmax(breaks)) if breaks.any() else len(breaks)
            done = _stretch(work, v, count)
            i += done
            if done == count:
                continue
        elif poses[v]:
            i += _without_pasts(work, v, poses)
            continue
        late += _one(work, int(visits[i]))
        i += 1
    for edge in late:
        _check_late(work, edge)


def _stretch(work: Workspace, v: int, count: int) -> int:
    """Follow `count` targets from v on; return how many could be followed."""
    first = int(work.targets.pred_start[v])
    start = work.samples.start
    span = slice(int(start[first]), int(start[first + count]))
    done = follow(work.q[v - 1], work.ways(span))
    ends = start[first + 1 : first + count + 1] - span.start
    reached = int(np.searchsorted(ends, len(done.q), side="right"))
    at = ends[:reached] - 1
    work.q[v : v + reached] = done.q[at]
    work.slot[v : v + reached] = done.slot[at]
    work.path[span.start : span.start + len(done.q)] = done.q
    before = np.append(work.branch_at(v - 1), done.slot[:-1])
    flips = np.flatnonzero((before >= 0) & (before != done.slot))
    flipped = np.searchsorted(ends, flips, side="right")
    work.reason[v + flipped[flipped < reached]] = CODE[PATH_JUMP]
    return reached


def _without_pasts(work: Workspace, v: int, poses: Bools) -> int:
    """Go on from an unknown place up to one that is known; count the targets."""
    ahead = poses[v : v + FEW]
    ends = np.flatnonzero(~ahead)
    rows = np.arange(v, v + (int(ends[0]) if len(ends) else len(ahead)))
    slot, branches = work.targets.slot[rows], work.all_solutions(rows)
    own = branches[np.arange(len(rows)), slot]
    own[slot < 0] = np.nan
    found = np.flatnonzero(~np.isnan(own).any(axis=1))
    count = int(found[0]) + 1 if len(found) else len(rows)
    nowhere = np.isnan(branches.max(axis=2)).all(axis=1)
    reason = np.where(slot < 0, CODE[NO_START], CODE[NO_BRANCH])
    reason[nowhere], reason[found] = CODE[OUT_OF_REACH], 0
    own = on_written_turns(own, work.targets.turns[rows])
    work.q[rows[found[:1]]] = own[found[:1]]
    work.slot[rows[:count]] = np.where(nowhere, -1, slot)[:count]
    work.reason[rows[:count]] = reason[:count]
    return count


def _one(work: Workspace, v: int) -> list[int]:
    """Settle one target from its predecessors; return the edges to look at later."""
    t = work.targets
    edges = range(int(t.pred_start[v]), int(t.pred_start[v + 1]))
    known = [e for e in edges if work.is_known_before(v, int(work.source[e]))]
    later = [e for e in edges if e not in known and work.source[e] >= v]
    arrivals = [arrive(work, v, e) for e in known]
    for edge, arrival in zip(known, arrivals, strict=True):
        _record(work, edge, arrival)
    if not arrivals:
        arrivals = [_without_past(work, v)]
    _merge(work, v, arrivals)
    return later


def _without_past(work: Workspace, v: int) -> Arrival:
    """Arrive from an unknown place."""
    t = work.targets
    nothing = np.empty((0, 6))
    if t.kind[v] == Kind.JOINTS:
        return Arrival(work.q[v], work.flange[v], -1, nothing, 0)
    if t.kind[v] != Kind.POSE:
        return Arrival(np.full(6, np.nan), work.flange[v], -1, nothing, CODE[NO_TARGET])
    return choose(work, v, work.flange[v], None)


def _record(work: Workspace, edge: int, arrival: Arrival) -> None:
    """Write the path of an edge, or forget where the edge comes from."""
    if len(arrival.path) == len(work.path[work.span(edge)]):
        work.path[work.span(edge)] = arrival.path
    else:
        work.source[edge] = -1


def _merge(work: Workspace, v: int, arrivals: list[Arrival]) -> None:
    """Keep what all arrivals agree on."""
    first = arrivals[0]
    reason = next((a.reason for a in arrivals if a.reason), 0)
    work.q[v], work.flange[v], work.slot[v] = first.q, first.flange, first.slot
    if any(np.abs(a.q - first.q).max() > AGREE for a in arrivals[1:]):
        work.q[v], reason = np.nan, CODE[AMBIGUOUS]
    work.reason[v] = reason


def _check_late(work: Workspace, edge: int) -> None:
    """Go over an edge from a target later in the text."""
    v, source = int(work.samples.visit[edge]), int(work.source[edge])
    if not (work.is_known(v) and work.is_known(source)):
        work.source[edge] = -1
        return
    arrival = arrive(work, v, edge)
    _record(work, edge, arrival)
    if not np.abs(arrival.q - work.q[v]).max() <= AGREE:
        work.source[edge] = -1
        work.reason[v] = work.reason[v] or CODE[AMBIGUOUS]


def _finished(work: Workspace) -> Trace:
    """Complete the paths and look for limits and overruled strings."""
    samples, t = work.samples, work.targets
    last = samples.start[1:] - 1
    work.path[last] = work.q[samples.visit]
    edge_of = np.repeat(np.arange(len(last)), np.diff(samples.start))
    holes = np.isnan(work.path[:, 0])
    work.source[edge_of[holes]] = -1
    work.path[holes] = work.q[samples.visit[edge_of[holes]]]
    _limits(work, edge_of)
    written = (t.slot >= 0) & (t.move != Move.JOINT) & (work.slot >= 0)
    turned = on_other_turns(work.q, t.turns)
    other = (work.slot != t.slot) | (turned & ~t.nearest_turn)
    edges = Edges(t.pred_start, work.source, work.path, samples.start)
    share = 1.0 / np.diff(samples.start)[edge_of]
    aside = np.zeros((len(t), 3))
    aside[is_unknown(work.flange) | is_unknown(t.tool)] = np.nan
    return Trace(
        work.q, work.flange, work.slot, edges, samples.length, samples.turning, share,
        work.reason, np.asarray(written & other), aside,
    )  # fmt: skip


def _limits(work: Workspace, edge_of: Ints) -> None:
    """Note targets and paths beyond the joint limits."""
    for q, visit, text in (
        (work.q, np.arange(len(work.q)), LIMITS),
        (work.path, work.samples.visit[edge_of], PATH_LIMITS),
    ):
        over = (q < work.arm.lower - SLACK) | (q > work.arm.upper + SLACK)
        rows = np.flatnonzero(over.any(axis=1))
        for row in rows[work.reason[visit[rows]] == 0][::-1]:
            work.reason[visit[row]] = CODE[text[int(np.argmax(over[row]))]]
