"""Which targets must stay, whatever the model says: flags, orientation, arcs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Interned, Ints
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.pose_encoding import Terms
from postproc.language.visits import OrientationLaw, Switch, Visits
from postproc.motion.branches import OTHER_TURN, nearest_turns, on_other_turns
from postproc.motion.path import NEAR, arcs_of
from postproc.motion.planner import Plan
from postproc.motion.targets import STRANDS, TargetKind, Targets
from postproc.robot.arm import Arm
from postproc.robot.pose import MM, inverse, rotation_vector
from postproc.robot.trajectory import Motion

# Why something did not happen, for many visits at once.


class Reasons:
    """The first reason given for each of n visits.

    >>> reasons = Reasons(3)
    >>> far = Reason(Code.OUT_OF_REACH, "out of reach")
    >>> wrist = Reason(Code.SINGULAR_WRIST, "at the wrist singularity")
    >>> reasons.mark(np.array([True, False, False]), far)
    >>> reasons.mark(np.array([True, True, False]), wrist)
    >>> [str(reasons[k]) for k in range(3)]
    ['out of reach', 'at the wrist singularity', '']
    """

    def __init__(self, n: int) -> None:
        """Start with no reason for n visits."""
        self.index: Ints = np.zeros(n, dtype=np.int64)
        self._found = Interned([NO_REASON])

    def copy(self) -> Reasons:
        """Return the same, to go on from."""
        other = Reasons(0)
        other.index, other._found = np.array(self.index), Interned(self._found)
        return other

    @property
    def all(self) -> tuple[Reason, ...]:
        """Return the reasons; index 0 is `NO_REASON`."""
        return tuple(self._found)

    @property
    def none(self) -> Bools:
        """Tell which visits have no reason yet, (n,)."""
        return np.asarray(self.index == 0)

    def mark(self, rows: Bools, reason: Reason) -> None:
        """Give visits a reason, unless they have one already.

        Args:
            rows: Which visits, (n,).
            reason: The reason.
        """
        if rows.any() and (rows := rows & self.none).any():
            self.index[rows] = self._found[reason]

    def mark_visits(self, visits: Ints, reason: Reason) -> None:
        """Give a few visits a reason, by number, unless they have one already."""
        free = visits[self.index[visits] == 0]
        if len(free):
            self.index[free] = self._found[reason]

    def adopt(self, index: Ints, reasons: tuple[Reason, ...]) -> None:
        """Take over reasons found elsewhere, (n,) indices into them."""
        for number in np.flatnonzero(np.bincount(index)).tolist():
            if reasons[number]:
                self.mark(index == number, reasons[number])

    def __getitem__(self, visit: int) -> Reason:
        """Return the reason of one visit."""
        return self.all[int(self.index[visit])]


# How far configuration flags count.
#
# On a line or an arc the path decides where the arm arrives, and the string is checked
# (likely): where it is and says otherwise, the controller stops. A JOINT move takes
# branch and turns from the string; whether it still does where the checks are off is
# not sure, so that it is compensated only where both readings lead to the same place.

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
CONTRADICTED, BEYOND_REACH, BEHIND_STOP = 1, 2, 4
"""Why what comes from a visit is doubtful."""


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
        path & (plan.slot != targets.slot),
        path & on_other_turns(plan.q, targets.turns) & ~targets.nearest_turn,
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
) -> Bools:
    """Leave alone what configuration strings make doubtful.

    Args:
        visits: What the program says.
        targets: Its n moves.
        plan: Where they lead.
        arm: The arm.
        reasons: Why visits must not be compensated; more are added.
        begun: The first visit is a place that makes what comes from there doubtful.

    Returns:
        Whether what comes from a visit is doubtful, (n,).
    """
    _mark_stops(visits, find_overruled(targets, plan), reasons)
    finer = Reason(Code.CONFIGURATION_CONTRADICTED, visits.dialect.terms.branch_stops)
    reasons.mark(_find_misses(visits, targets, plan), finer)
    doubtful = _mark_either_way(visits, targets, plan, arm, reasons)
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
        Whether what comes from a visit is doubtful, and why: 0, or BEYOND_REACH and
        BEHIND_STOP, (n,).
    """
    found = np.zeros(len(visits), dtype=np.int64)
    placed = _find_placed(targets)
    for why, rows, reason, sure in (
        (BEYOND_REACH, STRANDS[plan.reason], STRANDED, np.zeros_like(placed)),
        (BEHIND_STOP, np.array(targets.stops), STOPPED, placed),
    ):
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
    missed = visits.dialect.misses(visits.target.values[rows], plan.q[rows])
    if missed is not None:
        off[rows] = missed & ~np.isnan(plan.q[rows, 0])
    return np.asarray(off & (visits.motion.care[:, CNFG] != Switch.OFF))


