"""Which targets move, where to, and why the others do not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Interned, Ints, any_in_rows
from postproc.compensation.options import Job, Options
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
from postproc.compensation.solver.eligibility import STRAYS, Reasons, find_strayed
from postproc.compensation.solver.flag_borders import joints_written, poses_with_signs
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
from postproc.compensation.solver.targets import move_targets
from postproc.diagnostics import Code, Reason
from postproc.language.visits import Meaning, Visits
from postproc.motion.deviation import JointDeviation
from postproc.motion.replan import IS_STEP
from postproc.motion.targets import TargetKind
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell, LimitSection
from postproc.robot.pose import MM, has_unknown, lengths
from postproc.robot.state import States

# Targets that the program computes from others: they move along with them.


def dependants(visits: Visits, agreement: Agreement, among: Bools) -> tuple[Ints, Ints]:
    """Find the visits that move along with a literal, and its row in the agreement."""
    rows = np.flatnonzero((visits.target.follows >= 0) & among)
    return rows, np.searchsorted(agreement.literal, visits.target.follows[rows])


def would_worsen(
    visits: Visits,
    agreement: Agreement,
    change_mm: Floats,
    trusted: Bools,
    agree_mm: float,
    absorbing: Bools,
) -> Bools:
    """Tell which literals would carry a computed target farther off, (m,).

    A target such as ``POS_SHIFT(p, ..)`` or ``NEAR p BY d`` needs a change of its own
    and gets that of ``p``. What it is then off must be no more than what it is off now.
    ``FOR d TO p`` only takes its direction from ``p``: it is a part of the way there.
    A taught target needs none.

    Args:
        visits: n arrivals.
        agreement: What the m literals would change by.
        change_mm: The change that every visit needs, (n, 3) [mm].
        trusted: The model can say what a visit needs, (n,).
        agree_mm: Changes that differ less are the same.
        absorbing: Their move makes up for what the literal changes by, (n,).
    """
    carries = ~absorbing & (visits.target.meaning != Meaning.FOR)
    rows, at = dependants(visits, agreement, carries)
    needed = np.where(find_taught(visits)[rows, None], 0.0, change_mm[rows])
    moved = agreement.change_mm[at]
    shifted = visits.target.shift[rows] >= 0
    if shifted.any():
        after = shift_values(
            visits, agreement.literal, agreement.values, visits.target.values, own=False
        )
        own = rows[shifted]
        moved[shifted] = (after - visits.target.values)[own, :3]
    left = np.linalg.norm(moved - needed, axis=1)
    allowed = np.maximum(np.linalg.norm(needed, axis=1), agree_mm)
    worse = ~(trusted[rows] & (left <= allowed))
    found = np.zeros(len(agreement.literal), dtype=bool)
    found[at[worse]] = True
    return found


def find_taught(visits: Visits) -> Bools:
    """Tell which visits have a literal that holds a taught target, (n,)."""
    if len(visits.literals) == 0:
        return np.zeros(len(visits), dtype=bool)
    has = visits.target.literal >= 0
    return np.asarray(
        has & visits.literals.taught[np.where(has, visits.target.literal, 0)]
    )


def move_dependants(
    visits: Visits, agreement: Agreement, chosen: Bools, values: Floats
) -> None:
    """Move the computed targets along with the literals that change, in place.

    Args:
        visits: n arrivals.
        agreement: What the m literals change by.
        chosen: Literals that do change, (m,).
        values: Numbers of every visit, (n, w).
    """
    rows, at = dependants(visits, agreement, visits.target.shift < 0)
    rows, at = rows[chosen[at]], at[chosen[at]]
    if len(rows) == 0:
        return
    direct = np.flatnonzero(visits.target.literal >= 0)
    written = np.zeros((len(visits.literals), values.shape[1]))
    written[visits.target.literal[direct]] = visits.target.values[direct]
    values[rows] += agreement.values[at] - written[agreement.literal[at]]


# Why targets stay where they are, whatever the model says of them.


def without_target(visits: Visits) -> Bools:
    """Tell which moves go where no target of theirs says, (n,): $HOME, RELATIVE, .."""
    none = np.array([one.code is Code.NO_TARGET for one in visits.reasons])
    named = np.isin(
        visits.target.meaning,
        (Meaning.POSE, Meaning.JOINTS, Meaning.NEAR, Meaning.PARTIAL_POSE,
         Meaning.PARTIAL_JOINTS, Meaning.UNKNOWN),
    )  # fmt: skip
    return np.asarray(~named | none[visits.reason])


def mark_unchanged(visits: Visits, reasons: Reasons, options: Options) -> Bools:
    """Mark moves without a target, taught points and shared variables, (n,)."""
    empty = without_target(visits)
    reasons.mark(empty, HOLDS_NONE)
    has = visits.target.literal >= 0
    literal = np.where(has, visits.target.literal, 0)
    if len(visits.literals) == 0:
        return empty
    held = find_taught(visits)
    reasons.mark(held, TAUGHT)
    if not (options.edit_exported or _may_clone_exported(visits, options)):
        shared = has & visits.literals.shared[literal]
        reasons.mark(shared, EXPORTED)
    return np.asarray(empty | held)


def _may_clone_exported(visits: Visits, options: Options) -> bool:
    """Return True if moves to points of other programs may be given clones of them."""
    return options.shared_points == "clone" and visits.dialect.runs_alone


def mark_disagreement(
    visits: Visits,
    agreement: Agreement,
    stay: Mapping[Reason, Bools],
    cell: Cell,
    reasons: Reasons,
) -> tuple[Bools, Bools]:
    """Mark the visits of literals whose arrivals disagree, or that must stay.

    Returns:
        The literals that agree, (m,), and the visits that would be corrected if the
        others at their literal agreed, (n,).
    """
    limit = cell.limits.conflict_mm
    has = agreement.group >= 0
    apart = agreement.find_apart(limit)
    stays = np.any([apart, *stay.values()], axis=0)
    together = agreement.usable & ~stays
    if len(together) == 0:
        return together, np.zeros(len(visits), dtype=bool)
    at = np.where(has, agreement.group, 0)
    conflict = reasons.none & has & ~together[at]
    differ = conflict & agreement.usable[at] & apart[at]
    code = Code.ARRIVALS_DIFFER
    apart_by = Reason(code, SHIFTED_APART.format(limit))
    reasons.mark(differ & own_shifts(visits), apart_by)
    text = f"its arrivals differ by more than conflict_mm = {limit:g}: "
    if differ.any():
        alone = _by_one_move(visits, agreement.group, len(together))[at]
        reasons.mark(differ & alone, Reason(code, f"{text}{_ONE_MOVE}"))
    cloning = visits.dialect.terms.cloning
    text += f"give each move a point of its own ({cloning})"
    reasons.mark(differ, Reason(code, text))
    for why, literals in stay.items():
        reasons.mark(conflict & literals[at], why)
    reasons.mark(conflict, OTHER_ARRIVAL)
    return together, conflict


HOLDS_NONE = Reason(Code.NO_TARGET, "this move holds no target")
NOT_WRITTEN = Reason(Code.NUMBERS_NOT_OWN, "its numbers are not written in the program")
TAUGHT = Reason(Code.TAUGHT_POINT, "a taught point already contains the arm's error")
EXPORTED = Reason(
    Code.EXPORTED_VARIABLE,
    "other programs may read this variable too (see edit_exported)",
)
OTHER_ARRIVAL = Reason(
    Code.DEPENDANT_WORSE,
    "another arrival at this point cannot be corrected: give each move a point of its "
    "own (see --shared-points clone)",
)
SEVERAL_MOVES = Reason(
    Code.SHARED_POINT, "several moves go to this point (shared_points = leave)"
)
_ONE_MOVE = (
    "one move makes them all, and --shared-points clone does not help: write it once "
    "for every way to it, or for all frames that it is made with"
)


def _by_one_move(visits: Visits, group: Ints, count: int) -> Bools:
    """Tell which literals a single move of the program goes to, (count,).

    Args:
        visits: The program.
        group: Literal of every visit, (n,), -1 where it has none.
        count: How many there are.
    """
    places = np.stack([group, visits.place.file, visits.place.line])[:, group >= 0]
    own = np.unique(places, axis=1)[0]
    return np.asarray(np.bincount(own, minlength=count) == 1)


# Targets that move although no number of theirs is written anew.
#
# A computed target moves along with the literal that it is computed from, a step
# (RELATIVE, AWAY, ..) with the place that it begins at.


def find_bent_arcs(
    visits: Visits, planned: PlannedProgram, cell: Cell, values: Floats, shift: Floats
) -> Bools:
    """Tell which targets must stay for every arc to stay what it is, (n,).

    Args are those of `with_dependants`.
    """
    if not planned.targets.via.any():
        return np.zeros(len(visits), dtype=bool)
    moves = with_dependants(visits, planned, cell, values, shift)
    step = cell.limits.correction_step_mm * MM
    away = find_strayed(planned.targets, planned.plan, moves, step)
    return with_origins(visits, planned, away)


def with_dependants(
    visits: Visits, planned: PlannedProgram, cell: Cell, values: Floats, shift: Floats
) -> Floats:
    """Tell what all targets move by, (n, 3) [m], base frame.

    Args:
        visits: n arrivals.
        planned: Their plan.
        cell: The robot's surroundings.
        values: Numbers of every visit after the correction, (n, w).
        shift: What those with numbers of their own move by, (n, 3) [m]; else 0.
    """
    moves = np.array(shift)
    rows = np.flatnonzero(
        (visits.target.follows >= 0) & any_in_rows(values != visits.target.values)
    )
    if len(rows):
        now = move_targets(
            planned.targets, visits.with_columns(values=values), cell, rows
        ).tcp[rows]
        moves[rows] = np.nan_to_num((now - planned.targets.tcp[rows])[:, :3, 3])
    for v, sources in _steps(planned):
        source = sources[np.argmax(np.linalg.norm(moves[sources], axis=1))]
        moves[v] = _carry_step(planned, v, int(source), moves)
    return moves


ALONG = 1e-6  # [m]: what moves by less stays
WITH_POINT = "it still moves with the point that it is computed from"
WITH_BEGIN = "it still moves with the target that it begins at"


def with_what_moves_along(
    visits: Visits, planned: PlannedProgram, cell: Cell, found: Decisions
) -> Decisions:
    """Say of targets that are left where they move all the same.

    Args:
        visits: n arrivals.
        planned: Their plan.
        cell: The robot's surroundings.
        found: What was decided for them.
    """
    own = (found.status == Status.CORRECTED)[:, None]
    values, shift = found.corrected, np.where(own, found.correction, 0.0)
    moves = np.nan_to_num(with_dependants(visits, planned, cell, values, shift))
    along = ~own[:, 0] & (lengths(moves) > ALONG)
    told = np.isin(
        visits.target.meaning, (Meaning.PARTIAL_POSE, Meaning.PARTIAL_JOINTS)
    )
    rows = np.flatnonzero(along & ~told)
    if len(rows) == 0:
        return found
    why, reasons = np.array(found.why), Interned(found.reasons)
    for v in rows.tolist():
        how = WITH_POINT if visits.target.follows[v] >= 0 else WITH_BEGIN
        why[v] = reasons[found.reasons[why[v]].within(f"{{}}; {how}")]
    return replace(found, why=why, reasons=tuple(reasons))


def _carry_step(planned: PlannedProgram, v: int, source: int, moves: Floats) -> Floats:
    """Tell what a step moves by as the place that it begins at does, (3,) [m]."""
    t, moved = planned.targets, np.asarray(moves[source])
    if t.kind[v] == TargetKind.TOWARDS:
        way = t.tcp[v, :3, 3] - planned.plan.tcp[source, :3, 3]
        return moved + _turn_place(way, t.distance[v], moves[v] - moved)
    if t.kind[v] == TargetKind.PARTIAL_POSE:  # along the axes of what is not written
        axes = t.tcp[v, :3, :3][:, np.isnan(t.tcp[v, :3, 3])]
        return np.asarray(axes @ (axes.T @ moved))
    return moved


def with_origins(visits: Visits, planned: PlannedProgram, found: Bools) -> Bools:
    """Add to some targets, (n,), those along with which they move."""
    found = np.array(found)
    for v, sources in reversed([*_steps(planned)]):
        found[sources] |= found[v]
    literals = visits.target.follows[found & (visits.target.follows >= 0)]
    return np.asarray(found | np.isin(visits.target.literal, literals))


def _turn_place(way: Floats, distance: float, by: Floats) -> Floats:
    """Tell what a place at a distance on a way moves by as the end of the way does."""
    length = np.linalg.norm(way)
    if not 0.0 < distance <= length:  # so short a way is not known either
        return np.zeros(3)
    u = way / length
    turned: Floats = (by - (by @ u) * u) * (distance / length)
    return turned


def _steps(planned: PlannedProgram) -> Iterator[tuple[int, Ints]]:
    """Yield the moves by a step, in the program's order, and where they begin."""
    t = planned.targets
    for v in np.flatnonzero(IS_STEP[t.kind]).tolist():
        sources = t.pred[t.pred_start[v] : t.pred_start[v + 1]]
        sources = sources[sources >= 0]
        if len(sources):
            yield v, sources


