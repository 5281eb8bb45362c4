"""What is to be changed in a text: single edits, or a million of them as arrays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Ints, pieces

AT_ONCE = 50_000  # edits that are Python objects at the same time
WOVEN = 10_000  # edits made at once: array passes that fit the cache


class Span(NamedTuple):
    """Bytes `start` up to, but not including, `end` of a file."""

    start: int
    end: int


class Edit(NamedTuple):
    """Replace the bytes of `span` by `new`."""

    span: Span
    new: bytes


@dataclass(frozen=True, eq=False)
class Replacements(Sequence[Edit]):
    """Edits in ascending order that do not overlap (structure of arrays).

    Attributes:
        start, end: Offsets of the bytes to replace, (m,).
        new: What replaces them, (m,) strings of bytes.
    """

    start: Ints
    end: Ints
    new: NDArray[np.bytes_]

    def __post_init__(self) -> None:
        """Refuse what is not in order.

        Raises:
            ValueError: Edits overlap or are not sorted.
        """
        if (self.start > self.end).any() or (self.start[1:] < self.end[:-1]).any():
            raise ValueError("edits overlap or are not in ascending order")

    @classmethod
    def joined(cls, parts: Sequence[Replacements]) -> Replacements:
        """Put edits one after the other."""
        none = np.empty(0, dtype=np.int64)
        return cls(
            np.concatenate([none, *(p.start for p in parts)]),
            np.concatenate([none, *(p.end for p in parts)]),
            np.concatenate([np.empty(0, dtype="S1"), *(p.new for p in parts)]),
        )

    @classmethod
    def merged(cls, parts: Sequence[Replacements]) -> Replacements:
        """Put edits together whatever their order."""
        if all(a.before(b) for a, b in pairwise(part for part in parts if len(part))):
            return cls.joined(parts)
        start = np.concatenate([part.start for part in parts])
        end = np.concatenate([part.end for part in parts])
        new = np.concatenate([part.new for part in parts])
        order = np.argsort(start, kind="stable")
        return cls(start[order], end[order], new[order])

    def before(self, other: Replacements) -> bool:
        """Tell whether all of these end before the others begin."""
        return bool(self.end[-1] <= other.start[0])

    @classmethod
    def of(cls, edits: Iterable[Edit]) -> Replacements:
        """Take single edits."""
        found = sorted(edits, key=lambda edit: edit.span)
        spans = np.array([e.span for e in found], dtype=np.int64).reshape(-1, 2)
        return cls(spans[:, 0], spans[:, 1], np.array([e.new for e in found], "S"))

    def __len__(self) -> int:
        """Return the number of edits."""
        return len(self.start)

    @overload
    def __getitem__(self, row: int) -> Edit: ...
    @overload
    def __getitem__(self, row: slice) -> Replacements: ...
    def __getitem__(self, row: int | slice) -> Edit | Replacements:
        """Return one edit or some."""
        if isinstance(row, slice):
            return Replacements(self.start[row], self.end[row], self.new[row])
        span = Span(int(self.start[row]), int(self.end[row]))
        return Edit(span, bytes(self.new[row]))

    def __iter__(self) -> Iterator[Edit]:
        """Go through the edits."""
        for some in self.pieces():
            spans = map(Span, some.start.tolist(), some.end.tolist())
            yield from map(Edit, spans, some.new.tolist())

    def pieces(self) -> Iterator[Replacements]:
        """Cut into pieces that may become Python objects."""
        return (self[some] for some in pieces(len(self), AT_ONCE))

    def apply(self, data: bytes) -> bytes:
        """Apply to a text.

        Raises:
            ValueError: An edit lies outside.
        """
        return b"".join(self.applied(data))

    def applied(self, data: bytes) -> Iterator[bytes]:
        """Apply to a text; yield the result piece by piece.

        Raises:
            ValueError: An edit lies outside.
        """
        if len(self) and not (self.start[0] >= 0 and self.end[-1] <= len(data)):
            raise ValueError("an edit lies outside")
        done = 0
        for rows in pieces(len(self), WOVEN):
            some = self[rows]
            yield _woven(data, done, some)
            done = int(some.end[-1])
        yield data[done:]

    def undone(self, data: bytes, after: int = 0) -> Replacements:
        """Return the edits of the result that give the text back.

        Args:
            data: The text.
            after: Bytes that stand before the result.
        """
        length = np.char.str_len(self.new).astype(np.int64)
        growth = length - (self.end - self.start)
        start = self.start + after + np.cumsum(growth) - growth
        old = [_cut(data, some.start, some.end) for some in self.pieces()]
        originals = np.concatenate([np.empty(0, dtype="S1"), *old])
        return Replacements(start, start + length, originals)


def _woven(data: bytes, done: int, edits: Replacements) -> bytes:
    """Return a text from `done` up to the end of some edits, with these made."""
    text = np.frombuffer(data, dtype=np.uint8)[done : int(edits.end[-1])]
    new = as_bytes(edits.new)
    fills = new != 0
    kept = edits.start - np.append(done, edits.end[:-1])
    inside = _every_second(kept, edits.end - edits.start)
    written = _every_second(kept, np.count_nonzero(fills, axis=1))
    out = np.empty(len(written), dtype=np.uint8)
    out[written] = new[fills]
    out[~written] = text[~inside]
    return out.tobytes()


def _every_second(apart: Ints, length: Ints) -> NDArray[np.bool_]:
    """Mark stretches of bytes of some lengths that lie so far apart from each other."""
    marks = np.tile([False, True], len(length))
    return np.repeat(marks, np.column_stack([apart, length]).ravel())


def as_bytes(texts: NDArray[np.bytes_]) -> NDArray[np.uint8]:
    """See texts as rows of bytes, filled up with NUL, which no text holds."""
    rows = np.ascontiguousarray(texts).view(np.uint8)
    return rows.reshape(len(texts), texts.dtype.itemsize)


def _cut(data: bytes, start: Ints, end: Ints) -> NDArray[np.bytes_]:
    """Cut short pieces out of a text, which holds no NUL."""
    length = end - start
    width = max(int(length.max()), 1)
    column = np.arange(width)
    place = np.minimum(start[:, None] + column, len(data) - 1)
    rows = np.frombuffer(data, dtype=np.uint8)[place]
    rows[column >= length[:, None]] = 0
    cut: NDArray[np.bytes_] = rows.view(f"S{width}")[:, 0]
    return cut
