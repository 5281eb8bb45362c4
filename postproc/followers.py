"""Targets that the program computes from others: they move along with them."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.visits import Target, Visits
from postproc.reconcile import Agreement


def followers(visits: Visits, agreement: Agreement) -> tuple[Ints, Ints]:
    """Find the visits that move along with a literal, and its row in the agreement."""
    rows = np.flatnonzero(visits.follows >= 0)
    return rows, np.searchsorted(agreement.literal, visits.follows[rows])


def worsened(
    visits: Visits,
    agreement: Agreement,
    change_mm: Floats,
    trusted: Bools,
    agree_mm: float,
) -> Bools:
    """Tell which literals would carry a computed target farther off, (m,).

    A target such as ``POS_SHIFT(p, ..)`` or ``NEAR p BY d`` needs a change of its own
    and gets that of ``p``. What it is then off must be no more than what it is off now.
    ``FOR d TO p`` only takes its direction from ``p``: it is a part of the way there.

    Args:
        visits: n arrivals.
        agreement: What the m literals would change by.
        change_mm: The change that every visit needs, (n, 3) [mm].
        trusted: The model can say what a visit needs, (n,).
        agree_mm: Changes that differ less are the same.
    """
    rows, at = followers(visits, agreement)
    whole = visits.target[rows] != Target.FOR
    rows, at = rows[whole], at[whole]
    needed = change_mm[rows]
    left = np.linalg.norm(agreement.change_mm[at] - needed, axis=1)
    allowed = np.maximum(np.linalg.norm(needed, axis=1), agree_mm)
    worse = ~(trusted[rows] & (left <= allowed))
    found = np.zeros(len(agreement.literal), dtype=bool)
    found[at[worse]] = True
    return found


def carry_along(
    visits: Visits, agreement: Agreement, chosen: Bools, values: Floats
) -> None:
    """Move the computed targets along with the literals that change, in place.

    Args:
        visits: n arrivals.
        agreement: What the m literals change by.
        chosen: Literals that do change, (m,).
        values: Numbers of every visit, (n, 6).
    """
    rows, at = followers(visits, agreement)
    rows, at = rows[chosen[at]], at[chosen[at]]
    if len(rows) == 0:
        return
    direct = np.flatnonzero(visits.literal >= 0)
    written = np.zeros((len(visits.literals), 6))
    written[visits.literal[direct]] = visits.values[direct]
    values[rows] += agreement.values[at] - written[agreement.literal[at]]
