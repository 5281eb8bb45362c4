"""The figures and lists that stand on a page before any script runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from postproc.compensation.outcome import Status
from postproc.html.columns import Columns

BINS = 40
EXAMPLES = 12  # visits named in a group
LEFT_ALONE = (Status.UNSAFE, Status.GUARDED, Status.DISPLAY)  # most urgent first


@dataclass(frozen=True)
class Group:
    """Visits that were left alone for the same reason.

    Attributes:
        status: Name of the status.
        why: The reason.
        count: How many visits.
        examples: Number, file and line, name of the first ones.
    """

    status: str
    why: str
    count: int
    examples: tuple[tuple[int, str, int, str], ...]


@dataclass(frozen=True)
class Stage:
    """Seconds spent in a stage and their share of the whole."""

    name: str
    seconds: float
    share: float


def left_alone(columns: Columns) -> tuple[Group, ...]:
    """Group what was not corrected by status and reason, the largest group first."""
    groups = []
    for status in LEFT_ALONE:
        mine = columns.status == status
        codes, counts = np.unique(columns.why[mine], return_counts=True)
        for k in np.argsort(-counts, kind="stable"):
            rows = np.flatnonzero(mine & (columns.why == codes[k]))
            groups.append(
                Group(
                    status.name.lower(),
                    columns.reasons[codes[k]],
                    int(counts[k]),
                    tuple(_place(columns, int(i)) for i in rows[:EXAMPLES]),
                )
            )
    return tuple(groups)


def _place(columns: Columns, i: int) -> tuple[int, str, int, str]:
    """Say which visit, and where its move stands."""
    return (
        int(columns.visit[i]),
        columns.files[columns.file[i]],
        int(columns.line[i]),
        columns.names[columns.name[i]],
    )


def tell_counts(columns: Columns) -> dict[str, int]:
    """Count the visits of every status."""
    return {s.name.lower(): int((columns.status == s).sum()) for s in Status}


def histogram(columns: Columns) -> dict[str, Any]:
    """Count the lengths of the corrections that were made."""
    size = columns.size_mm[columns.status == Status.SAFE]
    size = size[np.isfinite(size)]
    if len(size) == 0:
        return {"edges_mm": [], "counts": []}
    top = max(float(size.max()), 1e-6)
    counts, edges = np.histogram(size, bins=BINS, range=(0.0, top))
    return {"edges_mm": edges.round(6).tolist(), "counts": counts.tolist()}


def uncertainty(columns: Columns) -> dict[str, float | None]:
    """Summarise the standard errors at the corrected targets, over the axes [mm]."""
    rows = columns.status == Status.SAFE
    size = np.linalg.norm(columns.std_mm[rows], axis=1)
    size = size[np.isfinite(size)]
    if len(size) == 0:
        return {"median": None, "max": None}
    return {"median": float(np.median(size)), "max": float(size.max())}


def seconds(stages: Mapping[str, float]) -> tuple[Stage, ...]:
    """List stages in their order, with shares."""
    total = sum(stages.values()) or 1.0
    return tuple(Stage(name, s, s / total) for name, s in stages.items())


def finite(value: Any) -> Any:
    """Replace NaN, which JSON does not have, by None, all the way down."""
    if isinstance(value, Mapping):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
