"""Why every target moves: where it is reached from, and what that costs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.cli.jobs import read_files
from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.program import (
    Planned,
    plan_visits,
    read_program,
    with_measured_play,
)
from postproc.exceptions import ProgramError, printable
from postproc.files import is_variables
from postproc.language.visits import ELSEWHERE, START, Visits
from postproc.model.model import Model, load_model
from postproc.report.json import target_row
from postproc.report.terminal import Column, arrows, print_table, status_colour
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import MM

STATUS = "status, why"
FEW = 3  # places of origin that a row names
COLUMNS = (
    Column("line"),
    Column("target", "left"),
    Column("from", "left"),
    Column("q [deg]"),
    Column("J1-6", "left"),
    Column("correction x, y, z [mm]"),
    Column("+- x, y, z [mm]"),
    Column(STATUS, "left"),
)
PLANNED = (*COLUMNS[:5], Column(STATUS, "left"))  # without a model


@dataclass(frozen=True)
class Explanation:
    """A planned program, and what its compensation would do.

    Attributes:
        visits: Every arrival at a target.
        planned: How the arm gets there.
        outcome: The compensation, or None without a model.
    """

    visits: Visits
    planned: Planned
    outcome: Outcome | None

    def to_json(self, line: int | None = None) -> str:
        """Return one object per visit as JSON text.

        Raises:
            ProgramError: There is no target on the line asked for.
        """
        rows = [self.row(i) for i in self._chosen(line)]
        return json.dumps({"visits": rows}, indent=1) + "\n"

    def row(self, i: int) -> dict[str, object]:
        """Describe visit i."""
        plan, v = self.planned.plan, self.visits
        if self.outcome is not None:
            row = target_row(self.outcome, i)
        else:
            row = {
                "line": int(v.line[i]),
                "name": v.names[v.name[i]] or None,
                "q_deg": _known(np.rad2deg(plan.q[i])),
                "lambda": [int(s) for s in plan.direction[i]],
                "why": self.planned.reasons[i],
            }
        travel = _known(np.rad2deg(plan.travel[i]))
        return {**row, "from": self._from(i), "travel_deg": travel}

    def print(self, line: int | None = None) -> None:
        """Print a table, one row per visit, and how many came out how.

        Raises:
            ProgramError: There is no target on the line asked for.
        """
        rows = self._chosen(line)
        cells = (self._cells(i) for i in rows)
        columns = PLANNED if self.outcome is None else COLUMNS
        print_table(columns, cells, {STATUS: status_colour})
        if line is None:
            print(self.summary())

    def summary(self) -> str:
        """Say in one line what came of the program."""
        if self.outcome is not None:
            return printable(self.outcome.summary())
        known = np.isfinite(self.planned.plan.q).all(axis=1)
        return f"{len(self.visits)} visits, {int((~known).sum())} of them not planned"

    def _cells(self, i: int) -> list[str]:
        """Write visit i as the cells of a table row."""
        plan, v = self.planned.plan, self.visits
        name = v.names[v.name[i]] or ("VIA" if v.via[i] else "inline")
        sides = arrows(self._direction(i))
        angles = " ".join(_told(q, 8, 3) for q in np.rad2deg(plan.q[i]))
        cells = [self._line(i), name, _few(self._from(i)), angles, sides]
        if self.outcome is None:
            return [*cells, self.planned.reasons[i]]
        d = self.outcome.decisions
        moved = " ".join(_told(c, 7, 3) for c in d.correction[i] / MM)
        sure = " ".join(_told(s, 5, 3) for s in d.std_error[i] / MM)
        status = Status(d.status[i]).name.lower()
        why = d.reasons[d.why[i]]
        return [*cells, moved, sure, f"{status}: {why}" if why else status]

    def _direction(self, i: int) -> np.ndarray:
        """Return the direction that visit i is compensated for."""
        if self.outcome is None:
            return np.asarray(self.planned.plan.direction[i])
        return np.asarray(self.outcome.decisions.direction[i])

    def _from(self, i: int) -> str:
        """Name the lines that visit i is reached from."""
        names = {START: "start", ELSEWHERE: "unknown"}
        before = self.visits.predecessors(i)
        told = [names.get(int(p)) or self._line(int(p), "line ") for p in before]
        return ", ".join(dict.fromkeys(told))

    def _line(self, i: int, word: str = "") -> str:
        """Name the line of visit i; that of a page with the page's name."""
        v = self.visits
        return f"{f'{v.files[v.file[i]]}:' if v.file[i] else word}{v.line[i]}"

    def _chosen(self, line: int | None) -> list[int]:
        """Choose the visits to show: those whose move or literal is on a line."""
        v = self.visits
        if line is None:
            return list(range(len(v)))
        found = v.line == line
        if len(v.literals):
            found = found | (
                (v.literal >= 0)
                & (v.literals.line[v.literal] == line)
                & (v.literals.file[v.literal] == 0)
            )
        if not found.any():
            raise ProgramError(
                v.files[0],
                "no target is reached or written here",
                "Take a line that holds a move or the numbers of its target",
                line=line,
            )
        return np.flatnonzero(found).tolist()


def _few(places: str) -> str:
    """Shorten a list of places that a visit is reached from.

    >>> _few("line 3, line 5, line 7, line 9")
    'line 3, line 5 and 2 more'
    """
    listed = places.split(", ")
    if len(listed) <= FEW:
        return places
    return f"{', '.join(listed[: FEW - 1])} and {len(listed) - FEW + 1} more"


def _told(value: float, width: int, digits: int) -> str:
    """Write a number; a dash where it is not known."""
    return f"{value:{width}.{digits}f}" if np.isfinite(value) else "-".rjust(width)


def _known(values: np.ndarray) -> list[float | None]:
    """Round; what is not known becomes None."""
    return [round(float(v), 5) if np.isfinite(v) else None for v in values]


def explain(
    files: dict[str, bytes],
    cell: Cell,
    model: Model | None,
    temperature: float | None = None,
) -> Explanation:
    """Plan a program and, with a model, compensate it.

    Raises:
        PostprocError: The program, the cell or the model cannot be used.
    """
    if model is not None:
        cell = with_measured_play(cell, model)
    reading = read_program(files, cell)
    planned = plan_visits(reading.visits, cell)
    outcome = None
    if model is not None:
        (name, source), *rest = files.items()
        values = {n: data for n, data in rest if is_variables(n)}
        outcome = compensate(
            source,
            cell,
            model,
            name=name,
            variables=next(iter(values.values()), None),
            pages={n: data for n, data in rest if n not in values},
            options=Options(temperature=temperature),
        )
    return Explanation(reading.visits, planned, outcome)


def explain_file(
    program: Path,
    cell: Path,
    model: Path | None,
    lsv: Path | None,
    temperature: float | None,
) -> Explanation:
    """Explain a program on disk.

    Raises:
        PostprocError: A file cannot be read or used.
    """
    files = read_files(program, lsv)
    fitted = None if model is None else load_model(model)
    return explain(files, load_cell(cell), fitted, temperature)
