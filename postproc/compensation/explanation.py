"""Why every target moves: where it is reached from, and what that costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from postproc.arrays import Floats, Ints, Signs, columns_of, data_frame
from postproc.compensation.compensate import compensate_files
from postproc.compensation.findings.timing_comparison import InTime
from postproc.compensation.options import DEFAULT_OPTIONS, Options
from postproc.compensation.outcome import Outcome
from postproc.compensation.program import (
    ParsedProgram,
    PlannedProgram,
    assuming,
    plan_visits,
    read_program,
)
from postproc.compensation.program_files import NO_PAGES, ProgramFiles, program_files
from postproc.diagnostics import Reason
from postproc.exceptions import ProgramError
from postproc.language.languages import UNNAMED
from postproc.language.visits import (
    ELSEWHERE,
    START,
    Diagnostic,
    Visits,
    deduplicate,
)
from postproc.model.model import Model, as_model
from postproc.robot.cell import Cell, as_cell
from postproc.threads import in_one_thread

if TYPE_CHECKING:
    from postproc.arrays import DataFrame


# Columns of an outcome that an explanation has, too.
KEPT = frozenset(
    (
        "status",
        "code",
        "reason",
        "dx_mm",
        "dy_mm",
        "dz_mm",
        "std_x_mm",
        "std_y_mm",
        "std_z_mm",
    )
)


@dataclass(frozen=True)
class Explanation:
    """How the arm gets to the targets of a program, and what corrects them.

    Attributes:
        visits: Every arrival at a target.
        q: Joint angles there, (n, 6) [rad], NaN where not known.
        direction: Side every joint arrives from, (n, 6): +1, -1, or 0 where not known;
            with a model that for which the visit is corrected.
        travel: Of every joint since its last reversal, (n, 6) [rad].
        reasons: Why a visit cannot be compensated, (n,); without a model.
        outcome: The compensation, or None without a model.
        diagnostics: What was found in the program.
    """

    visits: Visits
    q: Floats
    direction: Signs
    travel: Floats
    reasons: Sequence[Reason]
    outcome: Outcome | None
    diagnostics: tuple[Diagnostic, ...] = ()

    @classmethod
    def of_plan(cls, reading: ParsedProgram, planned: PlannedProgram) -> Self:
        """Explain a plan."""
        visits, told = reading.visits, deduplicate(reading.diagnostics)
        plan, every = planned.plan, planned.reasons.all
        reasons = [every[k] for k in planned.reasons.index.tolist()]
        direction = plan.direction.astype(np.int8)
        return cls(visits, plan.q, direction, plan.travel, reasons, None, told)

    @classmethod
    def of_outcome(cls, outcome: Outcome) -> Self:
        """Explain a compensation by what it has planned."""
        d, arrivals = outcome.decisions, outcome.arrivals
        n = len(outcome.visits)
        travel = np.full((n, 6), np.nan) if arrivals is None else arrivals.travel
        told = outcome.diagnostics
        return cls(outcome.visits, d.q, d.direction, travel, (), outcome, told)

    def findings(self, line: int | None = None) -> list[Diagnostic]:
        """Return what was found in the program, or on one line of it."""
        return [d for d in self.diagnostics if line in (None, d.line)]

    def __str__(self) -> str:
        """Say what came of the program; see `summary`."""
        return self.summary()

    @property
    def in_time(self) -> InTime | None:
        """The program run in time, None where nobody asked."""
        return None if self.outcome is None else self.outcome.in_time

    def to_frame(self) -> DataFrame:
        """Return a data frame, one row a visit, in the order of the program.

        Columns: line, target, from (the lines it is reached from), the commanded
        joint angles (``q1_deg`` ..) and the sides they arrive from (``lambda1`` ..);
        then status, code, reason and correction as `Outcome.to_frame` has them, or,
        without a model, why a visit cannot be compensated.
        """
        v, rows = self.visits, range(len(self.visits))
        columns: dict[str, object] = {
            "line": [self.line_of(i) for i in rows],
            "target": [v.target.names[k] for k in v.target.name.tolist()],
            "from": [self.name_origins(i) for i in rows],
            **columns_of([f"q{k}_deg" for k in range(1, 7)], np.rad2deg(self.q)),
            **columns_of([f"lambda{k}" for k in range(1, 7)], self.direction),
        }
        if self.outcome is None:
            codes = [reason.name for reason in self.reasons]
            texts = [reason.text for reason in self.reasons]
            return data_frame(columns | {"code": codes, "reason": texts})
        told = self.outcome.to_frame()
        return data_frame(columns | {name: told[name] for name in told if name in KEPT})

    def summary(self) -> str:
        """Say in one line what came of the program."""
        if self.outcome is not None:
            said = [self.outcome.summary()]
            if self.outcome.in_time is not None:
                said.append(self.outcome.in_time.summary(self.visits))
            return "\n".join(said)
        known = np.isfinite(self.q).all(axis=1)
        return f"{len(self.visits)} visits, {int((~known).sum())} without joint angles"

    def name_origins(self, i: int) -> str:
        """Name the lines that visit i is reached from."""
        names = {START: "start", ELSEWHERE: "unknown"}
        before = self.visits.graph.predecessors(i)
        told = [names.get(int(p)) or self.line_of(int(p), "line ") for p in before]
        return ", ".join(dict.fromkeys(told))

    def line_of(self, i: int, word: str = "") -> str:
        """Name the line of visit i; that of a page with the page's name."""
        v = self.visits
        return f"{f'{v.file_name(i)}:' if v.place.file[i] else word}{v.place.line[i]}"

    def choose_visits(self, line: int | None) -> Ints:
        """Choose the visits to show: those whose move or literal is on a line."""
        v = self.visits
        if line is None:
            return np.arange(len(v))
        found = v.place.line == line
        if len(v.literals):
            found = found | (
                (v.target.literal >= 0)
                & (v.literals.line[v.target.literal] == line)
                & (v.literals.file[v.target.literal] == 0)
            )
        if not found.any():
            raise ProgramError(
                v.files[0],
                "no target is reached or written here",
                "Take a line that holds a move or the numbers of its target",
                line=line,
            )
        return np.flatnonzero(found)


@in_one_thread
def explain(
    program: str | Path | bytes | ProgramFiles,
    cell: Cell | str | Path,
    model: Model | str | Path | None = None,
    *,
    name: str = UNNAMED,
    variables: bytes | str | Path | None = None,
    pages: Mapping[str, bytes] = NO_PAGES,
    options: Options = DEFAULT_OPTIONS,
) -> Explanation:
    """Say of every target where the arm comes from, and why it moves.

    Args:
        program: As `compensate` takes it.
        cell: The robot's surroundings, or where they are described.
        model: The arm's error, or its file; without one the program is planned only.
        name: File name of bytes.
        variables: The variable file, where there is one: a path, or bytes.
        pages: Further programs, as `compensate` takes them.
        options: What the user asks of a compensation.

    Raises:
        PostprocError: The program, the cell or the model cannot be used.
    """
    given = program_files(program, name, variables, pages)
    cell = as_cell(cell)
    if model is not None:
        fitted = as_model(model, cell.arm)
        return Explanation.of_outcome(compensate_files(given, cell, fitted, options))
    cell = assuming(cell, options)
    reading = read_program(given.by_name, cell)
    return Explanation.of_plan(reading, plan_visits(reading.visits, cell))
