"""Statements over several lines: one that ends with a comma goes on with clauses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools
from postproc.language.numbered import NAME_MARK, WHOLE, mask_of
from postproc.language.sequences import alike, in_order

Ints = NDArray[np.signedinteger[Any]]

_OPENS = re.compile(rb" *(?:\w+ *:: *)?(?:MOVE|MOVEFLY|OPEN)\b[^\n]*, *\Z", re.I)
_CLAUSE = re.compile(
    rb" *(?:WITH|ADVANCE|TIL|VIA|SYNCMOVE|SYNCMOVEFLY|CONDITION|\$)", re.I
)
_WITH = re.compile(rb" *(?:WITH|SYNCMOVE|SYNCMOVEFLY)\b", re.I)
_COMMA = re.compile(rb"[^\n]*,\s*\Z")
_CLOSES = re.compile(rb" *(?:ENDMOVE|ENDOPEN)\b", re.I)


@dataclass(frozen=True)
class Names:
    """The names that are taken out of lines.

    Attributes:
        at: Index into `name` of the first name of every line, (n,).
        name: Index into `names`.
        names: The distinct ones.
    """

    at: Ints
    name: Ints
    names: Sequence[str]


@dataclass(frozen=True)
class Joined:
    """Lines of code, those of a statement in one.

    Attributes:
        masks: Their distinct masks, stripped.
        shape: Index into `masks`, (k,).
        rows: The first line of each, (k,).
    """

    masks: tuple[bytes, ...]
    shape: Ints
    rows: Ints


def stripped(mask: bytes) -> bytes:
    """Drop the blanks around the mask of a line, see `Marked`."""
    if mask[:1] == WHOLE:
        own = mask.strip()
        return WHOLE + own if own else own
    return mask.strip()


def join(masks: Sequence[bytes], shape: Ints, names: Names) -> Joined:
    """Join the lines of every statement.

    Args:
        masks: The distinct masks of lines.
        shape: Index into `masks` of every line that holds code, (n,).
        names: What is taken out of the masks.
    """
    own = [stripped(mask) for mask in masks]
    bare = [mask.removeprefix(WHOLE) for mask in own]
    opens = np.array(
        [mask.endswith(b",") and bool(_OPENS.match(mask)) for mask in bare], dtype=bool
    )
    starts = np.flatnonzero(opens[shape])
    length = _lengths(tuple(bare), shape, starts)
    starts, length = starts[length > 1], length[length > 1]
    kind = alike(shape, starts, starts + length)
    shape, keep = shape.copy(), np.ones(len(shape), dtype=bool)
    inner = np.repeat(starts - np.cumsum(length - 1) + length, length - 1)
    keep[inner + np.arange(len(inner))] = False
    number: dict[bytes, int] = {}
    parts, of_kind = shape.tolist() if len(starts) else [], []
    for k in in_order(kind)[1].tolist():
        some = [own[part] for part in parts[starts[k] : starts[k] + length[k]]]
        if any(mask[:1] == WHOLE for mask in some):
            of_kind.append(-1)  # a row at a time: their names are filled in again
        else:
            of_kind.append(number.setdefault(b" ".join(some), len(number)))
    found = np.array(of_kind, dtype=np.int64)[kind]
    for k in np.flatnonzero(found < 0).tolist():
        a, b = int(starts[k]), int(starts[k] + length[k])
        text = _whole([own[part] for part in parts[a:b]], a, names)
        found[k] = number.setdefault(text, len(number))
    shape[starts] = len(masks) + found
    rows = np.flatnonzero(keep)
    return Joined((*own, *number), shape[rows], rows)


def _whole(parts: Sequence[bytes], row: int, names: Names) -> bytes:
    """Join lines some of which hold their names, from a row on: now all do."""
    texts = []
    for at, part in zip(names.at[row : row + len(parts)].tolist(), parts, strict=True):
        count = 0 if part[:1] == WHOLE else part.count(NAME_MARK.encode())
        words = [names.names[k] for k in names.name[at : at + count].tolist()]
        mask = part.removeprefix(WHOLE).decode("latin-1")
        texts.append(mask_of(mask, tuple(words)) if words else mask)
    return WHOLE + " ".join(texts).encode("latin-1")


def _lengths(masks: tuple[bytes, ...], shape: Ints, starts: Ints) -> Ints:
    """Count the lines of the statements that start at some lines of code, (k,).

    All statements grow by one line at a time, for as long as the next one belongs.
    """
    length = np.ones(len(starts), dtype=np.int64)
    growing = np.arange(len(starts))
    while len(growing := growing[(starts + length)[growing] < len(shape)]):
        following = shape[(starts + length)[growing]]
        closes = _which(masks, following, _CLOSES)
        comma = _which(masks, shape[(starts + length - 1)[growing]], _COMMA)
        clause = _which(masks, following, _CLAUSE)
        more = ~closes & np.where(comma, clause, _which(masks, following, _WITH))
        length[growing[closes | more]] += 1
        growing = growing[more]
    return length


def _which(masks: tuple[bytes, ...], shape: Ints, pattern: re.Pattern[bytes]) -> Bools:
    """Tell which of some lines match a pattern."""
    used, at = np.unique(shape, return_inverse=True)
    found = [bool(pattern.match(masks[k])) for k in used.tolist()]
    return np.array(found, dtype=bool)[at]