# When a correction is not trusted.

SOLVED = 1e-6  # [m] model against wanted pose
ROUNDING = 1e-9  # [rad] and [m]
UNSOLVED = Reason(
    Code.CORRECTION_UNREACHABLE, "the corrected pose is out of reach on its branch"
)
BEYOND = Reason(
    Code.CORRECTION_BEYOND_LIMIT, "the corrected pose is beyond a joint limit"
)
FLIPPED = Reason(Code.ARM_SWINGS, "the correction would flip the wrist")
NOT_CONVERGED = Reason(
    Code.CORRECTION_UNREACHABLE, "the correction did not converge to 1 um"
)


def guard_solutions(
    reasons: Reasons, arm: Arm, limits: LimitSection, q: Floats, solved: Floats
) -> None:
    """Mark corrected commands that the arm cannot or should not be given.

    Args:
        reasons: Collects the first reason of every visit.
        arm: The arm.
        limits: The cell's guards.
        q: Joint angles of the original command, (n, 6) [rad].
        solved: Joint angles of the corrected command, (n, 6) [rad], NaN where the
            corrected pose has no solution.
    """
    with np.errstate(invalid="ignore"):
        unsolved = has_unknown(solved)
        lost = np.asarray(unsolved & ~has_unknown(q))
        reasons.mark(lost, UNSOLVED)
        over = ~arm.within_limits(solved) & ~unsolved
        reasons.mark(over, BEYOND)
        wrist = np.abs(q[:, 4]) < np.deg2rad(limits.wrist_deg)
        wrist |= np.abs(solved[:, 4]) < np.deg2rad(limits.wrist_deg)
        text = f"within {limits.wrist_deg:g} deg of the wrist singularity"
        reasons.mark(wrist, Reason(Code.SINGULAR_WRIST, text))
        flipped = np.sign(q[:, 4]) != np.sign(solved[:, 4])
        reasons.mark(flipped & ~lost, FLIPPED)


