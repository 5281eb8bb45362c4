"""How far configuration flags count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.compensation.eligibility.reasons import Reasons, mark_rows
from postproc.diagnostics import Code, Reason
from postproc.language.visits import Switch, Visits
from postproc.motion.branches import OTHER_TURN, nearest_turns, on_other_turns
from postproc.motion.planner import Plan
from postproc.motion.targets import (
    CODE,
    PATH_JUMP,
    PATH_LIMITS,
    PATH_REACH,
    STRANDS,
    TargetKind,
    Targets,
)
from postproc.robot.arm import Arm
from postproc.robot.trajectory import Motion

# On a line or an arc the path decides where the arm arrives, and the string is checked
# (likely): where it is and says otherwise, the controller stops. A JOINT move takes
# branch and turns from the string; whether it still does where the checks are off is
# not sure, so that it is compensated only where both readings lead to the same place.
# Flags are those of the written targets, which the arm may round (`Plan.exact`).

CNFG, TURN, MULTI = 0, 1, 2  # columns of `Visits.care`
SAID = {
    Switch.UNSET: "not set",
    Switch.ON: "TRUE",
    Switch.OFF: "FALSE",
    Switch.UNKNOWN: "not known",
}
AFTER = Reason(
    Code.UNKNOWN_POSITION_BEFORE,
    "the move before it ends with an uncertain branch or turn",
)
FROM_ANYWHERE = Reason(
    Code.CONFIGURATION_UNKNOWN,
    "whether its configuration flags count is not known here, and the place before, "
    "whose configuration the arm keeps otherwise, is not known: add a move by joint "
    "angles before it",
)
STRANDED = Reason(
    Code.UNKNOWN_POSITION_BEFORE,
    "the arm cannot reach the previous target as it is written, so that the approach "
    "is not known: correct the previous target first",
)
STOPPED = Reason(
    Code.UNKNOWN_POSITION_BEFORE,
    "the controller stops at the previous target, or may, because of its configuration "
    "flags, so that the approach is not known: correct these first",
)
_ON_THE_WAY = "on the way to the previous target, so that the approach is not known"
BROKEN_PATHS = {
    PATH_REACH: f"the arm leaves its reach {_ON_THE_WAY}: lead that path elsewhere",
    PATH_JUMP: f"a singularity lies {_ON_THE_WAY}: lead that path elsewhere",
    **{
        PATH_LIMITS[j]: f"axis {j + 1} would be beyond its limit {_ON_THE_WAY}: lead "
        "that path elsewhere"
        for j in range(6)
    },
}
"""Why an approach is not known where the path before it cannot be driven."""
CONTRADICTED, BEYOND_REACH, BEHIND_STOP, BEHIND_PATH = 1, 2, 4, 8
"""Why what comes from a visit is doubtful; the last is shifted by the broken path."""


@dataclass(frozen=True)
class Overruled:
    """Where a Cartesian path arrives otherwise than its configuration string says.

    Attributes:
        branch: On another branch, (n,).
        turn: On another turn, (n,).
    """

    branch: Bools
    turn: Bools

    def find_unchecked(self, visits: Visits) -> Bools:
        """Tell where the program leaves open whether the string is checked, (n,)."""
        unset = visits.motion.care == Switch.UNSET
        found: Bools = (self.branch & unset[:, CNFG]) | (self.turn & unset[:, TURN])
        return found


def find_overruled(targets: Targets, plan: Plan) -> Overruled:
    """Compare where Cartesian paths arrive with their configuration strings."""
    path = plan.overruled & ~targets.via
    return Overruled(
        path & (plan.exact.slot != targets.slot),
        path & on_other_turns(plan.exact.q, targets.turns) & ~targets.nearest_turn,
    )


def find_stops(visits: Visits, targets: Targets, plan: Plan) -> Bools:
    """Find where the controller stops, or may, because of configuration flags, (n,).

    Args:
        visits: What the program says.
        targets: Its n moves.
        plan: Where they lead.
    """
    path = find_overruled(targets, plan)
    checked = (visits.motion.care == Switch.ON) | (visits.motion.care == Switch.UNKNOWN)
    found = (path.branch & checked[:, CNFG]) | (path.turn & checked[:, TURN])
    return np.asarray(found | _find_misses(visits, targets, plan))


def mark_configuration_flags(
    visits: Visits,
    targets: Targets,
    plan: Plan,
    arm: Arm,
    reasons: Reasons,
    begun: bool = False,
    seeded: bool = False,
) -> Bools:
    """Leave alone what configuration strings make doubtful.

    Args:
        visits: What the program says.
        targets: Its n moves.
        plan: Where they lead.
        arm: The arm.
        reasons: Why visits must not be compensated; more are added.
        begun: The first visit is a place that makes what comes from there doubtful.
        seeded: It is a place that is known beforehand.

    Returns:
        Whether what comes from a visit is doubtful, (n,).
    """
    _mark_stops(visits, find_overruled(targets, plan), reasons)
    finer = Reason(Code.CONFIGURATION_CONTRADICTED, visits.dialect.terms.branch_stops)
    reasons.mark(_find_misses(visits, targets, plan), finer)
    doubtful = _mark_either_way(visits, targets, plan, arm, reasons)
    doubtful |= _mark_from_anywhere(visits, targets, plan, reasons, seeded)
    doubtful[:1] |= begun
    if not doubtful.any():
        return doubtful
    sure = (
        (targets.move == Motion.JOINT) & _find_placed(targets) & ~targets.nearest_turn
    )
    reached, on = _followers(visits, doubtful, sure)
    reasons.mark(reached, AFTER)
    return on


def mark_stranded(
    visits: Visits, targets: Targets, plan: Plan, reasons: Reasons, begun: int = 0
) -> Ints:
    """Leave alone what comes from targets that the arm does not reach.

    There the controller stops with an error, and who goes on comes from anywhere.
    Behind a stop because of flags only that is left which does not say where it is.

    Args:
        visits: What the program says.
        targets: Its n moves.
        plan: Where they lead.
        reasons: Why visits must not be compensated; more are added.
        begun: Whether what comes from the first visit is doubtful, as returned.

    Returns:
        Whether what comes from a visit is doubtful, and why: 0, or BEYOND_REACH,
        BEHIND_STOP and BEHIND_PATH with its shifts, (n,).
    """
    found = np.zeros(len(visits), dtype=np.int64)
    placed = _find_placed(targets)
    never, broken = np.zeros_like(placed), [CODE[one] for one in BROKEN_PATHS]
    beyond = STRANDS[plan.reason] & ~np.isin(plan.reason, broken)
    causes = [(BEYOND_REACH, beyond, STRANDED, never)]
    for k, (cause, text) in enumerate(BROKEN_PATHS.items()):
        why, rows = BEHIND_PATH << k, np.asarray(plan.reason == CODE[cause])
        causes.append((why, rows, Reason(STRANDED.code, text), never))
    causes.append((BEHIND_STOP, np.array(targets.stops), STOPPED, placed))
    for why, rows, reason, sure in causes:
        rows[:1] |= bool(begun & why)
        if rows.any():
            reached, on = _followers(visits, rows, placed)
            reasons.mark(reached & ~sure, reason)
            found[on] |= why
    return found


def _find_placed(targets: Targets) -> Bools:
    """Tell which targets are where they are wherever the arm comes from, (n,)."""
    posed = (targets.kind == TargetKind.POSE) & (targets.slot >= 0)
    return np.asarray((targets.kind == TargetKind.JOINTS) | posed)


def _mark_stops(visits: Visits, path: Overruled, reasons: Reasons) -> None:
    """Leave alone where the controller checks flags that the path contradicts."""
    terms = visits.dialect.terms
    for rows, stops, may_stop, column in (
        (path.branch, terms.branch_stops, terms.branch_may_stop, CNFG),
        (path.turn, terms.turn_stops, terms.turn_may_stop, TURN),
    ):
        care = visits.motion.care[:, column]
        for switch, text in ((Switch.ON, stops), (Switch.UNKNOWN, may_stop)):
            reason = Reason(Code.CONFIGURATION_CONTRADICTED, text)
            reasons.mark(rows & (care == switch), reason)


def _find_misses(visits: Visits, targets: Targets, plan: Plan) -> Bools:
    """Find checked flags, finer than branch and turn, that are not the plan's, (n,)."""
    off = np.zeros(len(visits), dtype=bool)
    rows = np.flatnonzero((targets.kind == TargetKind.POSE) & (targets.slot >= 0))
    q = plan.exact.q[rows]
    missed = visits.dialect.misses(visits.target.values[rows], q)
    if missed is not None:
        off[rows] = missed & ~np.isnan(q[:, 0])
    return np.asarray(off & (visits.motion.care[:, CNFG] != Switch.OFF))


