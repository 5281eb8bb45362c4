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

Ints = NDArray[np.signedinteger[Any]]

_NUMBER = NUMBER_MARK.encode()
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
        masks: The masks of all shapes, stripped.
        shape: Index into `masks`, (n,).
        line: Physical line, (n,).
        first: CSR offsets into the numbers, (n + 1,).
    """

    masks: tuple[bytes, ...]
    shape: Ints
    line: Ints
    first: Ints


def divided(rows: Rows) -> Rows:
    """Give the block that opens behind CASE or ELSE a row of its own."""
    found = {
        k: parts.groups()
        for k, mask in enumerate(rows.masks)
        if (parts := _DIVIDED.fullmatch(mask)) and not _CLOSED.search(parts[2])
    }
    if not found:
        return rows
    m = len(rows.masks)
    head, tail, numbers = np.arange(m), np.arange(m), np.zeros(m, dtype=np.int64)
    masks = list(rows.masks)
    for k, (before, behind) in found.items():
        head[k], tail[k] = len(masks), len(masks) + 1
        numbers[k] = before.count(_NUMBER)
        masks += [before, behind]
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
    )