def guard_size(
    reasons: Reasons, limits: LimitSection, correction: Floats, residual: Floats
) -> None:
    """Mark corrections that are too large or did not converge.

    Args:
        reasons: Collects the first reason of every visit.
        limits: The cell's guards.
        correction: Change of the commanded TCP, (n, 3) [m].
        residual: Predicted landing against the wanted position, (n,) [m].
    """
    with np.errstate(invalid="ignore"):
        size = lengths(correction) / MM
        text = f"the correction exceeds correction_mm = {limits.correction_mm:g}"
        too_large = Reason(Code.CORRECTION_TOO_LARGE, text)
        reasons.mark(size > limits.correction_mm, too_large)
        reasons.mark(~(residual <= SOLVED), NOT_CONVERGED)


def guard_motion(reasons: Reasons, limits: LimitSection, moved: JointDeviation) -> None:
    """Mark targets at which joints, elbow or wrist centre would swing too far.

    Args:
        reasons: Collects the first reason of every visit.
        limits: The cell's guards.
        moved: What the corrections do there, n visits.
    """
    for text, far in limit_violations(limits, moved).items():
        reasons.mark(far, Reason(Code.ARM_SWINGS, f"corrected, {text}"))


def limit_violations(limits: LimitSection, moved: JointDeviation) -> dict[str, Bools]:
    """Say what is beyond the limits, and in which of n rows, (n,) each."""
    found = {"the arm would stand on another branch": moved.branch}
    with np.errstate(invalid="ignore"):
        for j, most in enumerate(limits.joint_deg):
            text = f"axis {j + 1} would turn by more than joint_deg = {most:g}"
            found[text] = moved.joints[:, j] > np.deg2rad(most) + ROUNDING
        for what, size, name, most_mm in (
            ("elbow", moved.elbow, "elbow_mm", limits.elbow_mm),
            ("wrist centre", moved.wrist_centre, "wrist_centre_mm",
             limits.wrist_centre_mm),
        ):  # fmt: skip
            text = f"the {what} would move by more than {name} = {most_mm:g}"
            found[text] = size > most_mm * MM + ROUNDING
    return found


