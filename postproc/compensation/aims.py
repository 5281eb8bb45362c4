"""The sides that targets are corrected for: settled in the order of the program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, few_rows, floats
from postproc.compensation.inverse_model import Commands
from postproc.model.model import Model
from postproc.motion.replan import Replanned
from postproc.robot.backlash_operator import PlayOperator, chains_of
from postproc.robot.direction import half_width
from postproc.robot.state import States


@dataclass(frozen=True)
class Ways:
    """The ways to n visits, on the drive side, as the core takes them.

    Attributes:
        angles: At the visits, (n, 6) [rad].
        first, source, clamps: See `Passages`.
        play: What is known of the play's state at the visits, (n, 6) [rad].
        half: Half of the width of the play, (6,) [rad].
        side: Where the joints lie in it, (n, 6).
        targets: The same angles at the targets themselves, (n, 6) [rad].
        places: Where these are, (n, 3) [m].
        rounded: Their corners, (n, 7), see `BlendCoupling`.
        corrected: The targets that may move, (n,).
    """

    angles: Floats
    first: Ints
    source: Ints
    clamps: PlayOperator
    play: PlayOperator
    half: Floats
    side: Floats
    targets: Floats
    places: Floats
    rounded: Floats
    corrected: Bools

    @classmethod
    def of(cls, looked: Replanned, corrected: Bools) -> Ways:
        """Take the ways of a look."""
        arm, passed = looked.arm, looked.passages
        chains = chains_of(looked.passed, arm.coupling, passed.first, passed.source)
        return cls(
            floats(chains.angles), chains.first, chains.source, passed.clamps,
            looked.sides.play, half_width(arm), floats(looked.side),
            floats(looked.exact.q @ arm.coupling.T), floats(looked.places),
            looked.rounded, corrected,
        )  # fmt: skip


@dataclass(frozen=True)
class NextAims:
    """What n targets are to be corrected for next.

    Attributes:
        sides: The sides, (n, 6).
        reached: Those that they are reached from then, (n, 6): the same, but where none
            agree.
        farther: By what the path then passes them farther than they move, (n, 3) [m].
        seen: What became of those that are watched, sweep by sweep, (s w, 34).
    """

    sides: Floats
    reached: Floats
    farther: Floats
    seen: Floats


UNLED_AIMS = np.zeros((0, 34))


def next_aims(
    model: Model,
    solved: Commands,
    states: States,
    looked: Replanned,
    corrected: Bools,
    free: Bools,
    off: Bools,
    missed: Floats,
    lead: Floats = UNLED_AIMS,
    watched: slice = slice(0, 0),
) -> NextAims:
    """Find the sides at which aim and arrival agree, target after target.

    A correction moves its target, and so the place of every joint in its play there and
    behind: by as much as the play is wide. A target is settled with what the ones
    before it have become. Where the arrival answers the aim by more than the aim
    changes, several sides agree: taken are those next to its own, and of joints that
    hardly move on a way without a stop next to those of the target before. If none is
    near there, the nearest miss is taken, not a leap that the next target would have to
    take back.

    Corners are rounded anew as their targets move, so that a joint that turns back on
    one is found where it will. Of curved ways and of moves of joints only both ends
    count: what that misses, a further look at the program finds.

    Args:
        model: The arm's error.
        solved: The commands of n visits.
        states: Their states, with tools.
        looked: Where these commands lead.
        corrected: The targets that move, (n,).
        free: Which may be corrected for other sides, (n,).
        off: .. and which are reached from others, (n,).
        missed: By what the path misses places, and is to be bent, (n, 3) [m].
        lead: What was `seen` of the first k of them, where they were settled before.
        watched: Those of which that is to be seen.
    """
    arm, evaluator = looked.arm, model.evaluator(looked.arm)
    ways = Ways.of(looked, corrected)
    here = states.with_(q=solved.q, direction=solved.direction)
    fly = np.ascontiguousarray(looked.targets.fly)
    poses = floats(solved.command), floats(few_rows(looked.targets.tool))
    found = _native.next_aims(
        evaluator.core, arm.solver, *poses, evaluator.states(here), ways,
        floats(arm.coupling), free, off, fly, floats(missed), lead,
        (watched.start, watched.stop),
    )  # fmt: skip
    return NextAims(*found)
