"""How the tool turns on its way ($ORNT_TYPE), as far as it matters."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.eligibility.reasons import Reasons
from postproc.diagnostics import Code, Reason
from postproc.language.pose_encoding import Terms
from postproc.language.visits import OrientationLaw, Visits
from postproc.motion.planner import Plan
from postproc.motion.targets import Targets
from postproc.robot.pose import inverse, rotation_vector
from postproc.robot.trajectory import Motion

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
