"""The columns of the program page out of a written report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.compensation.outcome import Status
from postproc.html.columns import MOVES, Columns


class Texts:
    """Distinct texts in order of appearance; number 0 is "".

    >>> texts = Texts()
    >>> texts.index(["a", None, "b", "a"]).tolist(), texts.all
    ([1, 0, 2, 1], ('', 'a', 'b'))
    """

    def __init__(self) -> None:
        """Start with no text but "" ."""
        self._number: dict[str, int] = {"": 0}

    def index(self, texts: Sequence[object]) -> NDArray[np.int64]:
        """Number texts; None is ""."""
        put = self._number.setdefault
        told = ("" if t is None else str(t) for t in texts)
        return np.array([put(t, len(self._number)) for t in told], dtype=np.int64)

    @property
    def all(self) -> tuple[str, ...]:
        """Return the texts by number."""
        return tuple(self._number)


def columns_from(targets: Sequence[Mapping[str, Any]]) -> Columns:
    """Take the columns out of the targets of a report.

    Raises:
        KeyError, ValueError, TypeError: They are not the targets of a report.
    """
    files, names, reasons = Texts(), Texts(), Texts()
    literals = [t["literal"] or {"file": "", "line": -1} for t in targets]
    place = files.index([p["file"] for p in literals])
    statuses = {s.name.lower(): int(s) for s in Status}
    moves = {name: k for k, name in enumerate(MOVES)}
    return Columns(
        visit=np.arange(1, len(targets) + 1),
        file=files.index([t["file"] for t in targets]),
        line=np.array([t["line"] for t in targets], dtype=np.int64),
        literal_file=np.where(place > 0, place, -1),
        literal_line=np.array([p["line"] for p in literals], dtype=np.int64),
        name=names.index([t["name"] for t in targets]),
        move=np.array([moves[t["move"]] for t in targets], dtype=np.int64),
        status=np.array([statuses[t["status"]] for t in targets], dtype=np.int64),
        why=reasons.index([t["why"] for t in targets]),
        direction=_numbers(targets, "lambda", 6).astype(np.int64),
        q_deg=_numbers(targets, "q_deg", 6),
        original=_numbers(targets, "original", 6),
        corrected=_numbers(targets, "corrected", 6),
        position_mm=_numbers(targets, "position_mm", 3),
        correction_mm=_numbers(targets, "correction_mm", 3),
        std_mm=_numbers(targets, "std_error_mm", 3),
        files=files.all,
        names=names.all,
        reasons=reasons.all,
    )


def _numbers(targets: Sequence[Mapping[str, Any]], key: str, width: int) -> Floats:
    """Stack the lists under a key, (n, width); NaN where there is none."""
    blank = [None] * width
    lists = [t.get(key) or blank for t in targets]
    return np.array(lists, dtype=np.float64).reshape(len(targets), width)
