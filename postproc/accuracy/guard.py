"""When a correction is not trusted."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.reasons import Reasons
from postproc.robot.arm import Arm
from postproc.robot.cell import LimitSection
from postproc.robot.pose import MM, has_unknown, lengths

TURNED = 0.5  # change of a side by which a joint has turned
SOLVED = 1e-6  # [m] model against wanted pose


def guard_solutions(
    reasons: Reasons, arm: Arm, limits: LimitSection, q: Floats, solved: Floats
) -> None:
    """Mark corrected commands that the arm cannot or should not be given.

    Args:
        reasons: Collects the first reason of every visit.
        arm: The arm.
        limits: The cell's guards.
        q: Joint angles of the original command, (n, 6) [rad].
        solved: Joint angles of the corrected command, (n, 6) [rad], NaN where the
            corrected pose has no solution.
    """
    with np.errstate(invalid="ignore"):
        unsolved = has_unknown(solved)
        lost = np.asarray(unsolved & ~has_unknown(q))
        reasons.mark(lost, "the corrected pose is out of reach on its branch")
        over = ~arm.within_limits(solved) & ~unsolved
        reasons.mark(over, "the corrected pose is beyond a joint limit")
        wrist = np.abs(q[:, 4]) < np.deg2rad(limits.wrist_deg)
        wrist |= np.abs(solved[:, 4]) < np.deg2rad(limits.wrist_deg)
        text = f"within {limits.wrist_deg:g} deg of the wrist singularity"
        reasons.mark(wrist, text)
        flipped = np.sign(q[:, 4]) != np.sign(solved[:, 4])
        reasons.mark(flipped & ~lost, "the correction would flip the wrist")


def guard_size(
    reasons: Reasons, limits: LimitSection, correction: Floats, residual: Floats
) -> None:
    """Mark corrections that are too large or did not converge.

    Args:
        reasons: Collects the first reason of every visit.
        limits: The cell's guards.
        correction: Change of the commanded TCP, (n, 3) [m].
        residual: Predicted landing against the wanted position, (n,) [m].
    """
    with np.errstate(invalid="ignore"):
        size = lengths(correction) / MM
        text = f"the correction exceeds correction_mm = {limits.correction_mm:g}"
        reasons.mark(size > limits.correction_mm, text)
        reasons.mark(~(residual <= SOLVED), "the correction did not converge to 1 um")


def guard_turn(reasons: Reasons, limits: LimitSection, turn: Floats) -> None:
    """Mark corrections that turn the tool too far.

    Args:
        reasons: Collects the first reason of every visit.
        limits: The cell's guards.
        turn: Rotation of the commanded tool, (n, 3) [rad].
    """
    with np.errstate(invalid="ignore"):
        angle = np.rad2deg(lengths(turn))
        text = f"the correction exceeds correction_deg = {limits.correction_deg:g}"
        reasons.mark(angle > limits.correction_deg, text)


def guard_steps(
    reasons: Reasons,
    limits: LimitSection,
    correction: Floats,
    direction: Floats,
    before: Ints,
) -> None:
    """Mark jumps of the correction between neighbours of a fly run.

    A step is allowed where a joint really turns.

    Args:
        reasons: Collects the first reason of every visit.
        limits: The cell's guards.
        correction: Change of the commanded TCP, (n, 3) [m].
        direction: Arrival direction, (n, 6).
        before: The visit before within the same fly run, (n,), -1 where there is none.
    """
    inside = before >= 0
    last = np.where(inside, before, 0)
    with np.errstate(invalid="ignore"):
        step = lengths(correction - correction[last]) / MM
        jump = inside & (step > limits.step_mm)
    rows = np.flatnonzero(jump)
    turned = np.abs(direction[rows] - direction[last[rows]])
    jump[rows] = (turned < TURNED).all(axis=1)
    text = (
        f"the correction steps by more than step_mm = {limits.step_mm:g} in a fly run"
    )
    reasons.mark(jump, text)
