"""Correct and plan again, until the sides are those corrected for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count

import numpy as np

from postproc.arrays import (
    Bools,
    Floats,
    Ints,
    all_in_rows,
    any_in_rows,
    largest_in_rows,
    spans,
    take_rows,
)
from postproc.compensation.eligibility.flag_borders import turn_from_borders
from postproc.compensation.eligibility.guards import limit_violations
from postproc.compensation.options import Clock, Job
from postproc.compensation.output.rewrite import WrittenNumbers, read_back
from postproc.compensation.program import ParsedProgram, PlannedProgram
from postproc.compensation.scale.consensus import (
    NOT_SEEN,
    Glimpses,
    RoundLog,
    Snapshot,
)
from postproc.compensation.solver.aims import NO_STATES, NextAims, next_aims
from postproc.compensation.solver.arc_angles import ArcAngles
from postproc.compensation.solver.arc_turns import ArcTurns
from postproc.compensation.solver.decisions import Beforehand, Proposal, Round
from postproc.compensation.solver.dependants import with_origins
from postproc.compensation.solver.inverse_model import (
    Commands,
    foresee,
    predict_arrivals,
    solve_again,
    solve_visits,
)
from postproc.compensation.solver.targets import move_targets
from postproc.language.text.number_edits import edits as number_edits
from postproc.language.text.source import Replacements
from postproc.language.visits import Visits
from postproc.model.model import Prediction
from postproc.motion.deviation import JointDeviation, departure, path_departure
from postproc.motion.joint_path import NOWHERE, StartState
from postproc.motion.planner import Plan
from postproc.motion.replan import Reached, Replanned, replan, replan_all
from postproc.motion.targets import Targets
from postproc.robot.cell import Cell
from postproc.robot.direction import FlankState
from postproc.robot.pose import MM, has_unknown
from postproc.robot.state import States

# What the targets of a window are corrected for, from round to round.

CLOSE = 5e-6  # [m] how well rounded fly points are hit


@dataclass(frozen=True)
class SolverState:
    """What n targets are corrected for in a round.

    Attributes:
        solved: The commands.
        departure: How far they lead the arm from where it was.
        aside: From targets to where the path is foretold to pass them, (n, 3) [m].
        reached: The sides that they are foretold to be reached from, (n, 6).
        held: Targets that keep their values for the side they are reached from, (n,).
        swung: .. for the ways to or from them, (n,).
        settled: Targets whose sides changed till the last round, and may, or that are
            meant to be reached from theirs, (n,).
    """

    solved: Commands
    departure: JointDeviation
    aside: Floats
    reached: Floats
    held: Bools
    swung: Bools
    settled: Bools

    def find_off(self, proposal: Proposal, side: Floats, late: bool) -> Bools:
        """Tell which corrected targets are reached from sides not foretold, (n,).

        Args:
            proposal: Tells which are corrected.
            side: From where they are reached, (n, 6).
            late: Only those that are reached from other sides than corrected for.
        """
        wanted, most = (self.solved.direction, OTHER) if late else (self.reached, SAME)
        off = np.abs(side - wanted)
        far = np.zeros(len(off), dtype=bool)
        rows = np.unique(np.flatnonzero(off > most) // off.shape[1])  # few
        far[rows] = largest_in_rows(off[rows]) > most  # NaN is not far
        return np.asarray(proposal.corrected & ~self.settled & far)


@dataclass(frozen=True)
class Look:
    """What a look at a proposal for n targets has found.

    Attributes:
        leads: Where its numbers lead.
        corrected: Which targets it corrects, (n,).
        off: .. and which of them are reached from sides not foretold, (n,).
        missed: By what targets miss theirs and are to be bent, (n, 3) [m].
        late: Too many rounds have not settled them.
    """

    leads: Replanned
    corrected: Bools
    off: Bools
    missed: Floats
    late: bool

    @property
    def is_settled(self) -> bool:
        """Tell whether nothing is off."""
        return not (self.off.any() or self.missed.any())


@dataclass(frozen=True)
class Iteration:
    """What does not change from round to round.

    Attributes:
        reading: The visits.
        planned, states: Their plan.
        setting: What it is compensated with.
        part: They are a window of a program.
    """

    reading: ParsedProgram
    planned: PlannedProgram
    states: States
    setting: Job
    part: bool

    @cached_property
    def beforehand(self) -> Beforehand:
        """What holds in every round."""
        return Beforehand.of(self.reading.visits, self.planned, self.setting)

    @cached_property
    def numbers(self) -> WrittenNumbers:
        """How numbers are written."""
        return WrittenNumbers.of(self.reading)

    def first_aim(self) -> SolverState:
        """Correct for the sides that were planned, or are meant."""
        setting, none = self.setting, np.zeros(len(self.states), dtype=bool)
        aims, states, meant = self.reading.aims, self.states, none
        if len(aims):
            meant = ~has_unknown(aims)
            sides = np.where(np.isnan(aims), states.direction, aims)
            states = states.with_(direction=sides)
        with setting.clock("solve"):
            solved = solve_visits(
                setting.model, setting.cell, self.planned, states,
                setting.options.orientation,
            )  # fmt: skip
            solved = self._keep_sides(solved, solved.known, states)
            departed = self.measure_deviation(solved, np.arange(len(self.states)))
        plan = self.planned.plan
        wanted = solved.command[:, :3, 3] - plan.tcp[:, :3, 3]
        aside = passing_after(plan, np.nan_to_num(wanted))
        given = solved, departed, aside, solved.direction
        return SolverState(*given, none, none, meant)

    def _keep_sides(self, solved: Commands, rows: Bools, states: States) -> Commands:
        """Let axes near 0 stay on the side that flags name."""
        setting, plan = self.setting, self.planned.plan
        if not self.reading.visits.dialect.sign_flags:
            return solved
        wanted = np.nan_to_num(solved.command[:, :3, 3] - plan.tcp[:, :3, 3])
        return turn_from_borders(
            solved, rows, self.reading.visits, setting.model, setting.cell,
            self.planned, states, passing_after(plan, wanted),
            setting.options.orientation,
        )  # fmt: skip

    def measure_deviation(self, solved: Commands, rows: Ints) -> JointDeviation:
        """Say how far commands lead the arm from where it was, k visits."""
        plan, setting = self.planned.plan, self.setting
        tool = take_rows(plan.tool, rows)[:, :3, 3]
        arm, old, new = setting.cell.arm, plan.q[rows], solved.q[rows]
        return departure(arm, old, new, tool, setting.offset)

    def find_aims(
        self, current: SolverState, look: Look, lead: Floats, watched: slice
    ) -> NextAims:
        """Give the sides to correct targets for next, see `next_aims`.

        Where too many rounds have not settled them, it is the middle.
        """
        solved, tool = current.solved, self.planned.plan.tool[:, :3, 3]
        free = look.corrected & (look.off | ~current.settled)
        with self.setting.clock("solve"):
            states = self.states.with_(tool=tool)
            given = self.setting.model, solved, states, look.leads, look.corrected
            found = next_aims(*given, free, look.off, look.missed, lead, watched)
        if not look.late:
            return found
        middle = (solved.direction + look.leads.side) / 2
        return replace(found, sides=np.where(look.off[:, None], middle, found.sides))

    def next_aim(
        self, current: SolverState, found: NextAims, missed: Floats
    ) -> SolverState:
        """Correct targets for other sides, and bend the path where it misses places."""
        setting, old = self.setting, current.solved
        moved = any_in_rows(found.sides != old.direction)
        with setting.clock("solve"):
            states = self.states.with_(direction=found.sides)
            solved = solve_again(
                old, moved, setting.model, setting.cell, self.planned, states,
                setting.options.orientation,
            )  # fmt: skip
            solved = self._keep_sides(solved, moved, states)
            rows = np.flatnonzero(moved)
            departed = current.departure.with_rows(
                rows, self.measure_deviation(solved, rows)
            )
        aside = current.aside + missed + found.farther
        return replace(
            current, solved=solved, departure=departed, aside=aside,
            reached=found.reached,
        )  # fmt: skip

    def propose(self, current: SolverState) -> Proposal:
        """Decide on numbers."""
        with self.setting.clock("decide"):
            given = self.reading, self.beforehand, self.planned, self.states
            found = current.solved, current.departure, current.aside
            left = current.held, current.swung
            return Round(*given, *found, *left, self.setting).propose()

    def look(
        self, current: SolverState, proposal: Proposal, leads: Replanned, number: int
    ) -> Look:
        """Compare where a proposal leads with what was foretold, in a round."""
        late = number >= ROUNDS
        off = current.find_off(proposal, leads.side, late)
        missed = self.measure_misses(proposal, leads.aside, current.aside, number)
        return Look(leads, proposal.corrected, off, missed, late)

    def measure_misses(
        self, proposal: Proposal, aside: Floats, meant: Floats, number: int
    ) -> Floats:
        """Say by what targets miss theirs and are to be bent, (n, 3) [m].

        Where the original path is as good as straight, only what is too much counts: a
        correction bends it where a joint reverses.

        Args:
            proposal: Tells which targets can make up for it.
            aside: From targets to where the path passes them, (n, 3) [m].
            meant: .. to where it should.
            number: The round.
        """
        flown = self.reading.visits.motion.fly & proposal.corrected
        missed = np.where(flown[:, None], aside - meant, 0.0)
        missed[any_in_rows(np.isnan(missed))] = 0.0
        allowed = np.full(len(missed), CLOSE if number < ROUNDS + LAST else np.inf)
        if number < CORNERS:
            allowed[self.planned.plan.pull.visit] = FINE
        missed[largest_in_rows(np.abs(missed)) <= allowed] = 0.0
        return missed

    def find_limit_violations(
        self, proposal: Proposal, found: Converged | None
    ) -> Bools:
        """Tell which targets must stay for the ways to or from them, (n,).

        Raises:
            NotAloneError: They are not among these, in a window of a program, or
                programs are side by side.
        """
        n = len(self.states)
        if found is None:
            return np.zeros(n, dtype=bool)
        limits, targets = self.setting.cell.limits, self.planned.targets
        far = np.any([*limit_violations(limits, found.moved).values()], axis=0)
        rows = np.flatnonzero(far)
        sources = _sources(targets, rows)
        begins = _sources(targets, sources[targets.via[sources]])  # of arcs
        ends = np.zeros(n, dtype=bool)
        ends[rows] = ends[sources] = ends[begins] = True
        ends = with_origins(self.reading.visits, self.planned, ends)
        ends &= proposal.corrected
        if far.any() and not ends.any():  # by what came long before
            if self.part or len(self.reading.begins) > 1:
                raise NotAloneError
            ends = np.array(proposal.corrected)
        return ends


def _sources(targets: Targets, rows: Ints) -> Ints:
    """List the known targets that lead to some."""
    before = spans(targets.pred_start[rows], np.diff(targets.pred_start)[rows])
    sources = targets.pred[before]
    return np.asarray(sources[sources >= 0])


def passing_after(plan: Plan, wanted: Floats) -> Floats:
    """Foretell where the path passes its fly points once targets have moved, (n, 3)."""
    return plan.aside + plan.pull.on(plan.pull.to_move(wanted))


# Where the numbers of one program lead, as they change from round to round.


class Replanner:
    """The last course of a program, and the way to the next one."""

    def __init__(
        self, visits: Visits, targets: Targets, cell: Cell, begin: StartState
    ) -> None:
        """Begin with the program as it is.

        Args:
            visits: Its visits.
            targets: Where they go.
            cell: The arm and its surroundings.
            begin: Where the arm stands at the first visit, if that is known beforehand.
        """
        self._visits, self._targets, self._cell = visits, targets, cell
        self._begin = begin
        self._last: Replanned | None = None

    def after(self, values: Floats, lead: FlankState, near: float) -> Replanned:
        """Find where the program leads with other numbers.

        Args:
            values: The numbers, (n, w) in the program's units.
            lead: What is known of the first sides, see `direction.arrivals`.
            near: Numbers that differ by no more than this may stay as they were.
        """
        old = self._visits.target.values
        same = (np.abs(values - old) <= near) | (np.isnan(values) & np.isnan(old))
        moved = ~all_in_rows(same)
        new = self._visits.with_columns(values=np.where(moved[:, None], values, old))
        moved |= ArcAngles.of(new).find_moved(moved)
        moved |= ArcTurns.of(new).find_moved(moved)
        rows = np.flatnonzero(moved)
        targets = move_targets(self._targets, new, self._cell, rows)
        arm, last = self._cell.arm, self._last
        if last is None:
            self._last = replan_all(arm, targets, self._begin, lead)
        else:
            self._last = replan(arm, last, targets, moved, lead)
        self._visits, self._targets = new, targets
        return self._last


# Correct and plan again, until the sides are those corrected for.

ROUNDS = 3  # of correcting for changed sides, before targets are settled for
SAME = 0.01  # sides closer than this are the same
OTHER = 1.0  # sides farther apart than this are different ones
CORNERS = 2  # rounds that bend the way at all corners; later where it is far off alone
FINE = 2e-7  # [m] how well rounded fly points are hit by then
LAST = 2  # rounds of that behind the last one of other sides
NEAR = 1e-7  # [mm, deg] that numbers may be off where the way is looked at


@dataclass(frozen=True)
class Boundary:
    """How a window goes on from the one before.

    Attributes:
        begin: Where the arm stands at the first visit.
        looks: What the window before looked at, at the first k visits.
        settled: What it has settled of the first ones, by rounds, see `NextAims.seen`.
    """

    begin: StartState = NOWHERE
    looks: Glimpses = NOT_SEEN
    settled: Mapping[int, Floats] = field(default_factory=dict)


FROM_START = Boundary()


class NotAloneError(Exception):
    """What comes of a window cannot be told from it alone, or of programs together."""


@dataclass(frozen=True)
class Converged:
    """A proposal, the edits that write it, and where the written numbers lead.

    Attributes:
        proposal: What is written.
        edits: The edits that write it.
        reached: Where these numbers lead.
        moved: How far the ways lead the arm from where it was, n visits.
        foreseen: The errors predicted at the arrivals that they are corrected for.
    """

    proposal: Proposal
    edits: tuple[Replacements, ...]
    reached: Reached
    moved: JointDeviation
    foreseen: Prediction


def iterate(
    reading: ParsedProgram,
    planned: PlannedProgram,
    states: States,
    setting: Job,
    lead: Boundary = FROM_START,
    trail: RoundLog | None = None,
) -> Converged:
    """Correct and plan again, until the sides are those corrected for.

    The corrected program makes slightly other moves than the original, so a joint may
    come from the other side, or lie elsewhere in its play: the correction is computed
    anew for that. Where joints still change sides at the end, the target is corrected
    for the middle between both, and listed: to leave it alone would bend a fly run by
    the whole correction, and move its neighbours' sides with it.

    A rounded fly point also moves with its neighbours' corrections, which its own makes
    up for, as long as sides change: where a joint reverses, a change of sides bends the
    corner anew. The last look is at the numbers as they will be read from the output.
    Where it finds that targets must keep their values, the rounds begin anew behind
    those that bend all corners.

    What becomes of a target depends on the targets near it alone, never on how long
    others take: so windows of a program come out as the whole, and programs side by
    side as each alone.

    Args:
        reading: The visits.
        planned: Their plan.
        states: The same in the model's terms.
        setting: What they are compensated with.
        lead: How they go on from others, if they are a window of a program.
        trail: .. and what is kept of their rounds then.

    Raises:
        NotAloneError: What comes of a window cannot be told from it alone.
    """
    iteration = Iteration(reading, planned, states, setting, trail is not None)
    trail = RoundLog() if trail is None else trail
    replanner = Replanner(reading.visits, planned.targets, setting.cell, lead.begin)
    course = _Course(iteration, replanner, lead, trail)
    current, number = iteration.first_aim(), 0
    for turn in count():  # ends: from round ROUNDS on, `settled` or `held` grows
        proposal = iteration.propose(current)
        leads = course.replan(current, proposal, turn)
        look = iteration.look(current, proposal, leads, number)
        if look.is_settled:
            done, flipped = _read_back(course, current, proposal)
            swung = iteration.find_limit_violations(proposal, done)
            if done is not None and not swung.any():
                return done
            held, swung = current.held | flipped, current.swung | swung
            current, number = replace(current, held=held, swung=swung), CORNERS
            continue
        if look.late:
            current = replace(current, settled=current.settled | look.off)
        found = course.settle(turn, current, look)
        current = iteration.next_aim(current, found, look.missed)
        number += 1
    raise AssertionError("unreachable")


@dataclass(frozen=True)
class _Course:
    """The way from proposals to where they lead.

    Attributes:
        iteration: What does not change.
        replanner: Finds the way.
        lead: How it begins.
        trail: What is kept of it.
    """

    iteration: Iteration
    replanner: Replanner
    lead: Boundary
    trail: RoundLog

    def replan(
        self, current: SolverState, proposal: Proposal, turn: int | None = None
    ) -> Replanned:
        """Find where a proposal leads; without a round: as it is written."""
        values = proposal.decisions.corrected
        if turn is not None:
            values = self.iteration.numbers.round(values)
        with self.iteration.setting.clock("plan again"):
            near, lead = 0.0 if turn is None else NEAR, self.lead.looks.sides_at(turn)
            found = self.replanner.after(values, lead, near)
        if self.iteration.part:
            self.trail.see(turn, _glimpse(current, proposal, found))
        return found

    def settle(self, turn: int, current: SolverState, look: Look) -> NextAims:
        """Find what to correct targets for next, see `Iteration.find_aims`."""
        lead = self.lead.settled.get(turn, NO_STATES)
        found = self.iteration.find_aims(current, look, lead, self.trail.seam)
        self.trail.settled[turn] = found.seen
        return found


def _glimpse(current: SolverState, proposal: Proposal, found: Replanned) -> Snapshot:
    """Put together what windows must agree on at their cuts."""
    decided = proposal.decisions
    return Snapshot(
        values=decided.corrected,
        status=decided.status,
        why=decided.why,
        reasons=decided.reasons,
        correction=decided.correction,
        aim=current.solved.direction,
        foretold=current.aside,
        left=np.column_stack([current.held, current.swung, current.settled]),
        q=found.exact.q,
        passed=found.passed,
        aside=found.aside,
        slot=found.slot,
        side=found.side,
        lo=found.sides.play.lo,
        hi=found.sides.play.hi,
    )


def _read_back(
    course: _Course, current: SolverState, proposal: Proposal
) -> tuple[Converged | None, Bools]:
    """Write the numbers, and look at them as they will be read.

    Returns:
        What came of it, None where targets now come from another side; and those.
    """
    iteration = course.iteration
    setting = iteration.setting
    edits, proposal = write_and_read_back(iteration.reading, proposal, setting.clock)
    last = course.replan(current, proposal)
    flipped = current.find_off(proposal, last.side, late=True)
    if flipped.any():
        return None, flipped
    with setting.clock("solve"):
        given = setting.model, setting.cell, iteration.states
        solved = foresee(*given, current.solved)
        foreseen = predict_arrivals(*given, solved)
        std_error = iteration.planned.with_frame(solved.std_error)
        shared = proposal.left_mm * MM / np.sqrt(3.0)  # an axis
        std_error = np.hypot(std_error, shared[:, None])
    decided = replace(proposal.decisions, std_error=std_error)
    proposal = replace(proposal, decisions=decided)
    with setting.clock("verify"):
        job, plan = iteration.setting, iteration.planned.plan
        arm, tool, offset = job.cell.arm, plan.tool[:, :3, 3], job.offset
        move, q = last.targets.move, last.exact.q
        moved = path_departure(arm, move, tool, plan.exact, q, last.edges.join, offset)
    return Converged(proposal, edits, last.reached, moved, foreseen), flipped


def write_and_read_back(
    reading: ParsedProgram, proposal: Proposal, clock: Clock
) -> tuple[tuple[Replacements, ...], Proposal]:
    """Write the numbers; return the edits, and the proposal as it will be read."""
    with clock("rewrite"):
        literals, edited = reading.visits.literals, proposal.edited
        dialect = reading.visits.dialect
        edits = number_edits(
            literals, reading.sources, edited, proposal.values, dialect
        )
        values = read_back(reading.visits, edited, edits)
    decisions = replace(proposal.decisions, corrected=values)
    return edits, replace(proposal, decisions=decisions)
