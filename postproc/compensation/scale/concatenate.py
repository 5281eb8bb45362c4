"""The visits of several programs side by side, as if they were one program's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from itertools import accumulate, chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Ints
from postproc.language.visits import Graph, Literals, NumberPlaces, Visits

# No move leads from one to another, and no number belongs to two of them.

# Which table a column of indices points into; what is below zero points nowhere.
TABLES = {
    "config": "configs",
    "name": "names",
    "shift": "shifts",
    "tool": "poses",
    "base": "poses",
    "uframe": "poses",
    "load": "loads",
}
NOTHING_FIRST = ("name", "load")  # their table's first row means that there is none


def concatenate(programs: Sequence[Visits]) -> Visits:
    """Put the visits of programs of one dialect one after the other."""
    parts = {name: _join_part(name, programs) for name in programs[0].parts}
    joined = replace(
        programs[0],
        files=tuple(chain.from_iterable(program.files for program in programs)),
        graph=_join_graphs(programs),
        reason=_join_reasons(programs),
        reasons=tuple(chain.from_iterable(program.reasons for program in programs)),
        literals=_literals(programs),
        **parts,
    )
    return joined.with_columns(**_join_references(programs))


def first_visits(programs: Sequence[Visits]) -> tuple[int, ...]:
    """Return the first visit of each program where they are side by side."""
    return tuple(offsets(map(len, programs))[:-1])


def offsets(sizes: Iterable[int]) -> list[int]:
    """Return where parts of these sizes begin, and at last where they end.

    >>> offsets([2, 0, 3])
    [0, 2, 2, 5]
    """
    return list(accumulate(sizes, initial=0))


def _join_part(name: str, programs: Sequence[Visits]) -> Any:
    """Join a part of the visits, with the tables that it points into."""
    own = [program.parts[name] for program in programs]
    columns: dict[str, Any] = {}
    for column in (f.name for f in fields(own[0])):
        found = [getattr(part, column) for part in own]
        if column == "aux":
            columns[column] = _join_axes(found)
            continue
        if column in TABLES:
            rows = [len(getattr(part, TABLES[column])) for part in own]
            found = _shift_indices(found, rows, column in NOTHING_FIRST)
        columns[column] = _join(found)
    return replace(own[0], **columns)


def _join(parts: Sequence[Any]) -> Any:
    """Join a column of all programs: an array, texts, or places of numbers."""
    if isinstance(parts[0], NumberPlaces):
        return NumberPlaces.join(parts)
    if isinstance(parts[0], Sequence):
        return tuple(chain.from_iterable(parts))
    return np.concatenate(parts)


def _shift_indices(
    parts: Sequence[NDArray[np.int64]], rows: Iterable[int], nothing_first: bool = False
) -> list[NDArray[np.int64]]:
    """Let indices point to where the rows of their tables have come to.

    Args:
        parts: Indices of each program.
        rows: How many rows the table of each has.
        nothing_first: The first row of a table means that there is none.
    """
    return [
        np.where(part >= nothing_first, part + offset, part)
        for part, offset in zip(parts, offsets(rows)[:-1], strict=True)
    ]


def _join_references(programs: Sequence[Visits]) -> dict[str, Ints]:
    """Join the columns that point to files, literals and visits."""
    tables = {
        "file": [len(program.files) for program in programs],
        "literal": [len(program.literals) for program in programs],
        "follows": [len(program.literals) for program in programs],
        "block": [len(program) for program in programs],
    }
    columns = [program.columns for program in programs]
    return {
        name: np.concatenate(_shift_indices([own[name] for own in columns], rows))
        for name, rows in tables.items()
    }


def _join_reasons(programs: Sequence[Visits]) -> Ints:
    rows = [len(program.reasons) for program in programs]
    own = [program.reason for program in programs]
    return np.concatenate(_shift_indices(own, rows, nothing_first=True))


def _join_graphs(programs: Sequence[Visits]) -> Graph:
    """Join from where arms come; the offsets are one more than there are visits."""
    graphs = [program.graph for program in programs]
    pred = _shift_indices([graph.pred for graph in graphs], map(len, programs))
    places = [len(graph.pred) for graph in graphs]
    start = _shift_indices([graph.pred_start[:-1] for graph in graphs], places)
    return Graph(np.append(np.concatenate(start), sum(places)), np.concatenate(pred))


def _join_axes(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Join auxiliary axes: each program has as many as it uses."""
    axes = max(part.shape[1] for part in parts)
    wide = [(0, 0), (0, axes)]
    return np.concatenate(
        [np.pad(part, wide, constant_values=np.nan)[:, :axes] for part in parts]
    )


def _literals(programs: Sequence[Visits]) -> Literals:
    """Join the places in the texts."""
    own = [program.literals for program in programs]
    columns: dict[str, Any] = {}
    for name in (f.name for f in fields(Literals)):
        parts = [getattr(literals, name) for literals in own]
        if name == "file":
            parts = _shift_indices(parts, [len(program.files) for program in programs])
        columns[name] = _join(parts)
    return Literals(**columns)