def _mark_either_way(
    visits: Visits, targets: Targets, plan: Plan, arm: Arm, reasons: Reasons
) -> Bools:
    """Leave moves alone that two readings of their string lead elsewhere."""
    placed = (targets.kind == TargetKind.POSE) & (targets.slot >= 0)
    placed &= ~np.isnan(plan.exact.q[:, 0])
    joint = placed & (targets.move == Motion.JOINT)
    wrist = placed & ~joint & targets.wrist_joint
    branch = wrist | (joint & _is_doubtful(visits.motion.care[:, CNFG]))
    turn = wrist | (joint & _turns_doubted(visits, targets))
    if branch.any():
        edge, source = _edges(visits, plan, branch)
        other = arm.branch(plan.exact.q[source]) != targets.slot[edge]
        branch &= mark_rows(len(visits), edge[other])
    if turn.any():
        turn &= _other_turn(visits, targets, plan, arm)
    terms, code = visits.dialect.terms, Code.CONFIGURATION_UNKNOWN
    reasons.mark(wrist & (branch | turn), Reason(code, terms.wrist))
    for value in Switch:
        rows = branch & (visits.motion.care[:, CNFG] == value)
        reasons.mark(rows, Reason(code, terms.branch.format(SAID[value])))
    for pair in np.unique(visits.motion.care[turn][:, [TURN, MULTI]], axis=0):
        rows = turn & (visits.motion.care[:, [TURN, MULTI]] == pair).all(axis=1)
        text = terms.nearest.format(*(SAID[Switch(v)] for v in pair))
        reasons.mark(rows, Reason(code, text))
    return np.asarray(branch | turn)


