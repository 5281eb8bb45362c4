"""Arcs that their points hardly determine are not corrected."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.compensation.eligibility.reasons import Reasons, mark_rows
from postproc.diagnostics import Code, Reason
from postproc.motion.path import NEAR, arcs_of
from postproc.motion.planner import Plan
from postproc.motion.targets import Targets
from postproc.robot.pose import MM

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
        reasons.mark(mark_rows(len(targets), arcs.visit[rows]), reason)


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
    return mark_rows(len(targets), arcs.visit[far])
