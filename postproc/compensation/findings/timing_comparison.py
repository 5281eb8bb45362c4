"""A program as it was written and as it is compensated, run in time and compared."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.findings.approach_advice import advise
from postproc.compensation.options import Job
from postproc.compensation.paths.arcs import NO_ARCS, WantedArcs
from postproc.compensation.paths.corner_error import RoundOff, predict_corners
from postproc.compensation.paths.insertion_report import Insertions
from postproc.compensation.paths.moved_corners import SourceCorners
from postproc.compensation.paths.path_error import PathAccuracy, predict_paths
from postproc.compensation.program import ParsedProgram
from postproc.compensation.solver.targets import targets_from_visits
from postproc.diagnostics import Code
from postproc.language.visits import Diagnostic, Visits
from postproc.motion.cycle_time import ProgramCycle, run
from postproc.motion.directions_from_trajectory import disagreements
from postproc.motion.targets import CODE, LIMITS, PATH_LIMITS
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.pose import MM

MOST_SLOWER = 0.03  # of the cycle time
SHARE, NO_SHARE = 0.1, 0.002  # of a deviation, and [mm]: joints that are named
NO_JOINT = "no joint that changes its flank makes a tenth of it"
FEW = 5  # lines that a finding names
_LIMITS = [CODE[one] for one in (*LIMITS, *PATH_LIMITS)]


@dataclass(frozen=True)
class InTime:
    """n visits, run once.

    Attributes:
        before, after: The program as it was written, and as it is compensated.
        paths: How far it leaves its paths, as the model says.
        guessed: Which limits of the joints the arm file guesses.
        arm: The arm.
        inserted: The points that were put on its ways; None where nobody asked.
        in_motion: What a measured path says of the joints, see `Model.in_motion`.
    """

    before: ProgramCycle
    after: ProgramCycle
    paths: PathAccuracy
    guessed: tuple[str, ...]
    arm: Arm
    inserted: Insertions | None = None
    in_motion: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def other_side(self) -> Bools:
        """Where a joint arrives otherwise in time than along the path, (n, 6)."""
        return disagreements(self.arm, self.after)[self.own]

    @property
    def own(self) -> Ints:
        """The visits of the compensated program that the source makes, (n,)."""
        told = self.inserted
        return np.arange(len(self.before)) if told is None else told.own

    def source(self, rows: Ints) -> Ints:
        """Return the visits of the source that those of the compensated one lead to."""
        return np.where(rows < 0, rows, np.searchsorted(self.own, rows))

    def corners(self, visits: Visits) -> RoundOff:
        """Predict how far rounded corners of the program are passed."""
        return predict_corners(visits, self.before, self.paths)

    def summary(self, visits: Visits) -> str:
        """Say in one line how long it takes, and how well it keeps to its paths."""
        if not self.before.seconds:
            return "no cycle time: no move leads from one known place to another"
        said = f"cycle {self.before.seconds:.1f} -> {self.after.seconds:.1f} s"
        if self.guessed:
            said += f" (from guessed limits: {', '.join(self.guessed)})"
        if not len(self.paths):
            return said
        before, after = self.paths.before.sizes / MM, self.paths.after.sizes / MM
        worst = int(after.argmax())
        v = int(self.paths.visit[worst])
        file = f"{visits.file_name(v)} " if visits.place.file[v] else ""
        place = f"{file}line {visits.place.line[v]}"
        most = f"{self._largest(worst)}, {place} (before: {before.max():.3f} mm)"
        return (
            f"predicted path accuracy AT_p (systematic part): at most {most}; mean "
            f"{before.mean():.3f} -> {after.mean():.3f} mm over {len(before)} moves"
            f"{_round_off(self.corners(visits))}; {said}"
        )

    @property
    def falls_short(self) -> bool:
        """Tell whether it does not run as it did, or keeps not to its paths as asked.

        It is slower than it was, leaves a limit that it kept, or leaves a path farther
        than was asked for.
        """
        return self._is_slower or len(self._beyond) > 0 or len(self._too_far) > 0

    @property
    def _too_far(self) -> Ints:
        """The paths that are left farther than was asked for, the worst first."""
        if self.inserted is None:
            return np.empty(0, dtype=np.int64)
        sizes = self.paths.after.sizes
        order = np.argsort(-sizes, kind="stable")
        return np.asarray(order[sizes[order] > self.inserted.tolerance])

    @property
    def _is_slower(self) -> bool:
        return self.after.seconds > (1 + MOST_SLOWER) * self.before.seconds

    @property
    def _beyond(self) -> Ints:
        """Visits at which a joint comes beyond a limit that it kept before."""
        before, after = (
            np.isin(c.path.reason, _LIMITS) for c in (self.before, self.after)
        )
        return self.source(
            np.flatnonzero(after & ~before[self.source(np.arange(len(after)))])
        )

    def advice(self, rows: Ints) -> dict[int, str]:
        """Say how to approach some visits so that the sides of all joints are known."""
        found = advise(self.arm, self.after, self.own[rows])
        return {int(self.source(np.array([v]))[0]): text for v, text in found.items()}

    def findings(self, visits: Visits) -> Iterator[Diagnostic]:
        """Say where the program does not run as it did, and where it cannot."""
        if self._is_slower:
            text = (
                f"the compensated program takes {self.after.seconds:.1f} s instead of "
                f"{self.before.seconds:.1f} s"
            )
            yield Diagnostic(visits.files[0], 1, Code.CYCLE_TIME_INCREASED, text)
        for v in self._beyond.tolist():
            text = "a joint exceeds a limit that the original program keeps"
            file = visits.file_name(v)
            yield Diagnostic(
                file, int(visits.place.line[v]), Code.JOINT_LIMIT_EXCEEDED, text
            )
        yield from self._report_slowed(visits)
        if self.inserted is not None:
            yield from self._points(visits, self.inserted)
        yield from self._other_sides(visits)

    def _points(self, visits: Visits, told: Insertions) -> Iterator[Diagnostic]:
        """Say what was put on the ways, and which moves still leave their paths."""
        said = (
            (Code.PATH_POINTS, told.points, f"{told.count} points are inserted into "
             f"{len(told.points)} moves; {describe_verification(self.in_motion)}"
             f"{_cell_speed(told)}"),
            (Code.BACKLASH_PRELOAD_SKIPPED, told.unconfirmed,
             "the backlash is not preloaded before "
             f"{len(told.unconfirmed)} moves: neither reversals (survey.reversals) "
             "nor a measured path (diagnose --path) tell closely enough how the joints "
             "change their flanks there"),
            (Code.FAST_STOP_UNCERTAIN, told.fast_stops,
             f"fast JOINT moves reach {len(told.fast_stops)} targets: these are off by "
             f"up to {max(told.fast_stops.values(), default=0.0) / MM:.3f} mm if links "
             "run on there"),
            (Code.REAPPROACH_INSERTED, told.approaches,
             f"{len(told.approaches)} targets are approached "
             "again, from an inserted stop on the path already travelled"),
        )  # fmt: skip
        for code, moves, text in said:
            if moves:
                first = min(moves)
                place = (
                    visits.file_name(first),
                    int(visits.place.line[first]),
                )
                yield Diagnostic(*place, code, text)
        for k in self._too_far.tolist():
            v = int(self.paths.visit[k])
            why = told.left.get(v, "more points do not help")
            most = self._largest(k, NO_JOINT)
            text = f"the predicted path error of the move is {most}: {why}"
            text += f". {told.cures[v]}" if v in told.cures else ""
            place = visits.file_name(v), int(visits.place.line[v])
            yield Diagnostic(*place, Code.PATH_TOLERANCE_EXCEEDED, text)

    def _largest(self, k: int, none: str = "") -> str:
        """Say how far a path is left the most, where, and what each joint makes.

        Args:
            k: The path.
            none: What is said where no joint makes a tenth of it.
        """
        after = self.paths.after
        size, at = after.sizes[k] / MM, self.paths.way[after.largest[k]] / MM
        shares = after.shares[k] / MM
        told = ", ".join(
            f"joint {j + 1} {shares[j]:.3f} mm"
            for j in np.argsort(-shares, kind="stable").tolist()
            if shares[j] > max(SHARE * size, NO_SHARE)
        )
        told = told or none
        return f"{size:.3f} mm, {at:.0f} mm from its start" + (told and f" ({told})")

    def _other_sides(self, visits: Visits) -> Iterator[Diagnostic]:
        """Say where joints arrive otherwise in time than along the path."""
        for v in np.flatnonzero(self.other_side.any(axis=1)).tolist():
            joints = (np.flatnonzero(self.other_side[v]) + 1).tolist()
            text = (
                f"joint {' and '.join(map(str, joints))} arrives in the other "
                "direction in the trajectory over time than along the path; the "
                "correction is that of the path"
            )
            file = visits.file_name(v)
            yield Diagnostic(
                file, int(visits.place.line[v]), Code.DIRECTION_DISAGREES, text
            )

    def _report_slowed(self, visits: Visits) -> Iterator[Diagnostic]:
        """Say where the joints cannot follow the programmed speed."""
        slowed = self.after.slow_moves
        if not len(slowed):
            return
        rows = self.source(slowed)
        lines = visits.list_lines(rows, visits.place.file[rows[0]])
        more = f" and {len(lines) - FEW} more" if len(lines) > FEW else ""
        worst = slowed[self.after.clock.allowed[slowed].argmin()]
        least = 100 * self.after.clock.allowed[worst]
        joint = int(self.after.clock.velocity[worst].argmax()) + 1
        text = (
            f"the joints reach {least:.0f} % of the programmed speed at the least, "
            f"where axis {joint} is nearest to its limit: the controller slows down "
            "or stops there, usually near a singularity "
            f"(lines {', '.join(lines[:FEW])}{more})"
        )
        place = (
            visits.file_name(rows[0]),
            int(visits.place.line[rows[0]]),
        )
        yield Diagnostic(*place, Code.SPEED_NOT_REACHED, text)


def _cell_speed(told: Insertions) -> str:
    """Say at which speed moves are judged whose program sets none, "" if it does."""
    said = ""
    if told.cell_mm_s:
        said += (
            f"; where the program sets no speed, {told.cell_mm_s:g} mm/s counts, "
            "[motion] linear_mm_s of the cell"
        )
    if told.limit_mm_s:
        said += (
            f"; where the speed is not known, pieces are as long as {told.limit_mm_s:g}"
            " mm/s needs, [motion] linear_limit_mm_s of the cell"
        )
    return said


def _round_off(corners: RoundOff) -> str:
    """Say how far rounded corners are passed, "" where there are none."""
    if not len(corners):
        return ""
    before, after = corners.before.max() / MM, corners.after.max() / MM
    return (
        f"; cornering round-off CR (systematic part) max {before:.3f} -> "
        f"{after:.3f} mm at {len(corners)} corners"
    )


def run_in_time(
    reading: ParsedProgram,
    again: ParsedProgram,
    position: Floats,
    setting: Job,
    owner: Ints | None = None,
    arcs: WantedArcs = NO_ARCS,
    corners: SourceCorners | None = None,
    source: PathAccuracy | None = None,
) -> InTime:
    """Run a program in time, as it was written and as it is compensated.

    Args:
        reading: The program.
        again: The output, parsed again.
        position: Where the program wants the TCP, (n, 3) [m]; see `WindowResult`.
        setting: What it was compensated with.
        owner: The move of the source that every visit belongs to, (n,), where points
            were put on ways.
        arcs: The arcs of the source that were cut.
        corners: How the source passes the visits; None: as the program does.
        source: What tells of the program as it was written; None: that is predicted.
    """
    cell = setting.cell
    before, after = (run_visits(part.visits, cell) for part in (reading, again))
    passed = cell.arm.tcp(before.path.q, before.targets.tool[:, :3, 3])
    shift = np.nan_to_num(position + before.path.aside - passed)
    paths = predict_paths(
        before, after, shift, cell, setting.model, setting.temperature, owner, arcs,
        corners, source,
    )  # fmt: skip
    guessed, told = list_guessed_limits(cell.arm), setting.model.in_motion
    return InTime(before, after, paths, guessed, cell.arm, in_motion=told)


def describe_verification(in_motion: Mapping[str, str]) -> str:
    """Say whether a measured path has shown what the model says of joints in motion.

    >>> describe_verification({"1": "confirmed", "2": "refuted"})
    'a measured path confirms the flanks of joint 1, not those of 2'
    """
    if not in_motion:
        return (
            "a model that was fitted at stops is unverified in motion until a "
            "measured path confirms it (diagnose --path)"
        )
    joints = {word: [j for j, said in in_motion.items() if said == word]
              for word in set(in_motion.values())}  # fmt: skip
    good = ", ".join(joints.pop("confirmed", [])) or "none"
    rest = ", ".join(sorted(j for some in joints.values() for j in some))
    said = f"a measured path confirms the flanks of joint {good}"
    return f"{said}, not those of {rest}" if rest else said


def run_visits(visits: Visits, cell: Cell) -> ProgramCycle:
    """Run a program once, in time."""
    targets, _ = targets_from_visits(visits, cell)
    return run(cell.arm, targets)


def list_guessed_limits(arm: Arm) -> tuple[str, ...]:
    """Name the limits of the joints that the arm file guesses, or does not tell."""
    told = arm.file.joints
    absent = {
        "acceleration": told.acceleration_deg_s2 is None,
        "jerk": told.jerk_deg_s3 is None,
    }
    more = (name for name in absent if absent[name] and name not in told.guessed)
    return (*told.guessed, *more)
