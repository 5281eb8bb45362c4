"""When a correction is not trusted."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.compensation.eligibility.reasons import Reasons
from postproc.diagnostics import Code, Reason
from postproc.motion.deviation import JointDeviation
from postproc.robot.arm import Arm
from postproc.robot.cell import LimitSection
from postproc.robot.pose import MM, has_unknown, lengths

SOLVED = 1e-6  # [m] model against wanted pose
ROUNDING = 1e-9  # [rad] and [m]
UNSOLVED = Reason(
    Code.CORRECTION_UNREACHABLE, "the corrected pose is out of reach on its branch"
)
BEYOND = Reason(
    Code.CORRECTION_BEYOND_LIMIT, "the corrected pose is beyond a joint limit"
)
FLIPPED = Reason(Code.ARM_SWINGS, "the correction would flip the wrist")
NOT_CONVERGED = Reason(
    Code.CORRECTION_UNREACHABLE, "the correction did not converge to 1 um"
)


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
        reasons.mark(lost, UNSOLVED)
        over = ~arm.within_limits(solved) & ~unsolved
        reasons.mark(over, BEYOND)
        wrist = np.abs(q[:, 4]) < np.deg2rad(limits.wrist_deg)
        wrist |= np.abs(solved[:, 4]) < np.deg2rad(limits.wrist_deg)
        text = f"within {limits.wrist_deg:g} deg of the wrist singularity"
        reasons.mark(wrist, Reason(Code.SINGULAR_WRIST, text))
        flipped = np.sign(q[:, 4]) != np.sign(solved[:, 4])
        reasons.mark(flipped & ~lost, FLIPPED)


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
        too_large = Reason(Code.CORRECTION_TOO_LARGE, text)
        reasons.mark(size > limits.correction_mm, too_large)
        reasons.mark(~(residual <= SOLVED), NOT_CONVERGED)


def guard_motion(reasons: Reasons, limits: LimitSection, moved: JointDeviation) -> None:
    """Mark targets at which joints, elbow or wrist centre would swing too far.

    Args:
        reasons: Collects the first reason of every visit.
        limits: The cell's guards.
        moved: What the corrections do there, n visits.
    """
    for text, far in limit_violations(limits, moved).items():
        reasons.mark(far, Reason(Code.ARM_SWINGS, f"corrected, {text}"))


def limit_violations(limits: LimitSection, moved: JointDeviation) -> dict[str, Bools]:
    """Say what is beyond the limits, and in which of n rows, (n,) each."""
    found = {"the arm would stand on another branch": moved.branch}
    with np.errstate(invalid="ignore"):
        for j, most in enumerate(limits.joint_deg):
            text = f"axis {j + 1} would turn by more than joint_deg = {most:g}"
            found[text] = moved.joints[:, j] > np.deg2rad(most) + ROUNDING
        for what, size, name, most_mm in (
            ("elbow", moved.elbow, "elbow_mm", limits.elbow_mm),
            ("wrist centre", moved.wrist_centre, "wrist_centre_mm",
             limits.wrist_centre_mm),
        ):  # fmt: skip
            text = f"the {what} would move by more than {name} = {most_mm:g}"
            found[text] = size > most_mm * MM + ROUNDING
    return found


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
        too_large = Reason(Code.CORRECTION_TOO_LARGE, text)
        reasons.mark(angle > limits.correction_deg, too_large)
