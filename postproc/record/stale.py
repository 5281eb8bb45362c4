"""By how much programs would move that were compensated with an older model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Outcome, Status
from postproc.exceptions import PostprocError
from postproc.model.model import Model
from postproc.record.database import Record
from postproc.record.life import Life
from postproc.record.rows import CURRENT, ModelRow, ProgramRow, RobotRow
from postproc.robot.cell import Cell
from postproc.robot.pose import MM

STALE_MM = 0.1
SURE = 2.0  # standard errors of the new model that a change must exceed


@dataclass(frozen=True)
class StaleProgram:
    """A program and by how much it would move.

    Attributes:
        row: The program as it was released.
        moves_mm: Largest change of a target that is surer than chance [mm]; NaN where
            it cannot be told.
        why: Why it cannot be told, "" where it can.
    """

    row: ProgramRow
    moves_mm: float
    why: str = ""

    def is_stale(self, limit: float = STALE_MM) -> bool:
        """Return True where it would move by more than a limit, or nobody can tell."""
        return not self.moves_mm <= limit


def newest(rows: list[ProgramRow]) -> list[ProgramRow]:
    """Return the last release of every program."""
    return list({row.path: row for row in rows}.values())


def find_stale(life: Life, cell: Cell, model: Model) -> list[StaleProgram]:
    """Say of every program by how much it would move with a model, worst first.

    Args:
        life: The robot.
        cell: Its cell.
        model: The new model.
    """
    known = {m.id: m for m in life.models}
    found = []
    for row in newest(life.record.rows(ProgramRow, life.robot.serial)):
        if row.model == model.id:
            continue
        if row.model not in known:
            why = f"model {row.model} is not in the record"
            found.append(StaleProgram(row, float("nan"), why))
            continue
        old = life.model(known[row.model])
        place = life.record.path.parent / row.path
        found.append(_compare(row, place, cell, old, model))
    return sorted(found, key=lambda s: -np.nan_to_num(s.moves_mm, nan=np.inf))


def _compare(
    row: ProgramRow, place: Path, cell: Cell, old: Model, new: Model
) -> StaleProgram:
    try:
        before, after = (compensate(place, cell, m) for m in (old, new))
    except (PostprocError, OSError) as exc:
        return StaleProgram(row, float("nan"), str(exc))
    return StaleProgram(row, largest_change(before, after))


def largest_change(before: Outcome, after: Outcome) -> float:
    """Return by how much the commands of two models differ at the most [mm].

    Targets count that both correct, where the difference is beyond what the newer
    model is unsure of; a target that only one of them corrects moves by all of it.
    """
    one, other = before.decisions, after.decisions
    moved = np.where(
        (other.status == Status.CORRECTED)[:, None], other.correction, 0.0
    ) - np.where((one.status == Status.CORRECTED)[:, None], one.correction, 0.0)
    size = np.linalg.norm(moved, axis=1)
    along = np.einsum("ni,ni->n", moved, np.nan_to_num(other.std_error) ** 2 * moved)
    unsure = np.sqrt(along) / np.maximum(size, 1e-12)
    return float(np.where(size > SURE * unsure, size, 0.0).max(initial=0.0)) / MM


def list_stale(record: Record, limit: float = STALE_MM) -> list[ProgramRow]:
    """List programs that a refresh has found stale.

    So are those of an older model of which nobody can tell by how much they move.
    """
    models = record.rows(ModelRow)
    current = {(m.serial, m.id) for m in models if m.state == CURRENT}
    return [
        row
        for robot in record.rows(RobotRow)
        for row in newest(record.rows(ProgramRow, robot.serial))
        if (row.serial, row.model) not in current
        and (row.moves_mm is None or row.moves_mm > limit)
    ]
