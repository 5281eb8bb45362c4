"""Columns as JSON that is small enough for a page."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.outcome import Status
from postproc.html.columns import MOVES, Columns
from postproc.html.text import visible

MOST = 100_000  # visits that a page carries
LARGEST = 2_000  # of the largest corrections, carried whatever is left out
# Steps in which numbers are stored: finer than anybody reads, coarser than the digits
# of a double.
STEPS = {
    "q_deg": 1e-3,
    "original": 1e-5,
    "change": 1e-5,
    "position_mm": 1e-2,
    "correction_mm": 1e-4,
    "std_mm": 1e-4,
}


def choose(columns: Columns, most: int = MOST) -> Ints:
    """Choose the visits that a page carries.

    Of a program with more than `most`, these are the visits left alone (at most half of
    the page), the largest corrections, and of the others every k-th.

    Returns:
        Indices, ascending.
    """
    n = len(columns)
    if n <= most:
        return np.arange(n)
    left = np.flatnonzero(
        np.isin(columns.status, (Status.UNSAFE, Status.GUARDED, Status.DISPLAY))
    )
    left = _evenly(left, most // 2)
    size = np.nan_to_num(columns.size_mm)
    largest = np.argsort(-size, kind="stable")[: min(LARGEST, most // 4)]
    first = np.union1d(left, largest)
    rest = np.setdiff1d(np.arange(n), first, assume_unique=True)
    return np.union1d(first, _evenly(rest, most - len(first)))


def _evenly(rows: Ints, most: int) -> Ints:
    """Take at most so many rows, evenly."""
    if len(rows) <= most:
        return rows
    return rows[np.arange(most) * len(rows) // most]


def pack(columns: Columns) -> dict[str, Any]:
    """Write columns as lists of integers, with the size of a step beside them."""
    width = {"original": 6, "change": 6, "q_deg": 6}
    numbers = {
        "original": columns.original,
        "change": columns.corrected - columns.original,
        "q_deg": columns.q_deg,
        "position_mm": columns.position_mm,
        "correction_mm": columns.correction_mm,
        "std_mm": columns.std_mm,
    }
    packed = {
        key: {
            "step": STEPS[key],
            "width": width.get(key, 3),
            "values": integers(values, STEPS[key]),
        }
        for key, values in numbers.items()
    }
    indices = ("visit", "file", "line", "literal_file", "literal_line", "name", "move")
    return {
        "files": [visible(t) for t in columns.files],
        "names": [visible(t) for t in columns.names],
        "reasons": [visible(t) for t in columns.reasons],
        "moves": list(MOVES),
        "statuses": [s.name.lower() for s in Status],
        "index": {k: getattr(columns, k).tolist() for k in (*indices, "status", "why")},
        "direction": _signs(columns.direction),
        "numbers": packed,
    }


def integers(values: Floats, step: float) -> list[int | None]:
    """Round to multiples of a step; what is not known becomes None.

    >>> integers(np.array([0.12345, np.nan]), 1e-4)
    [1234, None]
    """
    flat = np.asarray(values, dtype=np.float64).ravel() / step
    known = np.isfinite(flat)
    out: list[int | None] = np.rint(np.where(known, flat, 0.0)).astype(int).tolist()
    for k in np.flatnonzero(~known).tolist():
        out[k] = None
    return out


def _signs(direction: Ints) -> str:
    """Write directions as one text, a character each: ``-``, ``0`` or ``+``."""
    return "".join(np.array(["-", "0", "+"])[np.sign(direction).ravel() + 1].tolist())
