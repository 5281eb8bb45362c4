"""Where moved targets lead the arm: joint angles and sides, without a time law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.motion.rounding import rounded
from postproc.motion.standing import NOWHERE, Standing
from postproc.motion.targets import Targets
from postproc.motion.trace import Trace, trace
from postproc.robot.arm import Arm
from postproc.robot.direction import Passages, Sides, passages, sides
from postproc.robot.play import NOTHING, Past


@dataclass(frozen=True)
class Reached:
    """Where n arrivals end up.

    Attributes:
        q: Joint angles, (n, 6) [rad], NaN where not known; as in `Plan`.
        tcp: TCP pose, (n, 4, 4) [m], base frame, NaN where not known; as in `Plan`.
        aside: From the target to that place, (n, 3) [m].
        side: Where every joint lies in its play, (n, 6) from -1 to 1; 0: not known.
    """

    q: Floats
    tcp: Floats
    aside: Floats
    side: Floats


@dataclass(frozen=True)
class Points:
    """The n targets themselves.

    Attributes:
        q: Joint angles, (n, 6) [rad], NaN where not known.
        flange: (n, 4, 4) [m], NaN where not known.
    """

    q: Floats
    flange: Floats


@dataclass(frozen=True)
class Course:
    """The way through n targets, with what it takes to look at parts of it again.

    Attributes:
        arm: The arm.
        targets: The moves.
        exact: At the targets, as if the arm stopped at each.
        passed: Joint angles where the path, its corners rounded, passes them, (n, 6)
            [rad], NaN where not known.
        aside: From the targets to there, (n, 3) [m].
        slot: Branch taken, (n,), -1 where it was not looked up.
        passages: What the rounded paths between do to the joints' play.
        sides: On which sides the joints arrive.
        begin: Where the arm stands at the first target, if that is known beforehand.
    """

    arm: Arm
    targets: Targets
    exact: Points
    passed: Floats
    aside: Floats
    slot: Ints
    passages: Passages
    sides: Sides
    begin: Standing = NOWHERE

    @property
    def side(self) -> Floats:
        """Return where every joint lies in its play, as in `Reached`."""
        return self.sides.side

    @property
    def end(self) -> Standing:
        """Return where the arm stands at the last target; reversals are not kept."""
        past = Past(self.sides.play, NOTHING.turned)
        return Standing.at_end(self.exact.q, self.exact.flange, self.slot, past)

    @property
    def reached(self) -> Reached:
        """Return where the arrivals end up."""
        flange = where_passed(self.arm, self.exact, self.passed)
        tcp = flange @ self.targets.tool
        return Reached(self.passed, tcp, self.aside, self.side)


def reach(arm: Arm, targets: Targets, begin: Standing = NOWHERE) -> Course:
    """Find joint angles and sides only.

    For targets that a correction has moved: their speeds are those of the plan.

    Args:
        arm: The arm.
        targets: The moves.
        begin: Where the arm stands at the first target, if that is known beforehand.

    Raises:
        PlanError: The arm has no closed-form inverse kinematics.
    """
    exact = trace(arm, targets, begin.known)
    traced = rounded(arm, targets, exact, timed=False)
    ways = passages(arm, traced.q, traced.edges)
    found = sides(arm, traced.q, ways, begin.past.play)
    return Course(
        arm, targets, points(exact), traced.q, traced.aside, exact.slot, ways, found,
        begin,
    )  # fmt: skip


def points(traced: Trace) -> Points:
    """Return the targets of a trace."""
    return Points(traced.q, traced.flange)


def where_passed(arm: Arm, exact: Points, q: Floats) -> Floats:
    """Place the flange where the path passes targets, (n, 4, 4) [m].

    Args:
        arm: The arm.
        exact: At the targets themselves.
        q: Joint angles where the path passes them, (n, 6) [rad].
    """
    flange = np.array(exact.flange)
    beside = np.flatnonzero((q != exact.q).any(axis=1) & ~np.isnan(q).any(axis=1))
    flange[beside] = arm.flange(q[beside])
    return flange
