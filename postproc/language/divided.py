"""Lines that divide a block and open another one: each of both gets a row.

``CASE (1): IF a THEN`` belongs to two blocks, which end in different lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.language.lexis import NUMBER_MARK
from postproc.language.numbered import NAME_MARK, WHOLE

Ints = NDArray[np.signedinteger[Any]]

_NUMBER, _NAME = NUMBER_MARK.encode(), NAME_MARK.encode()
_IN_PARENTHESES = rb"\((?:'[^']*'|[^'()]|\([^()]*\))*\)"
_DIVIDED = re.compile(
    rb"(CASE *" + _IN_PARENTHESES + rb" *:|ELSE *:) *"
    rb"((?:IF|SELECT|FOR|WHILE|CONDITION)\b.*|REPEAT *;?)",
    re.I | re.S,
)
_CLOSED = re.compile(rb"\bEND(?:IF|SELECT|FOR|WHILE|CONDITION)\b", re.I)


@dataclass(frozen=True)
class Rows:
    """Logical lines.

    Attributes:
        masks: The distinct masks, stripped, see `Marked`.
        shape: Index into `masks`, (n,).
        line: Physical line, (n,).
        first: CSR offsets into the numbers, (n + 1,).
        name: Index of the first name that is taken out of the line, (n,).
    """

    masks: tuple[bytes, ...]
    shape: Ints
    line: Ints
    first: Ints
    name: Ints


def divided(rows: Rows) -> Rows:
    """Give the block that opens behind CASE or ELSE a row of its own."""
    found = {
        k: parts.groups()
        for k, mask in enumerate(rows.masks)
        if (parts := _DIVIDED.fullmatch(mask.removeprefix(WHOLE)))
        and not _CLOSED.search(parts[2])
    }
    if not found:
        return rows
    m = len(rows.masks)
    head, tail = np.arange(m), np.arange(m)
    numbers, names = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    masks = list(rows.masks)
    for k, (before, behind) in found.items():
        head[k], tail[k] = len(masks), len(masks) + 1
        numbers[k], names[k] = before.count(_NUMBER), before.count(_NAME)
        kind = WHOLE if rows.masks[k][:1] == WHOLE else b""
        masks += [kind + before, kind + behind]
    times = np.where(head[rows.shape] != rows.shape, 2, 1)
    row = np.repeat(np.arange(len(times)), times)
    second = np.append(False, row[1:] == row[:-1])
    shape = rows.shape[row]
    first = rows.first[row] + np.where(second, numbers[shape], 0)
    return Rows(
        tuple(masks),
        np.where(second, tail[shape], head[shape]).astype(rows.shape.dtype),
        rows.line[row],
        np.append(first, rows.first[-1]).astype(rows.first.dtype),
        rows.name[row] + np.where(second, names[shape], 0),
    )
