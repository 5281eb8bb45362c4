"""What the targets of a window are corrected for, from round to round."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.clock import Clock
from postproc.model.model import Model
from postproc.motion.planner import Plan
from postproc.options import Options
from postproc.planning import Planned, Reading
from postproc.proposal import Proposal, propose
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.side_search import SideSearch
from postproc.solved import Solved, solve_again, solve_visits

CLOSE = 5e-6  # [m] how well rounded fly points are hit


@dataclass(frozen=True)
class Aim:
    """What n targets are corrected for in a round.

    Attributes:
        solved: The commands.
        bent: What rounded points are moved by beyond what is foretold, (n, 3) [m].
        held: Targets that keep their values, (n,).
        settled: Targets whose sides changed till the last round, and may, (n,).
    """

    solved: Solved
    bent: Floats
    held: Bools
    settled: Bools

    def turned(self, proposal: Proposal, side: Floats, most: float) -> Bools:
        """Tell which corrected targets are reached from other sides than these, (n,).

        Args:
            proposal: Tells which are corrected.
            side: From where they are reached, (n, 6).
            most: How far that may be off.
        """
        off = np.abs(side - self.solved.direction)
        far = np.zeros(len(off), dtype=bool)
        rows = np.unique(np.flatnonzero(off > most) // off.shape[1])  # few
        far[rows] = off[rows].max(axis=1) > most  # NaN is not far
        return np.asarray(proposal.corrected & ~self.settled & far)


@dataclass(frozen=True)
class Aiming:
    """What does not change from round to round.

    Attributes:
        reading: The visits.
        planned, states: Their plan.
        cell, model, options, clock: As everywhere.
        given: What the first targets move by, for they are others' last, (k, 3) [m].
    """

    reading: Reading
    planned: Planned
    states: States
    cell: Cell
    model: Model
    options: Options
    clock: Clock
    given: Floats

    def first_aim(self) -> Aim:
        """Correct for the sides that were planned."""
        orientation = self.options.orientation
        with self.clock("solve"):
            solved = solve_visits(
                self.model, self.cell, self.planned, self.states, orientation
            )
        none = np.zeros(len(self.states), dtype=bool)
        return Aim(solved, np.zeros_like(self.planned.plan.aside), none, none)

    def next_aim(
        self, aim: Aim, moved: Bools, found: Floats, search: SideSearch
    ) -> Aim:
        """Correct some targets for other sides, by those that were found."""
        orientation = self.options.orientation
        with self.clock("solve"):
            sides = search.next_aim(aim.solved.direction, found)
            states = self.states.with_(direction=sides)
            solved = solve_again(
                aim.solved, moved, self.model, self.cell, self.planned, states,
                orientation,
            )  # fmt: skip
        return replace(aim, solved=solved)

    def propose(self, aim: Aim) -> tuple[Proposal, Floats]:
        """Decide on numbers; return too where the path is to pass its targets."""
        with self.clock("decide"):
            plan = self.planned.plan
            aside = aside_after(plan, self.wanted(aim)) + aim.bent
            proposal = propose(
                self.reading, self.planned, aim.solved, aside, aim.held, self.cell,
                self.options,
            )  # fmt: skip
        return proposal, aside

    def wanted(self, aim: Aim) -> Floats:
        """Say what the path should move by at every target, (n, 3) [m]."""
        before = self.planned.plan.tcp[:, :3, 3]
        wanted = np.nan_to_num(aim.solved.command[:, :3, 3] - before)
        wanted[aim.held] = 0.0
        wanted[: len(self.given)] = self.given
        return wanted

    def missed(self, proposal: Proposal, aside: Floats, meant: Floats) -> Floats:
        """Say by what programs with a point that is not hit miss theirs, (n, 3) [m].

        Args:
            proposal: Tells which targets can make up for it.
            aside: From targets to where the path passes them, (n, 3) [m].
            meant: .. to where it should.
        """
        missed, sharp = np.zeros_like(aside), self.planned.plan.pull.visit
        missed[sharp] = (aside - meant)[sharp]
        missed[~proposal.corrected] = 0.0
        for first, end in pairwise((*self.reading.begins, len(missed))):
            far = np.abs(missed[first:end]).max(initial=0.0) > CLOSE
            if not far:  # nor where it is not known
                missed[first:end] = 0.0
        return missed


def aside_after(plan: Plan, wanted: Floats) -> Floats:
    """Foretell where the path passes its fly points once targets have moved, (n, 3)."""
    return plan.aside + plan.pull.on(plan.pull.to_move(wanted))
