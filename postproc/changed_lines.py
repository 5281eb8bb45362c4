"""Lines of the same two places in two files: which numbers differ, or what more."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import islice, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from postproc.language.masking import Masked, mask_lines

PIECE = 20_000  # lines that are masked at a time

_ASSIGNED = re.compile(r"\s*([A-Za-z_$][\w$.\[\]]*)\s*(?::=|:)")
_TWO_WORDS = re.compile(r"\s*([A-Za-z_]+)\s+([A-Za-z_]+)")
_WORD = re.compile(r"[A-Za-z_]+")


class Row(NamedTuple):
    """One line that differs, or whose target was left alone.

    Attributes:
        file: Name of the original file.
        line: 1-based line in the original; 0 for a line that it does not have.
        target: What the numbers belong to: a variable, or the statement's first word.
        original, compensated: The numbers on the line; empty where the text differs.
        change_mm: Length of the change of the first three of six numbers or more, for
            a position; None for joint angles and text.
        text: The line's two texts where more than numbers differ, else "".
        status, why: What came of the line's target, "" where no record tells.
        direction: In which every joint arrives, see `postproc.arrivals`; or ().
        correction_mm: How far the TCP is moved there, or None.
    """

    file: str
    line: int
    target: str
    original: tuple[float, ...]
    compensated: tuple[float, ...]
    change_mm: float | None
    text: str = ""
    status: str = ""
    why: str = ""
    direction: tuple[int, ...] = ()
    correction_mm: float | None = None


def changed_rows(
    file: str, lines: Sequence[int], before: Sequence[str], after: Sequence[str]
) -> Iterator[Row]:
    """Describe those of equally many lines that differ, some at a time."""
    pairs = zip(before, after, strict=True)
    places = [k for k, (old, new) in enumerate(pairs) if old != new]
    for first in range(0, len(places), PIECE):
        part = places[first : first + PIECE]
        numbers = [lines[k] for k in part]
        yield from _compare(
            file, numbers, [before[k] for k in part], [after[k] for k in part]
        )


def _compare(
    file: str, lines: Sequence[int], before: list[str], after: list[str]
) -> Iterator[Row]:
    """Describe how pairs of lines differ."""
    a, b = _masked(before), _masked(after)
    same = _only_numbers(before, after, a, b)
    size, name = _moves(a, b), _Names()
    rows = zip(lines, before, after, same, size, a.masks, strict=True)
    old_numbers, new_numbers = _numbers(a), _numbers(b)
    for line, text, other, alike, moved, mask in rows:
        old, new = next(old_numbers), next(new_numbers)
        if not alike or old == new:
            yield Row(file, line, "", (), (), None, f"{text} -> {other}")
            continue
        change = moved if len(old) >= 3 and "{" not in text else None
        yield Row(file, line, name(mask, text), old, new, change)


def _only_numbers(
    before: list[str], after: list[str], a: Masked, b: Masked
) -> list[bool]:
    """Tell which pairs of lines differ in nothing but numbers."""
    same = [x == y for x, y in zip(a.masks, b.masks, strict=True)]
    if (a.comment >= 0).any() or (b.comment >= 0).any():
        comments = zip(_comments(before, a), _comments(after, b), strict=True)
        alike = zip(same, comments, strict=True)
        same = [is_same and old == new for is_same, (old, new) in alike]
    for number in {*a.unterminated, *b.unterminated}:
        same[number] = False
    return same


class _Names:
    """Names what the numbers of lines belong to, once for lines that begin alike."""

    def __init__(self) -> None:
        self._known: dict[bytes, str | None] = {}

    def __call__(self, mask: bytes, text: str) -> str:
        """Return `target_name` of a line with a mask."""
        begin = mask.partition(b"\0")[0]
        if begin not in self._known:
            self._known[begin] = _told_by(begin.decode("latin-1"))
        name = self._known[begin]
        return target_name(text) if name is None else name


def _told_by(begin: str) -> str | None:
    """Name what numbers belong to by what is before the first, None if not told."""
    words, assigned = _TWO_WORDS.match(begin), _ASSIGNED.match(begin)
    if words:
        return f"{words[1]} {words[2]}"
    return assigned[1] if assigned else None


def _masked(lines: list[str]) -> Masked:
    """Mask lines without their endings."""
    data = [f"{line}\n".encode("latin-1") for line in lines]
    starts = np.concatenate([[0], np.cumsum([len(line) for line in data])[:-1]])
    return mask_lines(b"".join(data), starts.astype(np.int64))


def shapes(lines: list[str]) -> list[bytes]:
    """Return the masks of all lines."""
    return _masked(lines).masks if lines else []


def _comments(lines: list[str], masked: Masked) -> Iterator[str]:
    """Return the comment of every line, "" where it has none."""
    begin = 0
    for line, at in zip(lines, masked.comment.tolist(), strict=True):
        yield line[at - begin :] if at >= 0 else ""
        begin += len(line) + 1


def _numbers(masked: Masked) -> Iterator[tuple[float, ...]]:
    """Return the numbers of every line."""
    values = masked.value.tolist()
    for start, end in pairwise(masked.first.tolist()):
        yield tuple(values[start:end])


def _moves(a: Masked, b: Masked) -> list[float]:
    """Return how far the first three numbers of every line moved."""
    both = np.minimum(np.diff(a.first), np.diff(b.first)) >= 3
    moved: NDArray[np.float64] = np.full(len(both), np.nan)
    axis = np.arange(3)
    old = a.value[a.first[:-1][both, None] + axis]
    new = b.value[b.first[:-1][both, None] + axis]
    moved[both] = np.linalg.norm(new - old, axis=1)
    return [float(m) for m in moved.tolist()]


def target_name(line: str) -> str:
    """Name what a line's numbers belong to."""
    assigned = _ASSIGNED.match(line)
    if assigned:
        return assigned.group(1)
    return " ".join(found.group() for found in islice(_WORD.finditer(line), 2))
