"""What is kept of corrected visits: of a window, of a program, of several programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import accumulate
from mmap import mmap
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import (
    Bools,
    Floats,
    Indices,
    Interned,
    Ints,
    any_in_rows,
    isin_sorted,
)
from postproc.compensation.eligibility.configuration_flags import find_overruled
from postproc.compensation.outcome import Decisions, find_judged
from postproc.compensation.program import ParsedProgram, PlannedProgram
from postproc.compensation.solver.decisions import NONE
from postproc.compensation.solver.dependants import (
    moves_along,
    with_what_moves_along,
)
from postproc.compensation.solver.expected_error import ErrorLaws, LengthLaw
from postproc.compensation.solver.iterate import Converged
from postproc.diagnostics import NO_REASON
from postproc.language.text.source import Replacements
from postproc.language.visits import Visits
from postproc.model.model import Model, Prediction
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.robot.state import States

if TYPE_CHECKING:
    from postproc.compensation.findings.timing_comparison import InTime
    from postproc.compensation.output.rewrite import Output

T = TypeVar("T", bound="WindowResult | Decisions | ErrorLaws | LengthLaw")
Make = Callable[[tuple[int, ...], np.dtype[Any]], NDArray[Any]]
ALL = slice(None)
AS_A_WHOLE = ("edited", "edits", "departure", "reasons")
"""Fields that hold no row for each visit."""


@dataclass(frozen=True)
class WindowResult:
    """A corrected program without poses, paths and plans (structure of arrays).

    Attributes:
        edited: Literals that get new numbers, (m,).
        edits: The edits of these, file by file.
        decisions: What was decided for n visits.
        corrected: Visits whose target moves, (n,).
        before, after: Size of their predicted error, (n,) [m], NaN at all others.
        laws: How the lengths of their true errors are distributed.
        position: Where the program wants the TCP, (n, 3) [m], base frame.
        away: How far the path passes it, (n,) [mm].
        overruled: The path does not follow the configuration string, and nobody said
            that it must, (n,).
        untimed: No time law was found, (n,).
        travel: Of every joint since its last reversal, (n, 6) [rad].
        speed: Of the TCP, (n,) [m/s], NaN where nobody asked.
        departure: Largest change on the way to every visit of a joint [rad], elbow,
            wrist centre and TCP [m], (n, 4), NaN where not known.
    """

    edited: Indices
    edits: tuple[Replacements, ...]
    decisions: Decisions
    corrected: Bools
    before: Floats
    after: Floats
    laws: ErrorLaws
    position: Floats
    away: Floats
    overruled: Bools
    untimed: Bools
    travel: Floats
    speed: Floats
    departure: Floats

    def take(self, rows: slice | Ints) -> WindowResult:
        """Return the columns of some visits, in any order, with all edits."""
        by_visit = len(self.departure) == len(self.corrected)
        departure = self.departure[rows] if by_visit else self.departure
        return replace(map_columns(self, lambda c: c[rows]), departure=departure)

    def of_window(self, visits: Visits, own: slice) -> WindowResult:
        """Return the fields of a window as a whole, without rows of its visits.

        Args:
            visits: Those that were worked through.
            own: Those of the window; they share no number with the others.
        """
        literals = np.sort(visits.target.literal[own])
        mine = isin_sorted(self.edited, literals)
        starts = np.sort(visits.literals.places[self.edited[mine]].start, axis=None)
        edits = tuple(
            Replacements(e.start[at], e.end[at], e.new[at])
            for e in self.edits
            for at in [isin_sorted(e.start, starts)]
        )
        return replace(
            map_columns(self, lambda column: np.array(column[:0])),
            edited=self.edited[mine].astype(np.int32),
            edits=edits,
            departure=np.fmax.reduce(self.departure[own], axis=0, keepdims=True),
        )

    def put(self, rows: slice, part: WindowResult, own: slice = ALL) -> None:
        """Enter some visits of a part of the program, in place."""
        there = list_columns(part)
        for name, column in list_columns(self).items():
            if len(column):
                column[rows] = there[name][own]

    def rows(self, some: slice) -> dict[str, NDArray[Any]]:
        """Return what is kept of some visits, as windows compare it.

        The laws of errors follow from that.
        """
        d = self.decisions
        why = [d.reasons[k] for k in d.why[some].tolist()]
        own = {"departure": self.departure, **list_columns(self)}
        del own["decisions.why"]
        own = {k: np.array(c[some]) for k, c in own.items() if k[:5] != "laws."}
        return own | {"why": np.array(why, dtype=object)}


def map_columns(part: T, change: Callable[[NDArray[Any]], NDArray[Any]]) -> T:
    """Change all columns of a row for each visit; those without rows stay."""
    changed: dict[str, Any] = {}
    for f in fields(part):
        value = getattr(part, f.name)
        if isinstance(value, Decisions | ErrorLaws | LengthLaw):
            changed[f.name] = map_columns(value, change)
        elif f.name not in AS_A_WHOLE and isinstance(value, np.ndarray) and len(value):
            changed[f.name] = change(value)
    return replace(part, **changed)


def list_columns(part: Any, lead: str = "") -> dict[str, NDArray[Any]]:
    """List the columns of a row for each visit by their names."""
    found: dict[str, NDArray[Any]] = {}
    for f in fields(part):
        value = getattr(part, f.name)
        if isinstance(value, Decisions | ErrorLaws | LengthLaw):
            found |= list_columns(value, f"{lead}{f.name}.")
        elif f.name not in AS_A_WHOLE and isinstance(value, np.ndarray):
            found[f"{lead}{f.name}"] = value
    return found


# Room for all visits of a program, which its windows fill.


def room_like(example: WindowResult, n: int, make: Make = np.empty) -> WindowResult:
    """Make room for n visits.

    Args:
        example: Has the columns, with a row at least.
        n: How many visits there will be.
        make: Makes an array of a shape and type.
    """
    return map_columns(example, lambda c: make((n, *c.shape[1:]), c.dtype))


def in_shared_memory(shape: tuple[int, ...], kind: np.dtype[Any]) -> NDArray[Any]:
    """Make an array that processes forked from this one can fill."""
    size = int(np.prod(shape)) * kind.itemsize
    return np.ndarray(shape, kind, mmap(-1, max(size, 1)))


def example_of(width: int, turned: bool) -> WindowResult:
    """Return a row of all columns, without values.

    Args:
        width: Numbers of a target.
        turned: Orientations are corrected, too.
    """
    one, three, six = np.zeros(1), np.zeros((1, 3)), np.zeros((1, 6))
    said, law = np.zeros(1, dtype=bool), LengthLaw(one, one, one, one)
    decisions = Decisions(
        status=np.zeros(1, dtype=np.int8), why=np.zeros(1, dtype=np.int32),
        reasons=(), q=six, direction=np.zeros((1, 6), dtype=np.int8), side=six,
        corrected=np.zeros((1, width)), correction=three, std_error=three,
        turn=three if turned else NONE,
    )  # fmt: skip
    return WindowResult(
        edited=np.zeros(0, dtype=np.int32), edits=(), decisions=decisions,
        corrected=said, before=one, after=one, laws=ErrorLaws(law, law, said),
        position=three, away=one, overruled=said, untimed=said, travel=six, speed=one,
        departure=np.zeros((0, 4)),
    )  # fmt: skip


def join_windows(parts: Sequence[WindowResult]) -> WindowResult:
    """Put parts of a program one after the other."""
    if len(parts) == 1:
        return parts[0]
    ends = [0, *accumulate(len(part.corrected) for part in parts)]
    whole = room_like(parts[0], ends[-1])
    for rows, part in zip(map(slice, ends, ends[1:]), parts, strict=False):
        whole.put(rows, part)
    return complete_room(whole, parts, ends)


def complete_room(
    whole: WindowResult, parts: Sequence[WindowResult], ends: Sequence[int]
) -> WindowResult:
    """Add the fields of windows to a program whose visits have been entered.

    Args:
        whole: The visits; the reasons of each window have numbers of its own.
        parts: The windows.
        ends: Their first visits, and at last how many there are.
    """
    numbers, why = Interned([NO_REASON]), whole.decisions.why
    for rows, part in zip(map(slice, ends, ends[1:]), parts, strict=False):
        why[rows] = numbers.of(part.decisions.reasons)[why[rows]]
    edits = zip(*(part.edits for part in parts), strict=True)
    return replace(
        whole,
        edited=np.concatenate([part.edited for part in parts]),
        edits=tuple(Replacements.merge(some) for some in edits),
        decisions=replace(whole.decisions, reasons=tuple(numbers)),
        departure=np.concatenate([part.departure for part in parts]),
    )


@dataclass(frozen=True)
class CompensatedProgram:
    """A corrected program, before it is told of.

    Attributes:
        reading: The program.
        kept: What came of its visits.
        output: What is to be written.
        in_time: The program in time; None where nobody asked.
    """

    reading: ParsedProgram
    kept: WindowResult
    output: Output
    in_time: InTime | None


def correction_of(
    visits: Visits,
    planned: PlannedProgram,
    states: States,
    found: Converged,
    cell: Cell,
    model: Model,
) -> WindowResult:
    """Keep what a report says of corrected visits."""
    proposal, done, plan = found.proposal, found.reached, planned.plan
    moved = proposal.corrected
    along = moves_along(visits, planned, cell, proposal.decisions)
    decided = with_what_moves_along(visits, proposal.decisions, along)
    new = states.with_(q=np.array(done.q), direction=np.array(done.side))[moved]
    wanted = plan.tcp[:, :3, 3] + planned.shift
    before, after = np.full((2, len(visits)), np.nan)
    error = _errors_planned(states, decided, found.foreseen, moved, cell, model)
    before[moved] = np.linalg.norm(error - planned.shift[moved], axis=1)
    error = done.tcp[moved, :3, 3] + model.error(cell.arm, new) - wanted[moved]
    after[moved] = np.linalg.norm(error, axis=1)
    judged = find_judged(visits, decided)
    return WindowResult(
        edited=proposal.edited,
        edits=found.edits,
        decisions=decided,
        corrected=moved,
        before=before,
        after=after,
        laws=ErrorLaws.of(
            found.foreseen, model.reading_spread, decided.correction + along, judged
        ),
        position=wanted - plan.aside,
        away=np.linalg.norm(np.nan_to_num(plan.aside), axis=1) / MM,
        overruled=find_overruled(planned.targets, plan).find_unchecked(visits),
        untimed=plan.untimed,
        travel=plan.travel,
        speed=plan.speed,
        departure=found.moved.sizes,
    )


def _errors_planned(
    states: States,
    decided: Decisions,
    foreseen: Prediction,
    moved: Bools,
    cell: Cell,
    model: Model,
) -> Floats:
    """Return the errors at the k visits that move as they were planned, (k, 3) [m].

    Most are foreseen: a target is corrected for the sides that were planned, but where
    the correction changes them.
    """
    other = np.array(moved)
    if not model.evaluator(cell.arm).given:  # which may depend on the visit before
        other &= any_in_rows(states.direction != decided.side)
    out = np.array(foreseen.error)
    out[other] = model.error(cell.arm, states[other])
    return out[moved]
