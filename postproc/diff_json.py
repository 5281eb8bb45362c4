"""The rows of `diff` as JSON, some thousand at a time."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.byte_columns import (
    Column,
    beside,
    blanked,
    joined,
    named,
    shortest,
    whole,
)
from postproc.compensation.parallel import in_turns
from postproc.diff import Difference
from postproc.row_columns import blocks_of, number_places, strung
from postproc.rows import STATUSES, Rows

END = b"\x01"  # behind a row; no JSON text holds it
SIGNS = tuple(map(str, range(-1, 3)))


def difference_pieces(found: Difference) -> Iterator[str]:
    """Write what differs as ``json.dumps(.., indent=1)`` would, piece by piece."""
    head = {"stamped": found.stamped, "counts": dict(found.counts)}
    yield json.dumps(head, indent=1)[: -len("\n}")]
    for key, parts in (("rows", found.differing), ("left", found.untouched)):
        yield f',\n "{key}": ['
        comma = ""
        tasks = [(rows, *block) for rows in parts for block in blocks_of(rows)]
        for piece in in_turns(lambda task: _piece(*task), tasks):
            yield comma + piece
            comma = ","
        yield "\n ]" if comma else "]"
    yield "\n}\n"


def _piece(rows: Rows, k: Ints, single: Ints) -> str:
    """Write some rows with commas between them."""
    begin = int(k[0])
    texts = np.empty(len(k), dtype=object)
    plain = np.setdiff1d(k, single, assume_unique=True)
    if len(plain):
        texts[plain - begin] = _objects(rows, plain)
    for row in single.tolist():
        told = json.dumps(rows.row(row)._asdict(), indent=1)
        texts[row - begin] = "\n  " + told.replace("\n", "\n  ")
    return ",".join(texts.tolist())


def _objects(rows: Rows, k: Ints) -> list[str]:
    """Write some rows as JSON objects."""
    columns = {
        "file": json.dumps(rows.file).encode(),
        "line": whole(rows.line[k]),
        "target": named(rows.targets, rows.target[k], json.dumps),
        "original": _numbers(rows, rows.original, k),
        "compensated": _numbers(rows, rows.compensated, k),
        "change_mm": _sizes(np.where(rows.has_change[k], rows.change_mm[k], np.nan)),
        "text": b'""',
        **_told(rows, k),
        "visits": b"{}",
    }
    parts: list[Column | bytes] = []
    for number, (key, column) in enumerate(columns.items()):
        lead = "," if number else "\n  {"
        parts += [f'{lead}\n   "{key}": '.encode(), column]
    return joined([*parts, b"\n  }" + END]).decode("ascii").split(END.decode())[:-1]


def _told(rows: Rows, k: Ints) -> dict[str, Column | bytes]:
    """Write what a record says of some rows."""
    told = rows.told
    none = {"status": b'""', "why": b'""', "direction": b"[]", "correction_mm": b"null"}
    if told is None or not len(told.line):
        return dict(none)
    entry = rows.entry[k]
    columns = {
        "status": named(STATUSES, told.status[entry], json.dumps),
        "why": named(told.reasons, told.why[entry], json.dumps),
        "direction": _lists(
            named(SIGNS, told.direction[entry].ravel() + 1, str),
            np.repeat(np.arange(len(k)), 6),
            len(k),
        ),
        "correction_mm": _sizes(told.correction_mm[entry]),
    }
    return {key: blanked(columns[key], entry < 0, none[key]) for key in columns}


def _numbers(rows: Rows, values: Floats, k: Ints) -> Column:
    """Write the numbers of some rows as lists."""
    at, owner = number_places(rows.first, k)
    return _lists(shortest(values[at], text=repr), owner, len(k))


def _lists(cells: Column, owner: Ints, rows: int) -> Column:
    """Write lists, an item a line."""
    column = beside([b"[\n    ", strung(cells, owner, rows, b",\n    "), b"\n   ]"])
    return blanked(column, np.bincount(owner, minlength=rows) == 0, b"[]")


def _sizes(values: Floats) -> Column:
    """Write sizes with all their digits; NaN becomes null."""
    return shortest(values, text=repr)