def _mark_from_anywhere(
    visits: Visits, targets: Targets, plan: Plan, reasons: Reasons, seeded: bool
) -> Bools:
    """Leave moves alone whose string need not count, from a place that is not known."""
    rows = (targets.kind == TargetKind.POSE) & (targets.slot >= 0)
    rows &= _is_doubtful(visits.motion.care[:, CNFG])
    edge, pred, known = _list_edges(visits, plan)
    found = rows & mark_rows(len(visits), edge[~known])
    if seeded:  # from where it is known, and -1 speaks of sides alone
        found &= ~mark_rows(len(visits), edge[pred == 0])
    reasons.mark(found, FROM_ANYWHERE)
    return np.asarray(found)


def _is_doubtful(switch: Ints) -> Bools:
    return np.asarray((switch == Switch.OFF) | (switch == Switch.UNKNOWN))


def _turns_doubted(visits: Visits, targets: Targets) -> Bools:
    """Tell where written turns and the nearest ones may both be meant, (n,)."""
    checked, multi = visits.motion.care[:, TURN], visits.motion.care[:, MULTI]
    nearest = (checked == Switch.ON) | (checked == Switch.UNKNOWN)
    written = _is_doubtful(checked) | (multi == Switch.UNKNOWN)
    return np.asarray(np.where(targets.nearest_turn, nearest, written))


def _other_turn(visits: Visits, targets: Targets, plan: Plan, arm: Arm) -> Bools:
    """Tell where written turns and the nearest ones differ, (n,)."""
    edge, source = _edges(visits, plan, np.ones(len(visits), dtype=bool))
    turned = nearest_turns(plan.exact.q[edge], plan.exact.q[source])
    allowed = (turned >= arm.lower) & (turned <= arm.upper)
    other = allowed & (np.abs(turned - plan.exact.q[edge]) > OTHER_TURN)
    far = mark_rows(len(visits), edge[other.any(axis=1)])
    return np.where(
        targets.nearest_turn, on_other_turns(plan.exact.q, targets.turns), far
    )


def _edges(visits: Visits, plan: Plan, rows: Bools) -> tuple[Ints, Ints]:
    """List the known origins of some visits: visits (e,) and where from (e,)."""
    edge, pred, known = _list_edges(visits, plan)
    known = known & rows[edge]
    return edge[known], pred[known]


def _list_edges(visits: Visits, plan: Plan) -> tuple[Ints, Ints, Bools]:
    """List where visits come from: visits, where from, and if that is known, (e,)."""
    edge = np.repeat(np.arange(len(visits)), np.diff(visits.graph.pred_start))
    pred = visits.graph.pred
    known = (pred >= 0) & ~np.isnan(plan.exact.q[np.maximum(pred, 0), 0])
    return edge, pred, known


def _followers(visits: Visits, doubtful: Bools, sure: Bools) -> tuple[Bools, Bools]:
    """Find what comes from doubtful places, up to the next ones that are sure, (n,).

    A sure place is among them itself: the side that it is reached from is not sure.

    Returns:
        What comes from doubtful places, and which places make others doubtful.
    """
    edge = np.repeat(np.arange(len(visits)), np.diff(visits.graph.pred_start))
    order = np.argsort(visits.graph.pred, kind="stable")
    after, source = edge[order], visits.graph.pred[order]
    reached, waiting = np.array(doubtful), np.flatnonzero(doubtful).tolist()
    while waiting:
        v = waiting.pop()
        first, last = np.searchsorted(source, [v, v + 1])
        for w in after[first:last].tolist():
            if not (reached[w] or sure[w]):
                waiting.append(w)
            reached[w] = True
    return reached & ~doubtful, doubtful | (reached & ~sure)
