"""Why targets keep their values, even where the model can correct them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.compensation.eligibility.reasons import Reasons
from postproc.compensation.options import Options
from postproc.compensation.solver.agreement import Agreement
from postproc.compensation.solver.shifts import own_shifts
from postproc.diagnostics import Code, Reason
from postproc.language.visits import Meaning, Visits
from postproc.robot.cell import Cell


def find_taught(visits: Visits) -> Bools:
    """Tell which visits have a literal that holds a taught target, (n,)."""
    if len(visits.literals) == 0:
        return np.zeros(len(visits), dtype=bool)
    has = visits.target.literal >= 0
    return np.asarray(
        has & visits.literals.taught[np.where(has, visits.target.literal, 0)]
    )


def without_target(visits: Visits) -> Bools:
    """Tell which moves go where no target of theirs says, (n,): $HOME, RELATIVE, .."""
    none = np.array([one.code is Code.NO_TARGET for one in visits.reasons])
    named = np.isin(
        visits.target.meaning,
        (Meaning.POSE, Meaning.JOINTS, Meaning.NEAR, Meaning.PARTIAL_POSE,
         Meaning.PARTIAL_JOINTS, Meaning.UNKNOWN),
    )  # fmt: skip
    return np.asarray(~named | none[visits.reason])


def mark_unchanged(visits: Visits, reasons: Reasons, options: Options) -> Bools:
    """Mark moves without a target, taught points and shared variables, (n,)."""
    empty = without_target(visits)
    reasons.mark(empty, HOLDS_NONE)
    has = visits.target.literal >= 0
    literal = np.where(has, visits.target.literal, 0)
    if len(visits.literals) == 0:
        return empty
    held = find_taught(visits)
    reasons.mark(held, TAUGHT)
    if not (options.edit_exported or may_clone_exported(visits, options)):
        shared = has & visits.literals.shared[literal]
        reasons.mark(shared, EXPORTED)
    return np.asarray(empty | held)


def may_clone_exported(visits: Visits, options: Options) -> bool:
    """Return True if moves to points of other programs may be given clones of them."""
    return options.shared_points == "clone" and visits.dialect.runs_alone


def tell_cloning(options: Options) -> str:
    """Say what clones do for a move that needs a point of its own."""
    if options.shared_points == "clone":
        return "--shared-points clone can write none here"
    return "see --shared-points clone"


def mark_disagreement(
    visits: Visits,
    agreement: Agreement,
    stay: Mapping[Reason, Bools],
    cell: Cell,
    options: Options,
    reasons: Reasons,
) -> tuple[Bools, Bools]:
    """Mark the visits of literals whose arrivals disagree, or that must stay.

    Returns:
        The literals that agree, (m,), and the visits that would be corrected if the
        others at their literal agreed, (n,).
    """
    limit = cell.limits.conflict_mm
    has = agreement.group >= 0
    apart = agreement.find_apart(limit)
    stays = np.any([apart, *stay.values()], axis=0)
    together = agreement.usable & ~stays
    if len(together) == 0:
        return together, np.zeros(len(visits), dtype=bool)
    at = np.where(has, agreement.group, 0)
    conflict = reasons.none & has & ~together[at]
    differ = conflict & agreement.usable[at] & apart[at]
    code = Code.ARRIVALS_DIFFER
    apart_by = Reason(code, SHIFTED_APART.format(limit))
    reasons.mark(differ & own_shifts(visits), apart_by)
    text = f"its arrivals differ by more than conflict_mm = {limit:g}: "
    if differ.any():
        alone = by_one_move(visits, agreement.group, len(together))[at]
        reasons.mark(differ & alone, Reason(code, f"{text}{_ONE_MOVE}"))
    cloning = tell_cloning(options)
    text += f"give each move a point of its own ({cloning})"
    reasons.mark(differ, Reason(code, text))
    for why, literals in stay.items():
        reasons.mark(conflict & literals[at], why)
    reasons.mark(conflict, Reason(Code.DEPENDANT_WORSE, _OTHER_ARRIVAL.format(cloning)))
    return together, conflict


SHIFTED_APART = (
    "its arrivals need shifts (such as Offs) that differ by more than conflict_mm = "
    "{:g}: give each arrival a move of its own"
)
HOLDS_NONE = Reason(Code.NO_TARGET, "this move holds no target")
NOT_WRITTEN = Reason(Code.NUMBERS_NOT_OWN, "its numbers are not written in the program")
TAUGHT = Reason(Code.TAUGHT_POINT, "a taught point already contains the arm's error")
EXPORTED = Reason(
    Code.EXPORTED_VARIABLE,
    "other programs may read this variable too (see edit_exported)",
)
_OTHER_ARRIVAL = (
    "another arrival at this point cannot be corrected: give each move a point of its "
    "own ({})"
)
SEVERAL_MOVES = Reason(
    Code.SHARED_POINT, "several moves go to this point (shared_points = leave)"
)
_ONE_MOVE = (
    "one move makes them all, and --shared-points clone does not help: write it once "
    "for every way to it, or for all frames that it is made with"
)


def by_one_move(visits: Visits, group: Ints, count: int) -> Bools:
    """Tell which literals a single move of the program goes to, (count,).

    Args:
        visits: The program.
        group: Literal of every visit, (n,), -1 where it has none.
        count: How many there are.
    """
    places = np.stack([group, visits.place.file, visits.place.line])[:, group >= 0]
    own = np.unique(places, axis=1)[0]
    return np.asarray(np.bincount(own, minlength=count) == 1)
