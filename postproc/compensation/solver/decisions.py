"""Which targets move, where to, and why the others do not."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.eligibility.arcs import STRAYS
from postproc.compensation.eligibility.flag_borders import (
    joints_written,
    poses_with_signs,
)
from postproc.compensation.eligibility.guards import (
    guard_motion,
    guard_size,
    guard_solutions,
    guard_turn,
)
from postproc.compensation.eligibility.reasons import Reasons
from postproc.compensation.eligibility.unchanged import (
    EXPORTED,
    NOT_WRITTEN,
    SEVERAL_MOVES,
    by_one_move,
    mark_disagreement,
    mark_unchanged,
    may_clone_exported,
    tell_cloning,
    without_target,
)
from postproc.compensation.options import Job
from postproc.compensation.outcome import Decisions, Status
from postproc.compensation.program import ParsedProgram, PlannedProgram
from postproc.compensation.solver.agreement import LEVER_MM, Agreement, agree, average
from postproc.compensation.solver.arc_angles import ASTRAY
from postproc.compensation.solver.continuity import (
    PathCorrection,
    PathLimits,
    keep_whole,
    path_correction,
)
from postproc.compensation.solver.dependants import (
    find_bent_arcs,
    move_dependants,
    would_worsen,
)
from postproc.compensation.solver.inverse_model import (
    Commands,
    angles_astray,
    change_mm,
    foresee,
    new_numbers,
    solve_written,
    turns_in_file,
)
from postproc.compensation.solver.shifts import absorb, own_shifts, shift_values
from postproc.diagnostics import Code, Reason
from postproc.language.visits import Meaning, Visits
from postproc.motion.deviation import JointDeviation
from postproc.robot.pose import MM, lengths
from postproc.robot.state import States

FLAG_MM = 1e6  # [mm] that a flag counts for where arrivals must agree
NONE = np.empty((0, 3))
KNOWN = 0.5  # part of its play that a joint must have left behind to be on a side
HELD = Reason(
    Code.DIRECTION_CHANGES, "its direction of arrival would change with the correction"
)
SWUNG = Reason(
    Code.ARM_SWINGS,
    "with the correction a joint, the elbow or the wrist centre would move by more "
    "than the cell's limits on the path to it or from it, or pass a singularity on "
    "another side",
)


AVERAGED = (
    "its arrivals need different corrections: the point has one that is at most {:.3f} "
    "mm off each"
)
NOT_ABSORBED = Reason(
    Code.ARRIVALS_DIFFER,
    "one shift (such as Offs) does not fit the corrections of all points that it "
    "shifts: give each point a move of its own",
)


@dataclass(frozen=True)
class Settled:
    """What arrivals have in common, once it is known what makes up for what.

    Attributes:
        agreement: At m literals; the numbers of one that holds a shift are the shift's.
        stay: Why literals must keep their values, and which of them have each reason,
            (m,).
        change: What had to agree at every visit, (n, k) [mm].
    """

    agreement: Agreement
    stay: dict[Reason, Bools]
    change: Floats

    def together(self, agree_mm: float) -> Bools:
        """Tell which literals can be given new numbers, (m,)."""
        apart = self.agreement.find_apart(agree_mm)
        stays = np.any([apart, *self.stay.values()], axis=0)
        return np.asarray(self.agreement.usable & ~stays)


@dataclass(frozen=True)
class Proposal:
    """Corrected numbers for the literals of a program.

    Attributes:
        edited: Literals that get new numbers, (m,).
        values: Their numbers, (m, w) in the file's units.
        corrected: Visits whose target moves, (n,).
        decisions: What was decided for every visit.
        usable: Visits that could be corrected if they had their points alone, (n,).
        change_mm: What they would be corrected by, as arrivals at one point compare
            it, (n, k) [mm].
        fixed: Literals that must keep their values for what else depends on them, (k,).
        left_mm: The most that one correction for arrivals which need different ones is
            off what an arrival needs, (n,) [mm]; 0 where they agree.
    """

    edited: Ints
    values: Floats
    corrected: Bools
    decisions: Decisions
    usable: Bools
    change_mm: Floats
    fixed: Ints
    left_mm: Floats


@dataclass(frozen=True)
class Beforehand:
    """What holds in every round, whatever is commanded.

    Attributes:
        reasons: Why visits do not move, or not by numbers of their own.
        display: Visits whose target has no numbers in the program, (n,).
        unchanged: Visits without a target, and taught points, (n,).
        path: Where visits follow each other on a path.
    """

    reasons: Reasons
    display: Bools
    unchanged: Bools
    path: PathLimits

    @classmethod
    def of(cls, visits: Visits, planned: PlannedProgram, setting: Job) -> Beforehand:
        """Look at a program before any command of it is known."""
        reasons, holds = Reasons(len(visits)), ~without_target(visits)
        display = holds & ((visits.reason > 0) | (visits.target.literal < 0))
        reasons.adopt(visits.reason, visits.reasons)
        reasons.mark(display, NOT_WRITTEN)
        unchanged = mark_unchanged(visits, reasons, setting.options)
        step_mm = setting.cell.limits.correction_step_mm
        path = PathLimits.of(visits, planned.plan.tcp, step_mm)
        return cls(reasons, display, unchanged, path)


@dataclass(frozen=True)
class Round:
    """What is to be decided in a round: commands for all targets of a window.

    Attributes:
        reading: The program.
        beforehand: What holds of it in every round.
        planned: Its plan, n visits.
        states: The same in the model's terms.
        solved: The corrected command of every visit.
        departure: How far the commands lead the arm from where it was, n visits.
        aside: From targets to where the corrected path passes them, (n, 3) [m].
        held: Visits that must be left alone for the side they are reached from, (n,).
        swung: .. for the ways to or from them, (n,).
        setting: Guards and frames, and what the user asked for.
    """

    reading: ParsedProgram
    beforehand: Beforehand
    planned: PlannedProgram
    states: States
    solved: Commands
    departure: JointDeviation
    aside: Floats
    held: Bools
    swung: Bools
    setting: Job

    @cached_property
    def path(self) -> PathCorrection:
        """How the correction changes along continuous paths."""
        plan, setting = self.planned.plan, self.setting
        return path_correction(
            self.beforehand.path, setting.cell.arm, plan.q, plan.tool[:, :3, 3],
            self.correction, self.solved.direction, setting.gap,
        )  # fmt: skip

    @cached_property
    def correction(self) -> Floats:
        """How far the commands move the TCP, base frame, (n, 3) [m]."""
        moved: Floats = self.solved.command[:, :3, 3] - self.planned.plan.tcp[:, :3, 3]
        return moved

    @property
    def shift(self) -> Floats:
        """The same for where targets lie: a fly point also makes up for its corner."""
        shift: Floats = self.correction - (self.aside - self.planned.plan.aside)
        return shift

    def propose(self) -> Proposal:
        """Decide what moves, until no arc and no sign of an axis is another by it.

        Every round leaves more points alone.
        """
        count = len(self.held)
        strays, border = np.zeros(count, bool), np.zeros((count, 6), bool)
        while True:
            found = self.decide(strays, border)
            bent = self._find_bent(found) & ~strays
            near = self._find_on_borders(found) & ~border
            if not (bent.any() or near.any()):
                return found
            strays, border = strays | bent, border | near

    def _find_bent(self, found: Proposal) -> Bools:
        """Tell which points of a proposal make another arc, (n,)."""
        if not self.planned.targets.via.any():
            return np.zeros(len(found.corrected), dtype=bool)
        moves = np.where(found.corrected[:, None], self.shift, 0.0)
        values, cell = found.decisions.corrected, self.setting.cell
        return find_bent_arcs(self.reading.visits, self.planned, cell, values, moves)

    def _find_on_borders(self, found: Proposal) -> Bools:
        """Tell which axes are on a border of flags with the numbers written, (n, 6).

        Arrivals at one point get the mean of what they need, and points that are
        passed make up for their corner: both differ from the commands.
        """
        visits, out = self.reading.visits, np.zeros((len(found.corrected), 6), bool)
        rows = np.flatnonzero(found.corrected & poses_with_signs(visits))
        if len(rows) == 0:
            return out
        arm, given, new = (
            self.setting.cell.arm,
            visits.target.values,
            found.decisions.corrected,
        )
        near = self.planned.plan.exact.q
        before, q = (
            solve_written(visits, arm, rows, numbers[rows], near[rows])
            for numbers in (given, new)
        )
        out[rows] = visits.dialect.near_border(given[rows], q, before, rounded=True)
        return out

    def decide(self, strays: Bools, border: Bools) -> Proposal:
        """Guard every solved visit, and compare the arrivals at every literal.

        Args:
            strays: Visits whose correction would make another arc, (n,).
            border: Axes that would be on a border of flags, (n, 6).
        """
        visits, beforehand = self.reading.visits, self.beforehand
        reasons = beforehand.reasons.copy()
        self._guard(reasons, strays, border)
        usable = reasons.none
        settled = self._settle(usable)
        agreement, stay = settled.agreement, settled.stay
        chosen, conflict = mark_disagreement(
            visits, agreement, stay, self.setting.cell, self.setting.options, reasons
        )
        status = np.where(reasons.none, Status.CORRECTED, Status.REJECTED)
        status[conflict] = Status.CONFLICT
        status[beforehand.display] = Status.RUNTIME
        status[beforehand.unchanged] = Status.UNCHANGED
        corrected = status == Status.CORRECTED
        left = np.zeros(len(visits))
        left[corrected] = agreement.radius_mm[agreement.group[corrected]]
        self._mark_averaged(reasons, left)
        values = np.array(visits.target.values)
        values[corrected] = agreement.values[agreement.group[corrected]]
        move_dependants(visits, agreement, chosen, values)
        literals, new = agreement.literal[chosen], agreement.values[chosen]
        values = shift_values(visits, literals, new, values)
        return Proposal(
            literals,
            new,
            corrected,
            self._decisions(status, reasons, values, agreement),
            usable,
            settled.change,
            agreement.literal[np.any([*stay.values()], axis=0)],
            left,
        )

    def _mark_averaged(self, reasons: Reasons, left_mm: Floats) -> None:
        """Say of arrivals that need different corrections what one leaves of them."""
        most = self.setting.cell.limits.averaged_mm
        rows = np.flatnonzero(left_mm > 0.0)
        sizes, first = np.unique(np.round(left_mm[rows], 3), return_inverse=True)
        order = np.argsort(first, kind="stable")
        ends = np.cumsum(np.bincount(first))[:-1]
        for size, own in zip(sizes.tolist(), np.split(rows[order], ends), strict=False):
            code = Code.ARRIVALS_AVERAGED if size <= most else Code.ARRIVALS_FAR_APART
            reasons.mark_visits(own, Reason(code, AVERAGED.format(size)))

    def _guard(self, reasons: Reasons, strays: Bools, border: Bools) -> None:
        """Mark the visits whose corrections are not trusted."""
        solved, limits, q = self.solved, self.setting.cell.limits, self.planned.plan.q
        visits, given = self.reading.visits, ~reasons.none
        reasons.adopt(self.planned.reasons.index, self.planned.reasons.all)
        for text, outside in solved.outside.items():
            reasons.mark(outside, Reason(Code.OUTSIDE_SURVEY, text))
        guard_solutions(reasons, self.setting.cell.arm, limits, q, solved.q)
        guard_motion(reasons, limits, self.departure)
        guard_turn(reasons, limits, solved.turn)
        guard_size(reasons, limits, self.correction, solved.residual)
        guard_size(reasons, limits, self.shift, solved.residual)
        self._guard_flags(reasons, border)
        reasons.mark(self.held, HELD)
        reasons.mark(self.swung, SWUNG)
        reasons.mark(strays, STRAYS)
        astray = angles_astray(visits, self.planned.plan, solved, self.aside)
        reasons.mark(astray, ASTRAY)
        keep_whole(reasons, self.path, visits, given, limits.correction_step_mm)

    def _guard_flags(self, reasons: Reasons, border: Bools) -> None:
        """Mark corrections that end where flags are not sure."""
        visits, near = self.reading.visits, np.array(border)
        rows = np.flatnonzero(poses_with_signs(visits))
        arm, solved = self.setting.cell.arm, self.solved
        q, before = joints_written(arm, self.planned, rows, solved, self.aside)
        near[rows] |= visits.dialect.near_border(visits.target.values[rows], q, before)
        for axis, found in enumerate(near.T, start=1):
            text = visits.dialect.terms.border.format(axis)
            reasons.mark(found, Reason(Code.CONFIGURATION_BORDER, text))

    @property
    def _is_trusted(self) -> Bools:
        """Tell where the model may be believed, (n,)."""
        left = self.held | self.swung
        out: Bools = ~np.any([left, *self.solved.outside.values()], axis=0)
        return out

    def _settle(self, usable: Bools) -> Settled:
        """Compare arrivals, until the shifts that make up for points do so for sure.

        A shift that cannot moves along with its point, which may have to stay for it.
        """
        visits, limit = self.reading.visits, self.setting.cell.limits.conflict_mm
        numbers, change, both = self._collect_needs()
        points = self._average(
            agree(visits.target.literal, usable, numbers, both), numbers, both
        )
        shifts, lost = own_shifts(visits), np.zeros(len(points.literal), dtype=bool)
        absorbing = shifts & points.usable[points.group] if shifts.any() else shifts
        while True:
            stay = self._find_pinned(points, change, absorbing)
            found = Settled(points, stay, both)
            if not shifts.any():
                return found
            stay |= {NOT_ABSORBED: lost} if lost.any() else {}
            free = found.together(limit)
            free[points.group[shifts]] = False  # what is left are points
            own = absorb(visits, usable, numbers, both, points, free, limit)
            again = self._average(own.agreement, numbers, own.change)
            found = Settled(again, stay | own.stay, own.change)
            failed = absorbing & ~found.together(limit)[points.group]
            if not failed.any():
                return found
            lost = np.array(lost)
            lost[points.group[failed]] = True
            absorbing = absorbing & ~failed

    def _average(self, found: Agreement, numbers: Floats, change: Floats) -> Agreement:
        """Give arrivals that do not agree one correction, where it helps all of them.

        The args are those of `agree`. Fly points and points of arcs and curves are not
        averaged, nor points reached in several frames, or shifted. Joint angles hold
        in every base and user frame.
        """
        limit, job = self.setting.cell.limits.conflict_mm, self.setting
        apart = found.usable & found.find_apart(limit)
        averages = job.averages and job.options.shared_points != "leave"
        if not (averages and apart.any()):
            return found
        visits, via = self.reading.visits, self.reading.visits.motion.via
        other = (
            visits.motion.fly | via | np.append(False, via[:-1]) | visits.motion.curved
        )
        other |= (visits.motion.block >= 0) | (visits.target.shift >= 0)
        apart[found.group[other & (found.group >= 0)]] = False
        own = visits.target.meaning != Meaning.JOINTS
        held = (visits.frame.uframe, own), (visits.frame.base, own)
        for frame, counts in (*held, (visits.frame.tool, True)):
            low, high = np.full(len(apart), 2**31), np.full(len(apart), -1)
            rows = (found.group >= 0) & counts
            np.minimum.at(low, found.group[rows], frame[rows])
            np.maximum.at(high, found.group[rows], frame[rows])
            apart &= low >= high
        mine = np.flatnonzero((found.group >= 0) & apart[found.group])
        solved = foresee(job.model, job.cell, self.states, self.solved, mine)
        std_mm = np.full(len(visits), np.nan)
        std_mm[mine] = lengths(solved.std_error[mine]) / MM
        return average(found, numbers, change, apart, std_mm)

    def _find_pinned(
        self, agreement: Agreement, change: Floats, absorbing: Bools
    ) -> dict[Reason, Bools]:
        """Find literals that must keep their values for what else depends on them.

        Returns:
            The reasons, and which of the m literals of the agreement have each, (m,).
        """
        visits, cell = self.reading.visits, self.setting.cell
        limit, trusted = cell.limits.conflict_mm, self._is_trusted
        hurt = would_worsen(visits, agreement, change, trusted, limit, absorbing)
        options = self.setting.options
        cloning = tell_cloning(options)
        stay = {Reason(Code.NUMBERS_USED_ELSEWHERE,
                       f"{why}: give the move a point of its own ({cloning})"): rows
                for why, pins in visits.literals.pins.items()
                if (rows := np.isin(agreement.literal, pins)).any()}  # fmt: skip
        text = f"a target computed from it would land farther off ({cloning})"
        stay[Reason(Code.DEPENDANT_WORSE, text)] = hurt
        if options.shared_points == "leave":
            count = len(agreement.literal)
            stay[SEVERAL_MOVES] = ~by_one_move(visits, agreement.group, count)
        elif may_clone_exported(visits, options) and not options.edit_exported:
            stay[EXPORTED] = visits.literals.shared[agreement.literal]
        return stay

    def _collect_needs(self) -> tuple[Floats, Floats, Floats]:
        """Say what arrivals need, and what must agree.

        Returns:
            Corrected numbers, (n, w); what every visit would be corrected by, (n, 3)
            [mm], and the same with turns beside it where tools are turned, (n, k) [mm].
        """
        visits, solved = self.reading.visits, self.solved
        plan, arm = self.planned.plan, self.setting.cell.arm
        numbers = new_numbers(visits, arm, plan, solved, self.aside)
        change = change_mm(visits, numbers, self.correction)
        both = change
        if len(solved.turned):
            turn = turns_in_file(visits, solved)
            both = np.concatenate([change, turn * LEVER_MM], axis=1)
        flags = list(visits.dialect.flag_columns)
        if flags:  # arrivals with different flags have no mean
            poses = (visits.target.meaning == Meaning.POSE)[:, None]
            anew = np.where(
                poses, numbers[:, flags] - visits.target.values[:, flags], 0.0
            )
            both = np.concatenate([both, anew * FLAG_MM], axis=1)
        return numbers, change, both

    def _decisions(
        self, status: Ints, reasons: Reasons, values: Floats, agreement: Agreement
    ) -> Decisions:
        """Say what was decided for every visit, but for standard errors."""
        side, moves = self.solved.direction, (status == Status.CORRECTED)[:, None]
        moved = agreement.share_out(self.correction)
        turn = (
            np.where(moves, agreement.share_out(self.solved.turn), 0.0)
            if self.setting.options.orientation
            else NONE
        )
        return Decisions(
            status=status.astype(np.int8),
            why=reasons.index,
            reasons=reasons.all,
            q=self.planned.plan.q,
            direction=(side >= KNOWN).astype(np.int8) - (side <= -KNOWN),
            side=side,
            corrected=values,
            correction=np.where(moves, moved, 0.0),
            std_error=np.full_like(moved, np.nan),  # when all is settled
            turn=turn,
        )
