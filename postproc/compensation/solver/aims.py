"""The sides that targets are corrected for: settled in the order of the program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, few_rows, floats
from postproc.compensation.solver.inverse_model import Commands
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
        farther: Displacements of the path without those of the targets, (n, 3) [m].
        seen: States of the w watched targets after each of s sweeps, (s w, 34).
    """

    sides: Floats
    reached: Floats
    farther: Floats
    seen: Floats


NO_STATES = np.zeros((0, 34))


def next_aims(
    model: Model,
    solved: Commands,
    states: States,
    looked: Replanned,
    corrected: Bools,
    free: Bools,
    off: Bools,
    missed: Floats,
    lead: Floats = NO_STATES,
    watched: slice = slice(0, 0),
) -> NextAims:
    """Find the sides at which aim and arrival agree, target after target.

    A correction moves its target, and so the position of every joint in its play at
    this target and at later ones, by up to the width of the play. So each target is
    solved with the corrections of the targets before. If an arrival changes by more
    than its aim, several sides agree. The solution is then the one next to the target's
    own sides. For a joint that hardly moves on a path without a stop, it is the one
    next to the sides of the target before. If no solution is near, the nearest miss is
    used: a leap would have to be undone at the next target.

    Blends are computed again as their targets move, so that reversals on them are
    found. Of arcs and of JOINT moves only both ends count. The next plan of the program
    finds the difference.

    Args:
        model: The arm's error.
        solved: The commands of n visits.
        states: Their states, with tools.
        looked: Where these commands lead.
        corrected: The targets that move, (n,).
        free: Which may be corrected for other sides, (n,).
        off: .. and which are reached from others, (n,).
        missed: Distances by which the path misses places, (n, 3) [m].
        lead: `seen` of the first k visits, from the window before.
        watched: The visits whose states are returned as `seen`.
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
