"""Arcs whose circle hangs by a hair: their points are left alone.

A correction moves start, VIA and end of an arc by slightly different amounts. That does
no harm where they lie well apart; where they do not, the arm would run along another
circle than the program says, or along none.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.motion.path import NEAR, rounds
from postproc.motion.planner import Plan
from postproc.motion.targets import Targets
from postproc.reasons import Reasons
from postproc.robot.pose import MM

CURE = "move VIA, or use LINEAR"
LINE = f"the three points of the arc that begins here lie on one line: {CURE}"
TOO_NEAR = (
    f"two of the three points of an arc are nearer than {NEAR / MM:g} mm, so that its "
    f"circle is not sure: {CURE}"
)
STRAYS = (
    "corrected, the three points of an arc would make quite another circle: move VIA "
    "to its middle, or divide it"
)


def mark_arcs(targets: Targets, plan: Plan, reasons: Reasons) -> None:
    """Leave the points of arcs alone that make no sure circle, the start included.

    Args:
        targets: The n moves of a program.
        plan: Where they lead.
        reasons: Why visits must not be compensated; more are added.
    """
    arcs = rounds(targets, plan.tcp, plan.aside)
    near = arcs.too_near
    for rows, text in ((near, TOO_NEAR), (arcs.on_a_line & ~near, LINE)):
        reasons.mark(_among(arcs.visit[rows], len(targets)), text)


def strayed(targets: Targets, plan: Plan, shift: Floats, step: float) -> Bools:
    """Tell which targets move so that an arc at them becomes quite another one, (n,).

    It does where the path between its points moves more than twice as far as they do:
    it would then miss by more than it does without any correction.

    Args:
        targets: The n moves of a program.
        plan: Where they lead.
        shift: What the targets move by, (n, 3) [m], base frame.
        step: How much farther than its points the path may move in any case [m].
    """
    arcs = rounds(targets, plan.tcp, plan.aside)
    if len(arcs) == 0:
        return np.zeros(len(targets), dtype=bool)
    own = shift[arcs.visit]
    size = np.linalg.norm(own, axis=2).max(axis=1)
    with np.errstate(invalid="ignore"):
        far = (size > 0.0) & (arcs.strays(own) > np.maximum(size, step))
    return _among(arcs.visit[far], len(targets))


def _among(visits: Ints, n: int) -> Bools:
    """Tell which of n visits are among some, (n,)."""
    found = np.zeros(n, dtype=bool)
    found[visits] = True
    return found
