"""The visits of several programs side by side, as if they were one program's.

No move leads from one to another, and no number belongs to two of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from itertools import accumulate, chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.language.visits import Literals, Visits

# Which table a column of indices points into, all visits (by any column of them) among
# these; what is below zero points nowhere.
TABLES = {
    "file": "files",
    "config": "configs",
    "literal": "literals",
    "follows": "literals",
    "name": "names",
    "tool": "frames",
    "base": "frames",
    "uframe": "frames",
    "reason": "reasons",
    "pred": "line",
    "pred_start": "pred",
}
NOTHING_FIRST = ("names", "reasons")  # tables whose first row means that there is none


def beside(programs: Sequence[Visits]) -> Visits:
    """Put the visits of programs one after the other, each a program of its own."""
    columns = {
        f.name: _joined(f.name, programs)
        for f in fields(Visits)
        if f.name not in ("literals", "aux", "pred_start")
    }
    return Visits(
        literals=_literals(programs),
        aux=_aux(programs),
        pred_start=_starts(programs),
        **columns,
    )


def begins(programs: Sequence[Visits]) -> tuple[int, ...]:
    """Return the first visit of each program where they are side by side."""
    return tuple(offsets(map(len, programs))[:-1])


def offsets(sizes: Iterable[int]) -> list[int]:
    """Return where parts of these sizes begin, and at last where they end.

    >>> offsets([2, 0, 3])
    [0, 2, 2, 5]
    """
    return list(accumulate(sizes, initial=0))


def _joined(name: str, programs: Sequence[Visits]) -> Any:
    """Join a column, or a table."""
    parts = [getattr(program, name) for program in programs]
    if isinstance(parts[0], tuple):
        return tuple(chain.from_iterable(parts))
    if name in TABLES:
        parts = _moved_on(name, parts, programs)
    return np.concatenate(parts)


def _moved_on(
    name: str, parts: Sequence[NDArray[np.int64]], programs: Sequence[Visits]
) -> list[NDArray[np.int64]]:
    """Let indices point to where their table's rows have come to."""
    table = TABLES[name]
    starts = offsets(len(getattr(program, table)) for program in programs)
    least = 1 if table in NOTHING_FIRST else 0
    return [
        np.where(part >= least, part + offset, part)
        for part, offset in zip(parts, starts[:-1], strict=True)
    ]


def _starts(programs: Sequence[Visits]) -> NDArray[np.int64]:
    """Join the offsets into `pred`, which are one more than there are visits."""
    parts = [program.pred_start[:-1] for program in programs]
    moved = _moved_on("pred_start", parts, programs)
    return np.append(np.concatenate(moved), sum(len(p.pred) for p in programs))


def _aux(programs: Sequence[Visits]) -> NDArray[np.float64]:
    """Join auxiliary axes: each program has as many as it uses."""
    axes = max(program.aux.shape[1] for program in programs)
    out = np.full((sum(map(len, programs)), axes), np.nan)
    for first, program in zip(begins(programs), programs, strict=True):
        out[first : first + len(program), : program.aux.shape[1]] = program.aux
    return out


def _literals(programs: Sequence[Visits]) -> Literals:
    """Join the places in the texts."""
    own = [program.literals for program in programs]
    columns: dict[str, Any] = {}
    for name in (f.name for f in fields(Literals)):
        parts = [getattr(literals, name) for literals in own]
        if isinstance(parts[0], tuple):
            columns[name] = tuple(chain.from_iterable(parts))
            continue
        moved = _moved_on(name, parts, programs) if name == "file" else parts
        columns[name] = np.concatenate(moved)
    return Literals(**columns)
