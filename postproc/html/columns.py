"""What the program page knows of every visit, as columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.outcome import Outcome
from postproc.language.visits import Motion
from postproc.robot.pose import MM

MOVES = (*(m.name for m in Motion), "VIA")
VIA = len(Motion)


@dataclass(frozen=True)
class Columns:
    """n visits in program order (structure of arrays), units as people read them.

    Attributes:
        files, names, reasons: Texts that the indices point into.
        visit: 1-based number of the visit, (n,).
        file, line: Where the move stands, (n,), line 1-based.
        literal_file, literal_line: Where its numbers stand, (n,), -1 where nowhere.
        name: Index into `names`, (n,).
        move: Index into `MOVES`, (n,).
        status: `postproc.compensation.outcome.Status`, (n,).
        why: Index into `reasons`, (n,).
        direction: Of every joint's arrival: -1, 0 (not known), 1, (n, 6).
        q_deg: Joint angles, (n, 6).
        original, corrected: Numbers of the target in its file, (n, 6).
        position_mm: Where the target lies, base frame, (n, 3).
        correction_mm: Change of the commanded TCP, base frame, (n, 3).
        std_mm: Standard error of the correction, per axis, (n, 3).
    """

    files: tuple[str, ...]
    names: tuple[str, ...]
    reasons: tuple[str, ...]
    visit: Ints
    file: Ints
    line: Ints
    literal_file: Ints
    literal_line: Ints
    name: Ints
    move: Ints
    status: Ints
    why: Ints
    direction: Ints
    q_deg: Floats
    original: Floats
    corrected: Floats
    position_mm: Floats
    correction_mm: Floats
    std_mm: Floats

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.visit)

    def __getitem__(self, rows: Ints) -> Self:
        """Take some of the visits."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        taken: dict[str, Any] = {
            name: value[rows] if isinstance(value, np.ndarray) else value
            for name, value in values.items()
        }
        return type(self)(**taken)

    @property
    def size_mm(self) -> Floats:
        """Length of every correction, (n,)."""
        return np.asarray(np.linalg.norm(self.correction_mm, axis=1))


@dataclass(frozen=True)
class Program:
    """Everything that the program page shows.

    Attributes:
        name: Of the program.
        model: Id of the model.
        columns: All visits.
        predicted: Error statistics by "before" and "after", then by name.
        diagnostics: Rows of file, line, code and message.
        stages: Seconds by stage.
        sources: Bytes by file name; empty where they are not at hand.
    """

    name: str
    model: str
    columns: Columns
    predicted: Mapping[str, Mapping[str, float | None]]
    diagnostics: tuple[Mapping[str, object], ...]
    stages: Mapping[str, float]
    sources: Mapping[str, bytes]


def columns_of(outcome: Outcome) -> Columns:
    """Take the columns out of an outcome."""
    v, d = outcome.visits, outcome.decisions
    n, has = len(v), v.literal >= 0
    literal = np.where(has, v.literal, 0)
    nowhere = np.full(n, -1)
    empty = len(v.literals) == 0
    place = (nowhere, nowhere) if empty else (v.literals.file, v.literals.line)
    known = len(outcome.position) == n
    position = outcome.position / MM if known else np.full((n, 3), np.nan)
    blank = np.where(has, 0.0, np.nan)[:, None]
    return Columns(
        files=v.files,
        names=v.names,
        reasons=d.reasons,
        visit=np.arange(1, n + 1),
        file=v.file,
        line=v.line,
        literal_file=nowhere if empty else np.where(has, place[0][literal], -1),
        literal_line=nowhere if empty else np.where(has, place[1][literal], -1),
        name=v.name,
        move=np.where(v.via, VIA, v.motion),
        status=d.status,
        why=d.why,
        direction=np.asarray(d.direction, dtype=np.int64),
        q_deg=np.rad2deg(d.q),
        original=v.values + blank,
        corrected=d.corrected + blank,
        position_mm=position,
        correction_mm=d.correction / MM,
        std_mm=d.std_error / MM,
    )