def guard_turn(reasons: Reasons, limits: LimitSection, turn: Floats) -> None:
    """Mark corrections that turn the tool too far.

    Args:
        reasons: Collects the first reason of every visit.
        limits: The cell's guards.
        turn: Rotation of the commanded tool, (n, 3) [rad].
    """
    with np.errstate(invalid="ignore"):
        angle = np.rad2deg(lengths(turn))
        text = f"the correction exceeds correction_deg = {limits.correction_deg:g}"
        too_large = Reason(Code.CORRECTION_TOO_LARGE, text)
        reasons.mark(angle > limits.correction_deg, too_large)


# Which targets move, where to, and why the others do not.

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


SHIFTED_APART = (
    "its arrivals need shifts (such as Offs) that differ by more than conflict_mm = "
    "{:g}: give each arrival a move of its own"
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
        before, q = (
            solve_written(visits, arm, rows, numbers[rows], near[rows])
            for numbers, near in ((given, self.planned.plan.q), (new, self.solved.q))
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
            visits, agreement, stay, self.setting.cell, reasons
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
        cloning = visits.dialect.terms.cloning
        stay = {Reason(Code.NUMBERS_USED_ELSEWHERE,
                       f"{why}: give the move a point of its own ({cloning})"): rows
                for why, pins in visits.literals.pins.items()
                if (rows := np.isin(agreement.literal, pins)).any()}  # fmt: skip
        text = f"a target computed from it would land farther off ({cloning})"
        stay[Reason(Code.DEPENDANT_WORSE, text)] = hurt
        options = self.setting.options
        if options.shared_points == "leave":
            count = len(agreement.literal)
            stay[SEVERAL_MOVES] = ~_by_one_move(visits, agreement.group, count)
        elif _may_clone_exported(visits, options) and not options.edit_exported:
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
