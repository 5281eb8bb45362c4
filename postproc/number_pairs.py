"""Pairs of lines whose numbers stand at the same places: read without their shapes.

What is not a digit or a dot is compared as it is; then every run of digits of one line
has its partner in the other, and strings, comments and signs have to be looked for in
one of both only. Lines with other blanks or signs, or with anything that `masking`
leaves to `lexis`, are not told alike here, which does not say that they are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from postproc.arrays import Bools, Bytes, Floats, Ints
from postproc.language.scan import (
    Plain,
    in_code,
    line_of,
    numeric_bytes,
    plain_numbers,
    quotes_and_comments,
    runs_of,
    values,
    with_signs,
)

LONGEST = 24  # digits outside of numbers that are compared; longer: not told alike


@dataclass(frozen=True)
class Pairs:
    """Pairs of lines and the numbers on those that are alike (structure of arrays).

    Attributes:
        alike: Lines that are known to differ in nothing but numbers, (n,).
        owner: Line of every number, ascending, (m,).
        old, new: The numbers, (m,).
        place: Where they start in the first line of their pair, (m,).
    """

    alike: Bools
    owner: Ints
    old: Floats
    new: Floats
    place: Ints

    def with_more(self, rows: Ints, more: Pairs) -> Pairs:
        """Add what a closer look has found on some lines that are not alike here."""
        alike = self.alike.copy()
        alike[rows] = more.alike
        owner = np.concatenate([self.owner, rows[more.owner]])
        order = np.argsort(owner, kind="stable")
        columns = ("old", "new", "place")
        both = [np.append(getattr(self, c), getattr(more, c))[order] for c in columns]
        return Pairs(alike, owner[order], *both)


@dataclass(frozen=True)
class _Text:
    """Lines as one text, and its runs of digits and dots.

    Attributes:
        a: The bytes; every line ends with a line feed.
        line: Where its lines begin, (n,).
        start, end: Its runs, (r,).
        rest: The bytes with one NUL in the place of every run.
    """

    a: Bytes
    line: Ints
    start: Ints
    end: Ints
    rest: Bytes

    @classmethod
    def of(cls, lines: Sequence[bytes]) -> Self:
        """Join lines."""
        a = np.frombuffer(b"\n".join([*lines, b""]), dtype=np.uint8)
        line = np.append(0, np.flatnonzero(a == 10)[:-1] + 1)
        numeric = numeric_bytes(a)
        start, end = runs_of(numeric)
        rest = a.copy()
        rest[start] = 0
        numeric[start] = False
        return cls(a, line, start, end, rest[~numeric])

    @property
    def marked(self) -> bool:
        """Tell whether every NUL in what is left of it stands for a run."""
        return bool((self.a != 0).all())

    def on(self, lines: Bools) -> Self:
        """Return the runs on some lines only."""
        mine = lines[line_of(self.line, self.start)]
        return replace(self, start=self.start[mine], end=self.end[mine])


def pair_numbers(before: Sequence[bytes], after: Sequence[bytes]) -> Pairs:
    """Read the numbers of pairs of lines.

    Args:
        before: Lines without their endings, at least one.
        after: As many.
    """
    a, b = _Text.of(before), _Text.of(after)
    if not (a.marked and b.marked):
        none, ints = np.empty(0), np.empty(0, dtype=np.int64)
        return Pairs(np.zeros(len(before), dtype=bool), ints, none, none, ints)
    if np.array_equal(a.rest, b.rest):
        return _read(a, b, np.ones(len(before), dtype=bool))
    same = _same_lines(a.rest, b.rest)
    return _read(a.on(same), b.on(same), same)


def _same_lines(a: Bytes, b: Bytes) -> Bools:
    """Tell which of equally many lines, each with its line feed, are the same."""
    lengths = [np.diff(np.flatnonzero(text == 10), prepend=-1) for text in (a, b)]
    same: Bools = lengths[0] == lengths[1]
    if not same.all():
        both = zip((a, b), lengths, strict=True)
        a, b = (text[np.repeat(same, length)] for text, length in both)
    lines, ends = np.flatnonzero(same), np.cumsum(lengths[0][same])
    same[lines[np.searchsorted(ends, np.flatnonzero(a != b), side="right")]] = False
    return same


def _read(a: _Text, b: _Text, alike: Bools) -> Pairs:
    """Read the numbers on lines whose runs have partners."""
    quotes, comment, odd = quotes_and_comments(a.a, a.line)
    odd |= ~alike
    code = np.flatnonzero(in_code(a.start, quotes, comment, a.line))
    runs = plain_numbers(a.a, a.start[code], a.end[code])
    others = plain_numbers(b.a, b.start[code], b.end[code])
    unsure = runs.odd | others.odd | (runs.number != others.number)
    odd[line_of(a.line, runs.first[unsure])] = True
    bare = np.ones(len(a.start), dtype=bool)
    bare[code[runs.number]] = False
    other = np.flatnonzero(bare)
    changed = other[~_same_runs(a, b, other)]
    odd[line_of(a.line, a.start[changed])] = True
    runs, others = runs.take(runs.number), others.take(runs.number)
    start, far = with_signs(a.a, runs.first)
    odd[line_of(a.line, far)] = True
    return _numbers(a, b, runs, others, start, odd)


def _numbers(
    a: _Text, b: _Text, runs: Plain, others: Plain, start: Ints, odd: Bools
) -> Pairs:
    """Read the numbers on lines that are not odd."""
    owner = line_of(a.line, start)
    plain = ~odd[owner]
    if not plain.all():
        runs, others = runs.take(plain), others.take(plain)
        start, owner = start[plain], owner[plain]
    partner = others.first - (runs.first - start)  # the same sign, as far before it
    old, new = values(a.a, runs, start), values(b.a, others, partner)
    return Pairs(~odd, owner, old, new, start - a.line[owner])


def _same_runs(a: _Text, b: _Text, some: Ints) -> Bools:
    """Tell which of some runs are the same bytes in both texts."""
    start, other = a.start[some], b.start[some]
    length = a.end[some] - start
    same: Bools = (length == b.end[some] - other) & (length <= LONGEST)
    for k in range(int(length[same].max(initial=0))):
        at = np.flatnonzero(same & (k < length))
        same[at] = a.a[start[at] + k] == b.a[other[at] + k]
    return same
