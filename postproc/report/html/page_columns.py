"""What the page of a program knows of every visit, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from postproc.arrays import Floats, Indices, Ints
from postproc.report.tolerance import ALL_WORDS
from postproc.robot.trajectory import Motion

VERDICTS = (*ALL_WORDS.values(), "")  # against a tolerance
MOVES = (*(m.name for m in Motion), "VIA")
VIA = len(Motion)


@dataclass(frozen=True)
class PageColumns:
    """n visits in program order (structure of arrays), units as people read them.

    Attributes:
        files, names, reasons: Texts that the indices point into.
        heads: Of the numbers of a pose, none where no file tells its language.
        visit: 1-based number of the visit, (n,).
        file, line: Where the move stands, (n,), line 1-based.
        literal_file, literal_line: Where its numbers stand, (n,), -1 where nowhere.
        name: Index into `names`, (n,).
        move: Index into `MOVES`, (n,).
        status: `postproc.compensation.outcome.Status`, (n,).
        why: Index into `reasons`, (n,).
        direction: Of every joint's arrival: -1, 0 (not known), 1, (n, 6).
        q_deg: Joint angles, (n, 6).
        original, corrected: Numbers of the target in its file, (n, w).
        position_mm: Where the target lies, base frame, (n, 3).
        correction_mm: Change of the commanded TCP, base frame, (n, 3).
        std_mm: Standard error of the correction, per axis, (n, 3).
        expected_mm: Expected true error before and after, and the 95 % bound, (n, 3).
        verdict: Index into `VERDICTS`, (n,), the last one where nobody asked.
    """

    files: tuple[str, ...]
    names: Sequence[str]
    reasons: tuple[str, ...]
    heads: tuple[str, ...]
    visit: Ints
    file: Ints
    line: Ints
    literal_file: Ints
    literal_line: Ints
    name: Ints
    move: Ints
    status: Indices
    why: Ints
    direction: Ints
    q_deg: Floats
    original: Floats
    corrected: Floats
    position_mm: Floats
    correction_mm: Floats
    std_mm: Floats
    expected_mm: Floats
    verdict: Ints

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
