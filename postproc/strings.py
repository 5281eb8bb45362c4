"""How far configuration strings count: $CNFG_CARE, $TURN_CARE and $JNT_MTURN.

On a line or an arc the path decides where the arm arrives, and the string is checked
(likely): where it is and says otherwise, the controller stops. A JOINT move takes
branch and turns from the string; whether it still does where the checks are off is not
sure, so that it is compensated only where both readings lead to the same place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.language.visits import Switch, Visits
from postproc.motion.branches import OTHER_TURN, nearest_turns, on_other_turns
from postproc.motion.planner import Plan
from postproc.motion.targets import Kind, Move, Targets
from postproc.reasons import Reasons
from postproc.robot.arm import Arm

CNFG, TURN, MULTI = 0, 1, 2  # columns of `Visits.care`
SAID = {
    Switch.UNSET: "not set",
    Switch.ON: "TRUE",
    Switch.OFF: "FALSE",
    Switch.UNKNOWN: "not known",
}
STOPS = (
    "${} is TRUE, and the path arrives on another {} than the configuration string "
    "says: the controller stops here"
)
MAY_STOP = (
    "${} is not known here, and the path arrives on another {} than the configuration "
    "string says"
)
BRANCH = (
    "the configuration string says another branch than the arm is on: whether it "
    "counts is not sure with $CNFG_CARE {}"
)
NEAREST = (
    "the configuration string says another turn than the nearest: which of them counts "
    "is not sure with $TURN_CARE {} and $JNT_MTURN {}"
)
WRIST = (
    "the configuration string says another branch or turn than the nearest: whether a "
    "line with $ORNT_TYPE WRIST_JNT leads there is not sure"
)
AFTER = "it comes from a move whose branch or turn is not sure"


@dataclass(frozen=True)
class Overruled:
    """Where a Cartesian path arrives otherwise than its configuration string says.

    Attributes:
        branch: On another branch, (n,).
        turn: On another turn, (n,).
    """

    branch: Bools
    turn: Bools

    def unchecked(self, visits: Visits) -> Bools:
        """Tell where the program leaves open whether the string is checked, (n,)."""
        unset = visits.care == Switch.UNSET
        found: Bools = (self.branch & unset[:, CNFG]) | (self.turn & unset[:, TURN])
        return found


def overruled(targets: Targets, plan: Plan) -> Overruled:
    """Compare where Cartesian paths arrive with their configuration strings."""
    path = plan.overruled & ~targets.via
    return Overruled(
        path & (plan.slot != targets.slot),
        path & on_other_turns(plan.q, targets.turns) & ~targets.nearest_turn,
    )


def mark_strings(
    visits: Visits,
    targets: Targets,
    plan: Plan,
    arm: Arm,
    reasons: Reasons,
    begun: bool = False,
) -> bool:
    """Leave alone what configuration strings make doubtful.

    Args:
        visits: What the program says.
        targets: Its n moves.
        plan: Where they lead.
        arm: The arm.
        reasons: Why visits must not be compensated; more are added.
        begun: The first visit is a place that makes what comes from there doubtful.

    Returns:
        Whether what comes from the last visit is doubtful.
    """
    _mark_stops(visits, overruled(targets, plan), reasons)
    doubtful = _mark_either_way(visits, targets, plan, arm, reasons)
    doubtful[:1] |= begun
    if not doubtful.any():
        return False
    reached, on = _followers(visits, targets, doubtful)
    reasons.mark(reached, AFTER)
    return bool(on[-1])


def _mark_stops(visits: Visits, path: Overruled, reasons: Reasons) -> None:
    """Leave alone where the controller checks a string that the path contradicts."""
    for rows, name, what, column in (
        (path.branch, "CNFG_CARE", "branch", CNFG),
        (path.turn, "TURN_CARE", "turn", TURN),
    ):
        care = visits.care[:, column]
        reasons.mark(rows & (care == Switch.ON), STOPS.format(name, what))
        reasons.mark(rows & (care == Switch.UNKNOWN), MAY_STOP.format(name, what))


def _mark_either_way(
    visits: Visits, targets: Targets, plan: Plan, arm: Arm, reasons: Reasons
) -> Bools:
    """Leave moves alone that two readings of their string lead elsewhere."""
    placed = (targets.kind == Kind.POSE) & (targets.slot >= 0)
    placed &= ~np.isnan(plan.q[:, 0])
    joint = placed & (targets.move == Move.JOINT)
    wrist = placed & ~joint & targets.wrist_joint
    branch = wrist | (joint & _doubted(visits.care[:, CNFG]))
    turn = wrist | (joint & _turns_doubted(visits, targets))
    if branch.any():
        branch &= _from_other_branch(visits, targets, plan, arm, branch)
    if turn.any():
        turn &= _other_turn(visits, targets, plan, arm)
    reasons.mark(wrist & (branch | turn), WRIST)
    for value in Switch:
        rows = branch & (visits.care[:, CNFG] == value)
        reasons.mark(rows, BRANCH.format(SAID[value]))
    for pair in np.unique(visits.care[turn][:, [TURN, MULTI]], axis=0):
        rows = turn & (visits.care[:, [TURN, MULTI]] == pair).all(axis=1)
        reasons.mark(rows, NEAREST.format(*(SAID[Switch(v)] for v in pair)))
    return np.asarray(branch | turn)


def _doubted(switch: Ints) -> Bools:
    return np.asarray((switch == Switch.OFF) | (switch == Switch.UNKNOWN))


def _turns_doubted(visits: Visits, targets: Targets) -> Bools:
    """Tell where written turns and the nearest ones may both be meant, (n,)."""
    checked, multi = visits.care[:, TURN], visits.care[:, MULTI]
    nearest = (checked == Switch.ON) | (checked == Switch.UNKNOWN)
    written = _doubted(checked) | (multi == Switch.UNKNOWN)
    return np.asarray(np.where(targets.nearest_turn, nearest, written))


def _from_other_branch(
    visits: Visits, targets: Targets, plan: Plan, arm: Arm, rows: Bools
) -> Bools:
    """Tell which of some visits are reached from another branch than theirs, (n,)."""
    edge, source = _edges(visits, plan, rows)
    other = arm.branch(plan.q[source]) != targets.slot[edge]
    return _seen(len(visits), edge[other])


def _other_turn(visits: Visits, targets: Targets, plan: Plan, arm: Arm) -> Bools:
    """Tell where written turns and the nearest ones differ, (n,)."""
    edge, source = _edges(visits, plan, np.ones(len(visits), dtype=bool))
    turned = nearest_turns(plan.q[edge], plan.q[source])
    allowed = (turned >= arm.lower) & (turned <= arm.upper)
    other = allowed & (np.abs(turned - plan.q[edge]) > OTHER_TURN)
    far = _seen(len(visits), edge[other.any(axis=1)])
    return np.where(targets.nearest_turn, on_other_turns(plan.q, targets.turns), far)


def _edges(visits: Visits, plan: Plan, rows: Bools) -> tuple[Ints, Ints]:
    """List the known origins of some visits: visits (e,) and where from (e,)."""
    edge = np.repeat(np.arange(len(visits)), np.diff(visits.pred_start))
    known = rows[edge] & (visits.pred >= 0)
    known &= ~np.isnan(plan.q[visits.pred, 0])
    return edge[known], visits.pred[known]


def _seen(n: int, rows: Ints) -> Bools:
    """Tell which of n rows are listed, (n,)."""
    found = np.zeros(n, dtype=bool)
    found[rows] = True
    return found


def _followers(
    visits: Visits, targets: Targets, doubtful: Bools
) -> tuple[Bools, Bools]:
    """Find what comes from doubtful places, up to the next ones that are sure, (n,).

    A sure place is among them itself: the side that it is reached from is not sure.

    Returns:
        What comes from doubtful places, and which places make others doubtful.
    """
    sure = (targets.move == Move.JOINT) & (
        (targets.kind == Kind.JOINTS)
        | ((targets.kind == Kind.POSE) & (targets.slot >= 0) & ~targets.nearest_turn)
    )
    edge = np.repeat(np.arange(len(visits)), np.diff(visits.pred_start))
    order = np.argsort(visits.pred, kind="stable")
    after, source = edge[order], visits.pred[order]
    reached, waiting = np.array(doubtful), np.flatnonzero(doubtful).tolist()
    while waiting:
        v = waiting.pop()
        first, last = np.searchsorted(source, [v, v + 1])
        for w in after[first:last].tolist():
            if not (reached[w] or sure[w]):
                waiting.append(w)
            reached[w] = True
    return reached & ~doubtful, doubtful | (reached & ~sure)
