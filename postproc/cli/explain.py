"""Why every target moves: where it is reached from, and what that costs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from postproc.arrays import Floats, Ints, Signs
from postproc.cli.jobs import read_files
from postproc.compensation.arrivals import ArrivalStates
from postproc.compensation.compensate import compensate
from postproc.compensation.in_time import InTime
from postproc.compensation.options import AS_USUAL, Options
from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.program import (
    Planned,
    Reading,
    plan_visits,
    read_program,
)
from postproc.exceptions import ProgramError, printable
from postproc.files import is_variables
from postproc.language.visits import (
    ELSEWHERE,
    START,
    Diagnostic,
    Visits,
    told_once,
)
from postproc.model.model import Model, load_model
from postproc.report.json import target_rows
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
IN_TIME = (Column("v [mm/s]"), Column("AT_p [mm]"))  # where it was run in time
PLANNED = (*COLUMNS[:5], Column(STATUS, "left"))  # without a model
SHARES = (Column("effect", "left"), *map(Column, ("share mm", "x", "y", "z")))
WHOLE = "predicted error"  # the sum of the shares
PART = ("of it free forms", "+- free forms")  # what no law predicts, and how surely


@dataclass(frozen=True)
class Explanation:
    """How the arm gets to the targets of a program, and what corrects them.

    Attributes:
        visits: Every arrival at a target.
        q: Joint angles there, (n, 6) [rad], NaN where not known.
        direction: Side every joint arrives from, (n, 6): +1, -1, or 0 where not known;
            with a model that for which the visit is corrected.
        travel: Of every joint since its last reversal, (n, 6) [rad].
        why: Why a visit cannot be compensated, (n,); without a model.
        outcome: The compensation, or None without a model.
        diagnostics: What was found in the program.
    """

    visits: Visits
    q: Floats
    direction: Signs
    travel: Floats
    why: Sequence[str]
    outcome: Outcome | None
    diagnostics: tuple[Diagnostic, ...] = ()

    @classmethod
    def of_plan(cls, reading: Reading, planned: Planned) -> Self:
        """Explain a plan."""
        visits, told = reading.visits, told_once(reading.diagnostics)
        plan, reasons = planned.plan, planned.reasons
        why = [reasons[i] for i in range(len(visits))]
        direction = plan.direction.astype(np.int8)
        return cls(visits, plan.q, direction, plan.travel, why, None, told)

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

    def to_json(self, line: int | None = None) -> str:
        """Return one object per visit as JSON text.

        Raises:
            ProgramError: There is no target on the line asked for.
        """
        chosen = self._chosen(line)
        if self.outcome is not None:
            told = target_rows(self.outcome, chosen)
        else:
            told = map(self._plan_row, chosen.tolist())
        rows = [
            {**row, "from": self._from(i), "travel_deg": _known_deg(self.travel[i])}
            for i, row in zip(chosen.tolist(), told, strict=True)
        ]
        return json.dumps({"visits": rows}, indent=1) + "\n"

    def _plan_row(self, i: int) -> dict[str, object]:
        """Describe visit i without a model."""
        v = self.visits
        return {
            "line": int(v.line[i]),
            "name": v.names[v.name[i]] or None,
            "q_deg": _known_deg(self.q[i]),
            "lambda": [int(s) for s in self.direction[i]],
            "why": self.why[i],
        }

    def print(self, line: int | None = None) -> None:
        """Print a table, one row per visit, and how many came out how.

        Of one line, the shares of the effects in every visit follow instead.

        Raises:
            ProgramError: There is no target on the line asked for.
        """
        rows = self._chosen(line)
        cells = (self._cells(i) for i in rows.tolist())
        columns: Sequence[Column] = PLANNED if self.outcome is None else COLUMNS
        if self._in_time is not None:
            columns = (*COLUMNS[:-1], *IN_TIME, COLUMNS[-1])
        print_table(columns, cells, {STATUS: status_colour})
        if line is None:
            print(self.summary())
        elif self.outcome is not None and self.outcome.arrivals is not None:
            shares = self.outcome.arrivals.shares(rows) / MM
            free = self.outcome.arrivals.free(rows) / MM
            for i, own, part in zip(rows.tolist(), shares, free, strict=True):
                self._print_shares(i, own, part, self.outcome.arrivals)

    def _print_shares(
        self, i: int, shares: Floats, free: Floats, told: ArrivalStates
    ) -> None:
        """Print which of k effects has which share in the error there.

        Args:
            i: The visit.
            shares: Of the effects, (k, 3) [mm].
            free: What free forms have of it, and how surely, (2, 3) [mm].
            told: Names the effects.
        """
        if not np.isfinite(shares).any():
            return
        sizes = np.linalg.norm(shares, axis=1)
        order = np.argsort(-sizes, kind="stable").tolist()
        rows = [_share_cells(told.effects[k], shares[k]) for k in order]
        rows.append(_share_cells(WHOLE, shares.sum(axis=0)))
        if told.free_forms:
            rows += map(_share_cells, PART, free)
        place = f"{self._line(i, 'line ')} from {_few(self._from(i))}:"
        print(f"\n{printable(place)}")
        print_table(SHARES, rows)

    def summary(self) -> str:
        """Say in one line what came of the program."""
        if self.outcome is not None:
            said = [self.outcome.summary()]
            if self.outcome.in_time is not None:
                said.append(self.outcome.in_time.summary(self.visits))
            return "\n".join(map(printable, said))
        known = np.isfinite(self.q).all(axis=1)
        return f"{len(self.visits)} visits, {int((~known).sum())} of them not planned"

    def _cells(self, i: int) -> list[str]:
        """Write visit i as the cells of a table row."""
        v = self.visits
        name = v.names[v.name[i]] or ("VIA" if v.via[i] else "inline")
        sides = arrows(self.direction[i])
        angles = " ".join(_told(q, 8, 3) for q in np.rad2deg(self.q[i]))
        cells = [self._line(i), name, _few(self._from(i)), angles, sides]
        if self.outcome is None:
            return [*cells, self.why[i]]
        d = self.outcome.decisions
        moved = " ".join(_told(c, 7, 3) for c in d.correction[i] / MM)
        sure = " ".join(_told(s, 5, 3) for s in d.std_error[i] / MM)
        status = Status(d.status[i]).name.lower()
        why = d.reasons[d.why[i]]
        said = f"{status}: {why}" if why else status
        return [*cells, moved, sure, *self._timed(i), said]

    @property
    def _in_time(self) -> InTime | None:
        """The program run in time, None where nobody asked."""
        return None if self.outcome is None else self.outcome.in_time

    def _timed(self, i: int) -> list[str]:
        """Write how fast visit i is passed, and how well the way there is kept to."""
        told = self._in_time
        if told is None:
            return []
        speed = float(told.after.clock.speed[told.own[i]]) / MM
        at = np.flatnonzero(told.paths.visit == i)
        sizes = [f"{size:.3f}" for size in (told.paths.after.sizes[at] / MM).tolist()]
        return [_told(speed, 7, 1), *(sizes or [""])]

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

    def _chosen(self, line: int | None) -> Ints:
        """Choose the visits to show: those whose move or literal is on a line."""
        v = self.visits
        if line is None:
            return np.arange(len(v))
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
        return np.flatnonzero(found)


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


def _known_deg(values: Floats) -> list[float | None]:
    """Round angles [rad] to degrees; what is not known becomes None."""
    degrees = np.rad2deg(values).tolist()
    return [round(v, 5) if np.isfinite(v) else None for v in degrees]


def _share_cells(name: str, share: Floats) -> list[str]:
    """Write a share (3,) [mm] as the cells of a table row."""
    size = float(np.linalg.norm(share))
    rounded = [round(v, 4) + 0.0 for v in (size, *share.tolist())]  # no -0.0
    return [name, *(_told(v, 7, 4) for v in rounded)]


def explain(
    files: dict[str, bytes],
    cell: Cell,
    model: Model | None,
    options: Options = AS_USUAL,
) -> Explanation:
    """Plan a program; with a model, compensate it, which plans it too.

    Raises:
        PostprocError: The program, the cell or the model cannot be used.
    """
    if model is None:
        cell = replace(cell, strict_calls=cell.strict_calls or options.strict_calls)
        reading = read_program(files, cell)
        return Explanation.of_plan(reading, plan_visits(reading.visits, cell))
    (name, source), *rest = files.items()
    values = {n: data for n, data in rest if is_variables(n)}
    outcome = compensate(
        source,
        cell,
        model,
        name=name,
        variables=next(iter(values.values()), None),
        pages={n: data for n, data in rest if n not in values},
        options=options,
    )
    return Explanation.of_outcome(outcome)


def explain_file(
    program: Path,
    cell: Path,
    model: Path | None,
    lsv: Path | None,
    options: Options = AS_USUAL,
) -> Explanation:
    """Explain a program on disk.

    Raises:
        PostprocError: A file cannot be read or used.
    """
    files = read_files(program, lsv)
    fitted = None if model is None else load_model(model)
    return explain(files, load_cell(cell), fitted, options)
