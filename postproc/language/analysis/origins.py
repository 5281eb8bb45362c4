"""Where the arm may come from at a place of a program, on every way there."""

from __future__ import annotations

from collections.abc import Sequence

from postproc.arrays import Indices
from postproc.language.visits import ELSEWHERE

Origins = frozenset[int]
"""Visits, by number; START, ELSEWHERE, or MANY."""

MANY = -3  # one of so many visits that they are not distinguished
MOST_ORIGINS = 500
NOWHERE = frozenset([ELSEWHERE])
TOLD_TOGETHER = (
    f"more than {MOST_ORIGINS} moves may come before this one: they are not followed "
    "separately, and the approach direction is not known"
)


def join_origins(mine: Origins, theirs: Origins, lost: set[int]) -> Origins:
    """Return where the arm may come from on either way; the first set if that is all.

    The sizes of all sets of a program together stay linear in the program. Behind
    visits that are not distinguished, the arm may go anywhere.

    Args:
        mine: The origins on one way.
        theirs: .. and on the other.
        lost: Visits behind which the arm may go anywhere: takes in such visits.

    >>> lost = set()
    >>> sorted(join_origins(frozenset([1]), frozenset([2]), lost)), lost
    ([1, 2], set())
    >>> [*join_origins(frozenset(range(500)), frozenset([500]), lost)], len(lost)
    ([-3], 501)
    """
    if theirs <= mine:
        return mine
    both = mine | theirs
    if MANY not in both and len(both) <= MOST_ORIGINS:
        return both
    lost |= theirs if MANY in mine else both
    return mine if MANY in mine else frozenset([MANY])


def number_origins(origins: Origins, visit: Sequence[int] | Indices) -> list[int]:
    """Return the places of origins among all visits, ascending.

    Args:
        origins: The origins; those not distinguished are ELSEWHERE.
        visit: The place of each visit.
    """
    if MANY in origins:
        origins = (origins - {MANY}) | NOWHERE
    return sorted([int(visit[k]) if k >= 0 else k for k in origins])
