"""Why targets stay where they are, whatever the model says of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.followers import worsened
from postproc.language.visits import NO_TARGET, Target, Visits
from postproc.options import Options
from postproc.planning import Planned
from postproc.reasons import Reasons
from postproc.reconcile import Agreement
from postproc.robot.cell import Cell


def must_stay(
    visits: Visits, agreement: Agreement, change: Floats, trusted: Bools, cell: Cell
) -> dict[str, Bools]:
    """Find literals that must keep their values for what else depends on them.

    Returns:
        The reasons, and which of the m literals of the agreement have each, (m,).
    """
    hurt = worsened(visits, agreement, change, trusted, cell.limits.agree_mm)
    found = {f"{why}: give the move a point of its own (see --clone)": rows
             for why, pins in visits.literals.pins.items()
             if (rows := np.isin(agreement.literal, pins)).any()}  # fmt: skip
    text = "a target computed from it would land farther off (see --clone)"
    return found | {text: hurt}


def mark_display(visits: Visits, planned: Planned, reasons: Reasons) -> Bools:
    """Mark targets whose value is known only at run time, (n,)."""
    holds = ~without_target(visits)
    display = holds & ((visits.reason > 0) | (visits.literal < 0))
    reasons.adopt(visits.reason, visits.reasons)
    reasons.mark(display, "its numbers are not written in the program")
    return display


def without_target(visits: Visits) -> Bools:
    """Tell which moves go where no target of theirs says, (n,): $HOME, RELATIVE, .."""
    none = np.array([text.startswith(NO_TARGET) for text in visits.reasons])
    named = np.isin(
        visits.target, (Target.POSE, Target.JOINTS, Target.NEAR, Target.UNKNOWN)
    )
    return np.asarray(~named | none[visits.reason])


def mark_unchanged(visits: Visits, reasons: Reasons, options: Options) -> Bools:
    """Mark moves without a target, taught points and shared variables, (n,)."""
    empty = without_target(visits)
    reasons.mark(empty, "this move holds no target")
    has = visits.literal >= 0
    literal = np.where(has, visits.literal, 0)
    if len(visits.literals) == 0:
        return empty
    taught = has & visits.literals.taught[literal]
    reasons.mark(taught, "a taught point already contains the arm's error")
    if not options.shared:
        shared = has & visits.literals.shared[literal]
        reasons.mark(shared, "other programs may read this variable too (see --shared)")
    return np.asarray(empty | taught)


def mark_disagreement(
    visits: Visits,
    agreement: Agreement,
    stay: Mapping[str, Bools],
    cell: Cell,
    reasons: Reasons,
) -> tuple[Bools, Bools]:
    """Mark the visits of literals whose arrivals disagree, or that must stay.

    Returns:
        The literals that agree, (m,), and the visits that would be corrected if the
        others at their literal agreed, (n,).
    """
    limit = cell.limits.agree_mm
    has = agreement.group >= 0
    apart = ~(agreement.spread_mm <= limit)
    stays = np.any([apart, *stay.values()], axis=0)
    together = agreement.usable & ~stays
    if len(together) == 0:
        return together, np.zeros(len(visits), dtype=bool)
    at = np.where(has, agreement.group, 0)
    unsafe = reasons.none & has & ~together[at]
    text = (
        f"its arrivals differ by more than agree_mm = {limit:g}: give each move a "
        "point of its own (see --clone)"
    )
    reasons.mark(unsafe & agreement.usable[at] & apart[at], text)
    for why, literals in stay.items():
        reasons.mark(unsafe & literals[at], why)
    reasons.mark(unsafe, "another arrival at the same point cannot be corrected")
    return together, unsafe