def _mark_either_way(
    visits: Visits, targets: Targets, plan: Plan, arm: Arm, reasons: Reasons
) -> Bools:
    """Leave moves alone that two readings of their string lead elsewhere."""
    placed = (targets.kind == TargetKind.POSE) & (targets.slot >= 0)
    placed &= ~np.isnan(plan.q[:, 0])
    joint = placed & (targets.move == Motion.JOINT)
    wrist = placed & ~joint & targets.wrist_joint
    branch = wrist | (joint & _is_doubtful(visits.motion.care[:, CNFG]))
    turn = wrist | (joint & _turns_doubted(visits, targets))
    if branch.any():
        edge, source = _edges(visits, plan, branch)
        other = arm.branch(plan.q[source]) != targets.slot[edge]
        branch &= _mark_rows(len(visits), edge[other])
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
    turned = nearest_turns(plan.q[edge], plan.q[source])
    allowed = (turned >= arm.lower) & (turned <= arm.upper)
    other = allowed & (np.abs(turned - plan.q[edge]) > OTHER_TURN)
    far = _mark_rows(len(visits), edge[other.any(axis=1)])
    return np.where(targets.nearest_turn, on_other_turns(plan.q, targets.turns), far)


def _edges(visits: Visits, plan: Plan, rows: Bools) -> tuple[Ints, Ints]:
    """List the known origins of some visits: visits (e,) and where from (e,)."""
    edge = np.repeat(np.arange(len(visits)), np.diff(visits.graph.pred_start))
    known = rows[edge] & (visits.graph.pred >= 0)
    known &= ~np.isnan(plan.q[visits.graph.pred, 0])
    return edge[known], visits.graph.pred[known]


def _mark_rows(n: int, rows: Ints) -> Bools:
    """Tell which of n rows are listed, (n,)."""
    found = np.zeros(n, dtype=bool)
    found[rows] = True
    return found


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


# How the tool turns on its way: $ORNT_TYPE, as far as it matters.
#
# Lines and arcs are planned with the tool turning about one fixed axis (RS_WORLD),
# lines also with the wrist axes in proportion (WRIST_JNT): on arcs that is not planned,
# so that the sides from which they arrive are not known. EUL_WORLD and RPY_WORLD let
# three angles run in proportion instead (likely), RS_TRAJ takes the tool along an arc.
# The ends are the same, the way between is not: where it may be off by more than a
# joint's play, a joint may arrive from another side, and the target is left alone.
# On arcs on which the tool turns little the targets are corrected, and joints that may
# arrive from another side are not known (`motion.spline_moves`).
#
# Euler angles in proportion turn the tool at w = a' z + e' y(a) + r' z(a, e), and |w'|
# <= turn^2 / sin(e), so that it is off by at most turn^2 / (8 sin(e)), and by no more
# than the turn. Where e is 0 or 180 deg at both ends they turn it about the z axis, as
# RS_WORLD does.

PLAY = np.deg2rad(0.01)  # [rad] what a joint may be off without another side
SMALL_TURN = np.deg2rad(0.5)  # of an arc: joints that this may turn back are not sure
LEAST = 3e-4  # sine below which e is 0 or 180 deg


def mark_orientation_interpolation(
    visits: Visits, targets: Targets, plan: Plan, reasons: Reasons
) -> None:
    """Leave alone where another way of turning may matter.

    Args:
        visits: What the program says.
        targets: Its n moves.
        plan: Where they lead.
        reasons: Why visits must not be compensated; more are added.
    """
    kind, cartesian = visits.motion.orientation_law, targets.move != Motion.JOINT
    law, terms = OrientationLaw, visits.dialect.terms
    unknown = Reason(Code.ORIENTATION_LAW, terms.law_unknown)
    reasons.mark(cartesian & (kind == law.UNKNOWN), unknown)
    arc = targets.move == Motion.CIRCULAR
    reasons.mark(
        arc & targets.wrist_joint, _name_law(terms, terms.arc, law.WRIST_JOINTS)
    )
    for rows, text, said in (
        (targets.along, terms.arc, law.ALONG_PATH),
        (cartesian & (kind == law.EULER_ANGLES), terms.angles, law.EULER_ANGLES),
        (cartesian & (kind == law.ROLL_PITCH_YAW), terms.angles, law.ROLL_PITCH_YAW),
    ):
        if rows.any():
            off = _may_be_off(visits, targets, plan, rows)
            reasons.mark(off, _name_law(terms, text, said))


