"""Where a program's paths lie if one joint changes its flank otherwise.

Every open hypothesis of every joint is a case. The error of the arm is linear in the
side on which a link lies in its gap: a case moves the path by the difference of the
sides times what the TCP moves as that joint goes from the middle to its upper flank.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, zip_longest

import numpy as np

from postproc.arrays import Floats, Ints, any_in_rows
from postproc.compensation.paths.path_states import CHANGED, AlongWays, ErrorAlong
from postproc.model.flank_hypotheses import (
    ANOTHER,
    WEIGHS_OTHER,
    FlankKind,
    FlankOfJoint,
    flanks_of,
    nominal_widths,
)
from postproc.robot.pose import lengths

LATE = 0.01  # [m] of the way by which a flank changes later
AT_ONCE = 0.02  # gaps over which a flank goes that changes as its drive turns back
MOVED = 1e-6  # [m] of the TCP: less makes no difference
UNSURE = 1e-3  # of half the play: a side that is known


_WIDE = FlankKind.SHARP, FlankKind.ELASTIC, FlankKind.EARLIER
"""Hypotheses that say over how many gaps a joint goes."""

_TOGETHER = FlankKind.PUSHED, FlankKind.RAN_ON
"""Hypotheses that have one cause in all joints, and are tried for all together too."""

Key = tuple[int, FlankKind, int]
"""A joint (from 1), what it does, and which of its cases of that kind it is.

