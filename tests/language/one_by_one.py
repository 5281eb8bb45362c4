"""Programs read move by move: what blocks of moves are measured by."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from unittest.mock import patch

import numpy as np

from postproc.compensation.program import read_program
from postproc.language.analysis import move_blocks
from postproc.language.visits import Visits
from postproc.robot.cell import Cell

ONE_BY_ONE = 10**9
INTERNED = "name", "config", "reason", "shift"


def read(files: Mapping[str, bytes], cell: Cell, least: int = ONE_BY_ONE) -> Visits:
    """Read a program; blocks of `least` moves are read at once, usually none."""
    with patch.object(move_blocks, "LEAST", least):
        return read_program(files, cell).visits


def differing(a: object, b: object) -> Iterator[str]:
    """Yield the names of what differs between two results."""
    for name in (f.name for f in fields(a)):  # type: ignore[arg-type]
        one, other = getattr(a, name), getattr(b, name)
        if hasattr(a, f"{name}s") and name in INTERNED:  # in any order
            tables = (getattr(x, f"{name}s") for x in (a, b))
            columns = (x.tolist() for x in (one, other))
            pairs = zip(tables, columns, strict=True)
            one, other = ([k if k < 0 else t[k] for k in own] for t, own in pairs)
            yield from [] if one == other else [name]
        elif name in (*(f"{one}s" for one in INTERNED), "dialect"):
            continue
        elif isinstance(one, np.ndarray):
            if not np.array_equal(one, other, equal_nan=one.dtype.kind == "f"):
                yield name
        elif is_dataclass(one):
            yield from (f"{name}.{inner}" for inner in differing(one, other))
        elif one != other:
            yield name
