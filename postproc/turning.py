"""How the tool turns on its way: $ORNT_TYPE, as far as it matters.

Lines and arcs are planned with the tool turning about one fixed axis (RS_WORLD), lines
also with the wrist axes in proportion (WRIST_JNT): on arcs that is not planned, so that
the sides from which they arrive are not known. EUL_WORLD and RPY_WORLD let three angles
run in proportion instead (likely), RS_TRAJ takes the tool along an arc. The ends are
the same, the way between is not: where it may be off by more than a joint's play, a
joint may arrive from another side, and the target is left alone.

Euler angles in proportion turn the tool at w = a' z + e' y(a) + r' z(a, e), and
|w'| <= turn^2 / sin(e), so that it is off by at most turn^2 / (8 sin(e)), and by no
more than the turn. Where e is 0 or 180 deg at both ends they turn it about the z axis,
as RS_WORLD does.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.visits import OrntType, Visits
from postproc.motion.planner import Plan
from postproc.motion.targets import Move, Targets
from postproc.reasons import Reasons
from postproc.robot.pose import inverse, pose_from_record, rotation_vector

PLAY = np.deg2rad(0.01)  # [rad] what a joint may be off without another side
LEAST = 3e-4  # sine below which e is 0 or 180 deg
UNKNOWN = "$ORNT_TYPE is not known here: how the tool turns on the way is not sure"
ANGLES = (
    "with $ORNT_TYPE {} how the tool turns on the way is not sure: use RS_WORLD, or "
    "turn it in smaller steps"
)
ARC = "with $ORNT_TYPE {} how the tool turns on this arc is not sure: use RS_WORLD"


def mark_turning(
    visits: Visits, targets: Targets, plan: Plan, reasons: Reasons
) -> None:
    """Leave alone where another way of turning may matter.

    Args:
        visits: What the program says.
        targets: Its n moves.
        plan: Where they lead.
        reasons: Why visits must not be compensated; more are added.
    """
    kind, cartesian = visits.ornt_type, targets.move != Move.JOINT
    reasons.mark(cartesian & (kind == OrntType.UNKNOWN), UNKNOWN)
    arc = targets.move == Move.CIRCULAR
    reasons.mark(arc & targets.wrist_joint, ARC.format("WRIST_JNT"))
    for rows, text in (
        (arc & (kind == OrntType.RS_TRAJ), ARC.format("RS_TRAJ")),
        (cartesian & (kind == OrntType.EUL_WORLD), ANGLES.format("EUL_WORLD")),
        (cartesian & (kind == OrntType.RPY_WORLD), ANGLES.format("RPY_WORLD")),
    ):
        if rows.any():
            reasons.mark(_may_be_off(visits, targets, plan, rows), text)


def _may_be_off(visits: Visits, targets: Targets, plan: Plan, rows: Bools) -> Bools:
    """Tell which of some moves may turn the tool otherwise than planned, (n,)."""
    edge = np.repeat(np.arange(len(visits)), np.diff(visits.pred_start))
    source = visits.pred
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
    kind = visits.ornt_type[edge]
    world = pose_from_record(visits.frames)[visits.base[edge]][:, :3, :3]
    sine = np.minimum(_sine(world @ begin, kind), _sine(world @ end, kind))
    off = np.minimum(turn**2 / (8.0 * np.maximum(sine, LEAST)), turn)
    both = np.maximum(_sine(world @ begin, kind), _sine(world @ end, kind))
    same = (both < LEAST) & (kind == OrntType.EUL_WORLD)
    off = np.where(kind == OrntType.RS_TRAJ, turn, np.where(same, 0.0, off))
    found[edge[off > PLAY]] = True
    return found


def _sine(R: Floats, kind: Ints) -> Floats:
    """Tell how far from where three angles stop telling orientations apart, (k,).

    Sine of the Euler angle e, or cosine of the pitch, of orientations (k, 3, 3).
    """
    euler, pitch = np.hypot(R[:, 0, 2], R[:, 1, 2]), np.hypot(R[:, 0, 0], R[:, 1, 0])
    return np.asarray(np.where(kind == OrntType.RPY_WORLD, pitch, euler))
