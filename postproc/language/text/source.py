"""Source text as bytes, places in it, and edits that leave every other byte alone."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, wraps
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from postproc import _native
from postproc.arrays import Bytes, Indices, Ints, chunks
from postproc.exceptions import PostprocError, ProgramError

AT_ONCE = 50_000  # edits that are Python objects at the same time
T = TypeVar("T")
LAST = 2**31 - 1  # offset in a file; none that is read is as long
KEPT_FILES = 256  # of which is kept what was found in them
KEPT_BYTES = 1 << 18  # of such a file, at the most


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

    start: Indices
    end: Indices
    new: NDArray[np.bytes_]

    def __post_init__(self) -> None:
        """Refuse what is not in order.

        Raises:
            ValueError: Edits overlap or are not sorted.
        """
        if (self.start > self.end).any() or (self.start[1:] < self.end[:-1]).any():
            raise ValueError("edits overlap or are not in ascending order")

    @classmethod
    def join(cls, parts: Sequence[Replacements]) -> Replacements:
        """Put edits one after the other."""
        last = max((int(p.end[-1]) for p in parts if len(p)), default=0)
        none = np.empty(0, dtype=np.int32 if last <= LAST else np.int64)
        return cls(
            np.concatenate([none, *(p.start for p in parts)], dtype=none.dtype),
            np.concatenate([none, *(p.end for p in parts)], dtype=none.dtype),
            np.concatenate([np.empty(0, dtype="S1"), *(p.new for p in parts)]),
        )

    @classmethod
    def merge(cls, parts: Sequence[Replacements]) -> Replacements:
        """Put edits together whatever their order."""
        if all(a.end[-1] <= b.start[0] for a, b in pairwise(filter(len, parts))):
            return cls.join(parts)
        start = np.concatenate([part.start for part in parts])
        end = np.concatenate([part.end for part in parts])
        new = np.concatenate([part.new for part in parts])
        order = np.argsort(start, kind="stable")
        return cls(start[order], end[order], new[order])

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
        return (self[some] for some in chunks(len(self), AT_ONCE))

    def apply(self, data: bytes) -> bytes:
        """Apply to a text.

        Raises:
            ValueError: An edit lies outside.
        """
        return _native.weave(data, *self._columns())

    def reproduces(
        self, data: bytes, found: bytes, stamp: tuple[int, int] = (0, 0)
    ) -> bool:
        """Tell whether a text is what comes of these edits of another, to the byte.

        Args:
            data: The text before.
            found: The text in question.
            stamp: Bytes of it that are not looked at: where they begin and end.

        Raises:
            ValueError: An edit lies outside.
        """
        return _native.is_woven(data, *self._columns(), found, stamp)

    def _columns(self) -> tuple[Indices, Indices, Bytes]:
        """Return the edits as the core takes them."""
        if len(self) and (self.start[0] < 0 or self.end[-1] > LAST):
            raise ValueError("an edit lies outside")
        start, end = (np.ascontiguousarray(c, np.int32) for c in (self.start, self.end))
        return start, end, as_bytes(self.new)

    def invert(self, data: bytes, after: int = 0) -> Replacements:
        """Return the edits of the result that give the text back.

        Args:
            data: The text.
            after: Bytes that stand before the result.
        """
        start, end, _ = self._columns()
        old = as_texts(_native.cut(data, start, end))
        growth = self.growth
        moved = start + after + np.cumsum(growth, dtype=np.int32) - growth
        return Replacements(moved, moved + (end - start) + growth, old)

    @property
    def growth(self) -> Indices:
        """Return how much longer the text becomes by each edit, (m,)."""
        grown = [np.char.str_len(p.new) - (p.end - p.start) for p in self.pieces()]
        return np.concatenate([np.empty(0, np.int32), *grown], dtype=np.int32)


def as_bytes(texts: NDArray[np.bytes_]) -> Bytes:
    """See texts as rows of bytes, filled up with NUL, which no text holds."""
    rows = np.ascontiguousarray(texts).view(np.uint8)
    return rows.reshape(len(texts), texts.dtype.itemsize)


def as_texts(rows: Bytes) -> NDArray[np.bytes_]:
    """See rows of bytes, filled up with NUL, as texts."""
    texts: NDArray[np.bytes_] = rows.view(f"S{rows.shape[1]}")[:, 0]
    return texts


@dataclass(frozen=True)
class NumberSpans:
    """Where m numbers stand in a text, in ascending order, in 3 bytes each as a rule.

    Attributes:
        base: Byte offset of every sixteenth of them.
        offset: How far behind that each begins, (m,).
        length: Its bytes, (m,).
    """

    base: Indices
    offset: NDArray[np.unsignedinteger[Any]]
    length: NDArray[np.unsignedinteger[Any]]

    def __len__(self) -> int:
        """Return how many numbers there are."""
        return len(self.offset)

    @property
    def start(self) -> Indices:
        """Return where all of them begin, (m,)."""
        return self.starts(slice(0, len(self)))

    @property
    def end(self) -> Indices:
        """Return where all of them end, (m,)."""
        return self.ends(slice(0, len(self)))

    def starts(self, rows: Indices | slice) -> Indices:
        """Return where some of them begin."""
        own = np.arange(rows.start, rows.stop) if isinstance(rows, slice) else rows
        first: Indices = self.base[own // _native.TOGETHER]
        first += self.offset[rows]
        return first

    def ends(self, rows: Indices | slice) -> Indices:
        """Return where some of them end."""
        return self.starts(rows) + self.length[rows].astype(np.int32)


_LINE_END = re.compile(rb"\r\n|\n|\r")
UTF8_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class Source:
    """A text file as it lies on disk.

    Attributes:
        name: The file as the user named it (``-`` for standard input).
        data: Its bytes, never normalised.
    """

    name: str
    data: bytes

    @cached_property
    def text(self) -> str:
        """Return the bytes as Latin-1, so that text offsets are byte offsets."""
        return self.data.decode("latin-1")

    @cached_property
    def line_starts(self) -> Indices:
        """Return the offsets at which lines start, (n,); CR, LF and CRLF end a line."""
        return _native.line_starts(self.data)

    @cached_property
    def newline(self) -> bytes:
        """Return the line ending of the first line (CRLF where there is none)."""
        found = _LINE_END.search(self.data)
        return found.group() if found else b"\r\n"

    def line_of(self, offset: int) -> int:
        """Return the 1-based line that holds an offset."""
        return int(np.searchsorted(self.line_starts, offset, side="right"))

    def lines_of(self, offsets: Indices) -> Ints:
        """Return the 1-based lines that offsets stand on, of any shape."""
        return np.searchsorted(self.line_starts, offsets, side="right")

    def line_text(self, line: int) -> str:
        """Return a 1-based line without its line ending."""
        start = int(self.line_starts[line - 1])
        end = _LINE_END.search(self.data, start)
        return self.text[start : end.start() if end else len(self.data)]


ParsedFiles = dict[str, tuple[Source, Any]]
"""Files by name as they were read, and what was parsed of them."""


def parse_once(
    known: ParsedFiles | None, source: Source, parse: Callable[[Source], T]
) -> T:
    """Parse a file, unless it is known as it is; it is then."""
    if known is None:
        return parse(source)
    if source.name not in known or known[source.name][0] != source:
        known[source.name] = source, parse(source)
    found: T = known[source.name][1]
    return found


def keep_short(find: Callable[..., T]) -> Callable[..., T]:
    """Let a function keep what it finds in short sources, which it is given last."""
    keeping = lru_cache(KEPT_FILES)(find)

    @wraps(find)
    def either(*given: Any) -> T:
        sizes = (len(one.data) for one in given if isinstance(one, Source))
        return (keeping if sum(sizes) <= KEPT_BYTES else find)(*given)

    return either


@keep_short
def parse_shared(parse: Callable[[Source], T], source: Source) -> T:
    """Parse a file that many programs of a folder read, once for all of them."""
    return parse(source)


def source_from_bytes(name: str, data: bytes) -> Source:
    """Take bytes as a program, or refuse what can be none.

    Raises:
        ProgramError: The file is empty, binary or too long.
    """
    if len(data) > LAST:
        raise ProgramError(
            name,
            f"has {len(data):,} bytes; at most {LAST:,} can be read",
            "Divide the program",
        )
    said = data.removeprefix(UTF8_MARK)  # itself where there is no mark: no copy
    if not said or said.isspace():
        raise ProgramError(name, "the file is empty", "Give the text of a program")
    nul = data.find(b"\0")
    if nul >= 0:
        line = len(_LINE_END.findall(data, 0, nul)) + 1
        raise ProgramError(
            name,
            "the file is binary (it holds NUL bytes)",
            "Give the text of the program, not what was compiled from it, in an 8-bit "
            "encoding",
            line=line,
        )
    return Source(name, data)


def apply(data: bytes, edits: Iterable[Edit]) -> bytes:
    """Apply edits and keep every other byte.

    Raises:
        ValueError: Edits overlap or lie outside of the data.

    >>> apply(b"MOVE TO {1.0}", [Edit(Span(9, 12), b"1.00025")])
    b'MOVE TO {1.00025}'
    """
    if isinstance(edits, Replacements):
        return edits.apply(data)
    parts: list[bytes] = []
    done = 0
    for (start, end), new in sorted(edits, key=lambda edit: edit.span):
        if not done <= start <= end <= len(data):
            raise ValueError(f"edit of bytes {start} to {end} overlaps or lies outside")
        parts += (data[done:start], new)
        done = end
    parts.append(data[done:])
    return b"".join(parts)


def compose(first: Iterable[Edit], second: Iterable[Edit]) -> list[Edit]:
    """Make one list of edits of two that follow each other.

    Args:
        first: Edits of a text.
        second: Edits of what comes out, each inside or outside of a new piece.

    Raises:
        ValueError: An edit of the second list reaches over the border of a new piece.

    >>> data, first = b"p := 1", [Edit(Span(6, 6), b" q := 1")]
    >>> second = [Edit(Span(5, 6), b"2.0"), Edit(Span(12, 13), b"3.0")]
    >>> apply(data, compose(first, second))
    b'p := 2.0 q := 3.0'
    """
    later = deque(sorted(second, key=lambda edit: edit.span))
    found, shift = list[Edit](), 0  # from the first text to what comes out

    def take_over(until: float) -> None:
        while later and later[0].span.end <= until:
            (a, b), text = later.popleft()
            found.append(Edit(Span(a - shift, b - shift), text))

    for (start, end), new in sorted(first, key=lambda edit: edit.span):
        begin = start + shift
        take_over(begin)
        inside = []
        while later and later[0].span.start < begin + len(new):
            (a, b), text = later.popleft()
            if a < begin or b > begin + len(new):
                raise ValueError("an edit reaches over the border of another")
            inside.append(Edit(Span(a - begin, b - begin), text))
        found.append(Edit(Span(start, end), apply(new, inside)))
        shift += len(new) - (end - start)
    take_over(math.inf)
    return found


# New text in a file's own layout: line ends and lengths.

LONGEST_LINE = 254  # characters of a line (likely), unless the file has longer ones


class CloneError(PostprocError):
    """A variable cannot be cloned safely; the text says why."""


def insert_after(source: Source, line: int, text: str) -> Edit:
    """Insert a line (or several) behind another, with the line ending that it has.

    Raises:
        CloneError: A line would get too long.
    """
    for part in re.split(r"\r\n|\n|\r", text):
        check_length(source, len(part))
    new = text.encode("latin-1")
    found = _LINE_END.search(source.data, int(source.line_starts[line - 1]))
    if found is None:
        at = len(source.data)
        return Edit(Span(at, at), source.newline + new)
    return Edit(Span(found.end(), found.end()), new + found.group())


def check_length(source: Source, length: int, most: int = LONGEST_LINE) -> None:
    """Refuse a line that is longer than lines of the language, and of its file, are.

    Raises:
        CloneError: It is.
    """
    if length <= most:
        return
    longest = int(np.diff(source.line_starts, append=len(source.data)).max())
    if length > longest:
        raise CloneError(f"a line would be longer than {most} characters")


def find_free_name(old: str, taken: set[str], longest: int) -> str:
    """Find a name for a clone that nothing has, and add it to those in use.

    Args:
        old: Name of the original.
        taken: All names in use, in lower case.
        longest: Characters that a name may have.

    Raises:
        CloneError: It would be too long.

    >>> find_free_name("Weld", {"weld", "WELD__2".lower()}, 32)
    'Weld__3'
    """
    number = 2
    while f"{old}__{number}".lower() in taken:
        number += 1
    name = f"{old}__{number}"
    if len(name) > longest:
        raise CloneError(f"{name} would be longer than {longest} characters")
    taken.add(name.lower())
    return name