def _name_law(terms: Terms, text: str, law: OrientationLaw) -> Reason:
    """Name a law in a reason, where the language has a name for it."""
    name = terms.laws[law] if law < len(terms.laws) else law.name
    return Reason(Code.ORIENTATION_LAW, text.format(name))


def _may_be_off(visits: Visits, targets: Targets, plan: Plan, rows: Bools) -> Bools:
    """Tell which of some moves may turn the tool otherwise than planned, (n,)."""
    edge = np.repeat(np.arange(len(visits)), np.diff(visits.graph.pred_start))
    source = visits.graph.pred
    known = rows[edge] & (source >= 0)
    known &= ~np.isnan(plan.tcp[source, 0, 0] + plan.tcp[edge, 0, 0])
    edge, source = edge[known], source[known]
    found = np.zeros(len(visits), dtype=bool)
    if len(edge) == 0:
        return found
    to_flange = inverse(targets.tool[source])
    begin = (plan.tcp[source] @ to_flange @ targets.tool[edge])[:, :3, :3]
    end = plan.tcp[edge][:, :3, :3]
    turn = np.linalg.norm(rotation_vector(np.swapaxes(begin, 1, 2) @ end), axis=1)
    kind = visits.motion.orientation_law[edge]
    world = visits.frame.poses[visits.frame.base[edge]][:, :3, :3]
    sine = np.minimum(_sine(world @ begin, kind), _sine(world @ end, kind))
    off = np.minimum(turn**2 / (8.0 * np.maximum(sine, LEAST)), turn)
    both = np.maximum(_sine(world @ begin, kind), _sine(world @ end, kind))
    same = (both < LEAST) & (kind == OrientationLaw.EULER_ANGLES)
    along = targets.along[edge]
    off = np.where(along, turn, np.where(same, 0.0, off))
    found[edge[off > np.where(along, SMALL_TURN, PLAY)]] = True
    return found


def _sine(R: Floats, kind: Ints) -> Floats:
    """Tell how far from where three angles stop telling orientations apart, (k,).

    Sine of the Euler angle e, or cosine of the pitch, of orientations (k, 3, 3).
    """
    euler, pitch = np.hypot(R[:, 0, 2], R[:, 1, 2]), np.hypot(R[:, 0, 0], R[:, 1, 0])
    return np.asarray(np.where(kind == OrientationLaw.ROLL_PITCH_YAW, pitch, euler))


# Arcs that their points hardly determine are not corrected.
#
# A correction moves start, VIA and end of an arc by slightly different amounts. That
# does no harm where they lie well apart; where they do not, the arm would run along
# another circle than the program says, or along none.

CURE = "move VIA, or use LINEAR"
LINE = Reason(
    Code.ARC_UNDETERMINED,
    f"the three points of the arc that begins here lie on one line: {CURE}",
)
TOO_NEAR = Reason(
    Code.ARC_UNDETERMINED,
    f"two of the three points of an arc are nearer than {NEAR / MM:g} mm, so that they "
    f"do not determine its circle: {CURE}",
)
STRAYS = Reason(
    Code.ARC_DISTORTED,
    "the corrected points of the arc would make a very different circle: move VIA "
    "to its middle, or divide it",
)


def mark_arcs(targets: Targets, plan: Plan, reasons: Reasons) -> None:
    """Leave the points of arcs alone that make no sure circle, the start included.

    Args:
        targets: The n moves of a program.
        plan: Where they lead.
        reasons: Why visits must not be compensated; more are added.
    """
    arcs = arcs_of(targets, plan.tcp, plan.aside)
    near = arcs.too_near
    for rows, reason in ((near, TOO_NEAR), (arcs.on_a_line & ~near, LINE)):
        reasons.mark(_mark_rows(len(targets), arcs.visit[rows]), reason)


def find_strayed(targets: Targets, plan: Plan, shift: Floats, step: float) -> Bools:
    """Tell which targets move so that an arc at them becomes quite another one, (n,).

    It does where the path between its points moves more than twice as far as they do:
    it would then miss by more than it does without any correction.

    Args:
        targets: The n moves of a program.
        plan: Where they lead.
        shift: What the targets move by, (n, 3) [m], base frame.
        step: How much farther than its points the path may move in any case [m].
    """
    arcs = arcs_of(targets, plan.tcp, plan.aside)
    if len(arcs) == 0:
        return np.zeros(len(targets), dtype=bool)
    own = shift[arcs.visit]
    size = np.linalg.norm(own, axis=2).max(axis=1)
    with np.errstate(invalid="ignore"):
        far = (size > 0.0) & (arcs.strays(own) > np.maximum(size, step))
    return _mark_rows(len(targets), arcs.visit[far])
