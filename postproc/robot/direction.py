"""From which side every joint arrives: one play operator along the geometric path.

The play has the width W = 4 * play on the drive side (joint angles through the arm's
coupling matrix). With z its state and s = (q - z) / (W / 2), a joint arrives in
direction +1 where s >= 1/2, -1 where s <= -1/2, else 0. So a jitter of less than one
play flips nothing, between one and three plays after a reversal the side is not known,
and a joint at rest keeps its side. What is not known is an interval of z: all of
[q - W/2, q + W/2] before the first move, the hull over several predecessors; the side
is known where the whole interval agrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import (
    NOTHING,
    Edges,
    LastReversal,
    PlayOperator,
    PlayState,
    VisitChains,
    chains_of,
    drive_paths,
    last_reversals,
)

WIDTH_IN_PLAYS = 4.0


@dataclass(frozen=True)
class Arrivals:
    """How every joint arrives at n visits.

    Attributes:
        direction: lambda, (n, 6): +1 moving in positive controller direction, -1, or 0
            where not known.
        side: Where the joint lies in its play, (n, 6) from -1 to 1: s of above, the
            middle of what is known; 0 where nothing is.
        travel: Travel since the last reversal, (n, 6) [rad]; where the last reversal is
            not known, the travel since then that is sure. NaN where q is not known.
        past: What the joints remember at the visits, n rows.
    """

    direction: Floats
    side: Floats
    travel: Floats
    past: PlayState

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.side)

    def __getitem__(self, rows: slice) -> Arrivals:
        """Return some of them."""
        return Arrivals(
            self.direction[rows], self.side[rows], self.travel[rows], self.past[rows]
        )


_NONE = np.empty((0, 6))
UNLED = Arrivals(_NONE, _NONE, _NONE, NOTHING)


@dataclass(frozen=True)
class FlankState:
    """Where every joint lies in its play, without the travel.

    Attributes:
        side: As in `Arrivals`, (n, 6).
        play: What is known of the play's state, (n, 6) [rad].
    """

    side: Floats
    play: PlayOperator

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.side)

    def __getitem__(self, rows: slice) -> FlankState:
        """Return some of them."""
        return FlankState(self.side[rows], self.play[rows])


NO_SIDES = FlankState(_NONE, NOTHING.play)


@dataclass(frozen=True)
class Passages:
    """What passing each of e edges does to the joints' play.

    Attributes:
        first, source: As in `Edges`.
        clamps: The whole way over an edge, (e, 6) [rad].
    """

    first: Ints
    source: Ints
    clamps: PlayOperator

    def behind(self, visit: int) -> Passages:
        """Return those from a visit on, by which alone they are reached."""
        first = int(self.first[visit + 1])
        rows = slice(first, None)
        return Passages(
            _first_behind(self.first, visit), self.source[rows] - visit,
            self.clamps[rows],
        )  # fmt: skip


def in_row_order(n: int) -> tuple[Ints, Ints]:
    """Return `Edges.first` and `Edges.source` of n visits, one after the other."""
    return np.arange(n + 1), np.arange(n) - 1


def arrivals_of_rows(arm: Arm, q: Floats) -> Arrivals:
    """Infer arrivals at rows reached one after the other by straight JOINT moves.

    Args:
        arm: The arm.
        q: Joint angles in the order of the visits, (n, 6) [rad].
    """
    first, source = in_row_order(len(q))
    return arrivals(arm, q, Edges(first, source, q, first))


def arrivals(arm: Arm, q: Floats, edges: Edges, lead: Arrivals = UNLED) -> Arrivals:
    """Run the play operator over a graph of visits.

    Args:
        arm: The arm; its play and coupling are used.
        q: Joint angles at the visits, (n, 6) [rad], NaN where not known.
        edges: The geometric paths between them.
        lead: What is known of the first k visits beforehand. By the last one of them
            alone what follows is reached.
    """
    if len(lead) == 0:
        return _arrivals(arm, q, edges, NOTHING)
    last = len(lead) - 1
    after = _arrivals(arm, q[last:], _behind(edges, last), lead.past[last:])
    return _one_after_another(lead[:last], after)


def _one_after_another(a: Arrivals, b: Arrivals) -> Arrivals:
    """Join the arrivals at some visits and at those behind."""
    play, turned = (a.past.play, b.past.play), (a.past.turned, b.past.turned)
    return Arrivals(
        np.concatenate([a.direction, b.direction]),
        np.concatenate([a.side, b.side]),
        np.concatenate([a.travel, b.travel]),
        PlayState(
            PlayOperator(*(np.concatenate([getattr(x, k) for x in play])
                     for k in ("lo", "hi"))),
            LastReversal(*(np.concatenate([getattr(x, k) for x in turned])
                           for k in ("side", "angle", "z"))),
        ),
    )  # fmt: skip


def _first_behind(first: Ints, visit: int) -> Ints:
    """Give `Edges.first` of the visits from one on, to which no edge leads."""
    return np.append(0, first[visit + 1 :] - first[visit + 1])


def _behind(edges: Edges, visit: int) -> Edges:
    """Return the edges from a visit on, by which alone they are reached."""
    e = int(edges.first[visit + 1])
    s = int(edges.start[e])
    return Edges(
        _first_behind(edges.first, visit), edges.source[e:] - visit, edges.path[s:],
        edges.start[e:] - s, edges.uneven[edges.uneven >= s] - s,
    )  # fmt: skip


def _arrivals(arm: Arm, q: Floats, edges: Edges, before: PlayState) -> Arrivals:
    """Do as `arrivals`, knowing what the joints remember at the first visit."""
    if len(q) == 0:
        return UNLED
    chains = chains_of(q, arm.coupling, edges.first, edges.source)
    ways, half = drive_paths(chains, arm.coupling, edges), half_width(arm)
    z = _states(chains, ways.clamps(half), half, before.play)
    forward = chains.angles - z.hi >= half / 2
    backward = chains.angles - z.lo <= -half / 2
    direction = forward.astype(float) - backward.astype(float)
    turned = last_reversals(chains, ways, arm.play, before.turned)
    travel = np.abs(chains.angles - turned.angle)
    past = PlayState(z, turned)
    return Arrivals(direction, _side(chains.angles, z, half), travel, past)


def passages(arm: Arm, q: Floats, edges: Edges) -> Passages:
    """Find what passing the edges does to the joints' play.

    Args:
        arm: The arm; its play and coupling are used.
        q: Joint angles at the visits, (n, 6) [rad], NaN where not known.
        edges: The geometric paths between them.
    """
    chains = chains_of(q, arm.coupling, edges.first, edges.source)
    ways = drive_paths(chains, arm.coupling, edges)
    return Passages(edges.first, edges.source, ways.clamps(half_width(arm)))


def sides(
    arm: Arm, q: Floats, passed: Passages, lead: FlankState = NO_SIDES
) -> FlankState:
    """Return the sides of `arrivals` alone, from what passing the edges does."""
    if len(lead) == 0:
        return _sides(arm, q, passed, NOTHING.play)
    last = len(lead) - 1
    after = _sides(arm, q[last:], passed.behind(last), lead.play[last:])
    lo, hi = (
        np.concatenate([getattr(part.play, k) for part in (lead[:last], after)])
        for k in ("lo", "hi")
    )
    return FlankState(
        np.concatenate([lead.side[:last], after.side]), PlayOperator(lo, hi)
    )


def _sides(arm: Arm, q: Floats, passed: Passages, before: PlayOperator) -> FlankState:
    """Do as `sides`, knowing the state of the play at the first visit."""
    if len(q) == 0:
        return NO_SIDES
    chains = chains_of(q, arm.coupling, passed.first, passed.source)
    half = half_width(arm)
    z = _states(chains, passed.clamps, half, before)
    return FlankState(_side(chains.angles, z, half), z)


def sides_along(
    arm: Arm, q: Floats, begins: Bools, play: PlayOperator, half: Floats
) -> tuple[Floats, Floats]:
    """Place every joint in its play along some ways, however wide it is there.

    A play of another width at every place is one of the width 2 for u, the integral
    of dq / h, with h half of the width.

    Args:
        arm: The arm; its play and coupling are used.
        q: Samples of the ways, one after the other, (s, 6) [rad]; the first one of each
            is where it begins.
        begins: The first samples, (s,).
        play: What is known of the play's state there, one row each, (k, 6) [rad].
        half: Half of the width of the play on the drive side at the samples, (s, 6).

    Returns:
        The least and the largest side that it may be, (s, 6) each from -1 to 1; equal
        where the side is known.
    """
    angles, own = q @ arm.coupling.T, half_width(arm)
    lo, hi = ((z - angles[begins]) / own for z in (play.lo, play.hi))
    return _native.sides_along(angles, half, begins, PlayOperator(lo, hi))


def half_width(arm: Arm) -> Floats:
    """Return half the width of every joint's play on the drive side, (6,) [rad]."""
    return np.asarray(WIDTH_IN_PLAYS / 2 * arm.play)


def _side(angles: Floats, z: PlayOperator, half: Floats) -> Floats:
    """Place every joint in its play, (n, 6)."""
    return _native.side(angles, z, half)


def _states(
    chains: VisitChains, own: PlayOperator, half: Floats, before: PlayOperator
) -> PlayOperator:
    """Find what is known of the play's state at every visit, as intervals (n, 6).

    The intervals at the heads only grow and their ends come from a finite set, so that
    the work list runs dry.

    Args:
        chains: The visits.
        own: The clamps of each edge alone, (e, 6).
        half: Half of the width of the play, (6,) [rad].
        before: What is known at the first visit.
    """
    return PlayOperator(*_native.states(chains, own, half, before))