The same case has the same key in all predictions, whichever cases make a difference.
"""

OF_ALL = -1
"""Number of the case of all joints, in the key of the first of these."""


@dataclass(frozen=True)
class FlankCase:
    """What one hypothesis of one joint makes of the paths.

    Attributes:
        key: Which it is.
        weight: Of the hypothesis; 1 where a flank is not known.
        rows: The samples at which it makes a difference, (k,), ascending.
        across: Distance from the path there, (k,) [m].
        by: From where the TCP is predicted there to where it is, (k, 3) [m].
    """

    key: Key
    weight: float
    rows: Ints
    across: Floats
    by: Floats


@dataclass(frozen=True, eq=False)
class FlankCases:
    """The cases of a program's paths, s samples in all.

    Attributes:
        run: The compensated program.
        error: The arm's error.
        off: From the paths to the TCP as predicted, (s, 3) [m].
        tangent: Directions of the paths, (s, 3).
        way: Path length since the move began, (s,) [m].
        first: Samples of move k are first[k] .. first[k + 1] - 1.
    """

    run: AlongWays
    error: ErrorAlong
    off: Floats
    tangent: Floats
    way: Floats
    first: Ints

    @cached_property
    def cases(self) -> tuple[FlankCase, ...]:
        """Return the cases that make any difference."""
        found = list[FlankCase]()
        together = {kind: np.zeros_like(self.off) for kind in _TOGETHER}
        open_ = self.open_sides()
        for joint in range(len(self._flanks)):
            sides = [*open_.of(joint)]
            usual = open_.usual[:, joint]
            rows = [np.flatnonzero(np.abs(own - usual) > CHANGED)
                    for _, _, own in sides]  # fmt: skip
            every = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *rows]))
            moves = np.empty((len(self.off), 3))
            moves[every] = self._moves_of(joint, every)
            number = Counter[FlankKind]()
            for (kind, weight, own), at in zip(sides, rows, strict=True):
                key = joint + 1, kind, number[kind]
                number[kind] += 1
                by = (own[at] - usual[at])[:, None] * moves[at]
                if len(at):
                    found.append(self._case(key, weight, at, by))
                if kind in together:
                    together[kind][at] += by
        all_of = (self._all_of(kind, by) for kind, by in together.items())
        return (*found, *chain.from_iterable(all_of), *self._of_friction())

    def _of_friction(self) -> Iterator[FlankCase]:
        """Yield the cases of gears that friction holds against other weights."""
        kinds = (FlankKind.HELD, ANOTHER), (FlankKind.WEIGHED, 1.0 / ANOTHER)
        others = [
            (kind, *own) for kind, factor in kinds for own in self.error.hold(factor)
        ]
        every, side = np.arange(len(self.off)), self.run.side
        usual = self.error(self.run, every, side) if others else self.off
        for kind, joint, error in others:
            by = error(self.run, every, side) - usual
            at = np.flatnonzero(lengths(by) > MOVED)
            if len(at):
                yield self._case((joint, kind, 0), WEIGHS_OTHER, at, by[at])

    def open_sides(self) -> OpenSides:
        """Return the sides of joints by open hypotheses; they take some memory."""
        return OpenSides(self.run, self.error, self._flanks, self.way, self.first)

    def _case(self, key: Key, weight: float, at: Ints, by: Floats) -> FlankCase:
        """Move the TCP by some way (k, 3) at samples (k,)."""
        there = self.off[at] + by
        along = np.einsum("si,si->s", there, self.tangent[at])
        across = lengths(there - along[:, None] * self.tangent[at])
        return FlankCase(key, weight, at, across, by)

    def _all_of(self, kind: FlankKind, by: Floats) -> Iterator[FlankCase]:
        """Yield the case of all links that run on at stops; they have one cause.

        It counts as one of the first of these joints.

        Args:
            kind: What they do on the way.
            by: What it moves the TCP by, (s, 3) [m].
        """
        open_ = [j for j, flank in enumerate(self._flanks, 1) if flank.is_open(kind)]
        at = np.flatnonzero(by.any(axis=1))
        if len(open_) > 1 and len(at):
            weight = max(self._flanks[j - 1].weight[kind] for j in open_)
            yield self._case((open_[0], kind, OF_ALL), weight, at, by[at])

    @property
    def by_key(self) -> dict[Key, FlankCase]:
        """Return the cases by their keys."""
        return {case.key: case for case in self.cases}

    @property
    def usually(self) -> Floats:
        """Return the weight of what is predicted of every joint, (6,)."""
        return np.array([flank.usually for flank in self._flanks])

    @cached_property
    def _flanks(self) -> tuple[FlankOfJoint, ...]:
        return flanks_of(self.error.model, self.error.cell.arm)

    def predict(self, rows: Ints, side: Floats) -> Floats:
        """Predict the error at samples (k,) with joints on other sides, (k, 3) [m]."""
        return self.error(self.run, rows, side)

    def off_with(self, side: Floats) -> Floats:
        """Return from the paths to the TCP with sharp joints on other sides, (s, 3).

        Args:
            side: Of all joints, (s, 6).
        """
        usual, sharp = self.run.side, nominal_widths(self._flanks) == 1.0
        there = np.where(sharp, side, usual)
        rows = np.flatnonzero(any_in_rows(np.abs(there - usual) > CHANGED))
        off = np.array(self.off)
        off[rows] += self.predict(rows, there[rows]) - self.predict(rows, usual[rows])
        return off

    def spread(self, rows: Ints) -> Floats:
        """Return the covariance of what no effect describes, see `ErrorAlong`."""
        return self.error.spread(self.run, rows)

    def _moves_of(self, joint: int, rows: Ints) -> Floats:
        """Return what the TCP moves from the middle to the upper flank, (k, 3) [m]."""
        ends = np.array([self.run.side[rows]] * 2)
        ends[0, :, joint], ends[1, :, joint] = -1.0, 1.0
        low, high = (self.error(self.run, rows, side) for side in ends)
        return np.asarray((high - low) / 2)


@dataclass(frozen=True, eq=False)
class OpenSides:
    """Where joints lie in their plays along ways by the hypotheses that are open.

    Attributes:
        run, error, way, first: As in `FlankCases`.
        flanks: What is known of joints 1 to 6.
    """

    run: AlongWays
    error: ErrorAlong
    flanks: tuple[FlankOfJoint, ...]
    way: Floats
    first: Ints

    def of(self, joint: int) -> Iterator[tuple[FlankKind, float, Floats]]:
        """Yield the sides (s,) of a joint (from 0), hypotheses, and their weights."""
        flank, usual = self.flanks[joint], self.usual[:, joint]
        for kind in flank.open_kinds:
            weight = flank.weight[kind]
            if kind in _WIDE:
                for width in _widths_of(flank, kind):
                    yield kind, weight, self._over(joint, width)
            elif kind is FlankKind.LATER:
                yield kind, weight, usual[self._behind]
            elif kind is FlankKind.PUSHED:
                yield kind, weight, -usual
            else:
                yield kind, weight, usual[self.first[:-1]][self._move]
        if flank.is_open(FlankKind.RAN_ON):
            kind = FlankKind.RAN_ON
            yield kind, flank.weight[kind], self._ran_on[:, joint]
        least, most = self.run.least[:, joint], self.run.most[:, joint]
        if (most - least > UNSURE).any():
            yield FlankKind.START, 1.0, least
            yield FlankKind.START, 1.0, most

    def _over(self, joint: int, width: float) -> Floats:
        """Return the sides of a joint (from 0) if it goes over so many gaps, (s,)."""
        return self._all_over[self._widths[joint].index(width)][:, joint]

    @cached_property
    def usual(self) -> Floats:
        """The sides as predicted, (s, 6), joint by joint in memory as all here."""
        return np.asfortranarray(self.run.side)

    @cached_property
    def _widths(self) -> list[list[float]]:
        """List the gaps that the hypotheses of each joint let it go over."""
        found = []
        for flank in self.flanks:
            kinds = [kind for kind in flank.open_kinds if kind in _WIDE]
            found.append([width for kind in kinds for width in _widths_of(flank, kind)])
        return found

    @cached_property
    def _all_over(self) -> list[Floats]:
        """The sides of all joints, each over the k-th of its gaps, (s, 6) each."""
        columns = zip_longest(*self._widths, fillvalue=1.0)
        found = (self.run.over(self.error.cell, np.array(width)) for width in columns)
        return [np.asfortranarray(one.side) for one in found]

    @cached_property
    def _ran_on(self) -> Floats:
        """The sides of all joints whose links ran on at fast stops, (s, 6)."""
        sides = self.run.run_on(self.error.cell, nominal_widths(self.flanks))
        return np.asfortranarray(sides)

    @cached_property
    def _move(self) -> Ints:
        """The move that every sample belongs to, (s,)."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @cached_property
    def _behind(self) -> Ints:
        """The sample `LATE` behind every sample on its move, (s,)."""
        apart = float(self.way.max(initial=0.0)) + 2 * LATE
        there = self.way + apart * self._move
        back = np.searchsorted(there, there - LATE, side="right") - 1
        return np.maximum(back, self.first[:-1][self._move])


def _widths_of(flank: FlankOfJoint, kind: FlankKind) -> tuple[float, ...]:
    """Return the gaps that a joint may go over by a hypothesis of `_WIDE`."""
    if kind is FlankKind.SHARP:
        return (1.0,)
    if kind is FlankKind.EARLIER:
        return (AT_ONCE,)
    least, most = flank.widths
    return (most,) if flank.nominal == 1.0 or least == most else (least, most)
