"""What was put on the ways of a program, for all who tell of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from postproc.arrays import Ints

Points = Mapping[int, Sequence[float]]
"""Shares of the way, ascending in (0, 1), by the visit that the move leads to."""


@dataclass(frozen=True)
class Insertions:
    """What was put on the ways of a program of n visits.

    Attributes:
        own: The visits of the program with points that the source makes, (n,).
        points: The points.
        stops: Moves whose first point is a stop, where play is taken up.
        left: Why moves that leave their path too far got none, by visit.
        cures: What helps moves that leave their path too far, by visit.
        cell_mm_s: Speed of the cell at which moves with points are judged, as the
            program sets none; 0 where it does.
        without: How far each move leaves its path without points, by visit [m].
        promises: What 95 % of each move stays within by all open hypotheses [m].
        tolerance: Asked for [m]; infinite where nobody did.
        limit_mm_s: Largest speed by the cell, at which moves with points are judged
            whose speed is not known; 0 where there are none.
        approaches: Share of the way at which targets are approached anew, by visit: to
            a stop, and on to the target.
        worst: How far each leaves its path at the most by any of them [m].
        fast_stops: Targets that are farther off than asked if links run on at the fast
            JOINT moves that reach them, and how far, by visit [m].
        unconfirmed: Moves before which play is not taken up, as no measured path
            confirms how their flanks change.
    """

    own: Ints
    tolerance: float
    points: Points = field(default_factory=dict)
    stops: Collection[int] = ()
    left: Mapping[int, str] = field(default_factory=dict)
    without: Mapping[int, float] = field(default_factory=dict)
    promises: Mapping[int, float] = field(default_factory=dict)
    approaches: Mapping[int, float] = field(default_factory=dict)
    unconfirmed: Collection[int] = ()
    cures: Mapping[int, str] = field(default_factory=dict)
    cell_mm_s: float = 0.0
    limit_mm_s: float = 0.0
    worst: Mapping[int, float] = field(default_factory=dict)
    fast_stops: Mapping[int, float] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Return the number of points."""
        return sum(map(len, self.points.values()))
