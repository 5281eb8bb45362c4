"""The lines of a long file, cut out of its bytes where they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from postproc.arrays import Ints, pieces

AT_ONCE = 1_000_000  # bytes in which line feeds are looked for


@dataclass(frozen=True, eq=False)
class TextLines(Sequence[bytes]):
    r"""Lines without their endings, as ``data.split(b"\n")`` gives them.

    A million lines as objects of their own take as long to make as to compare, and
    half as much memory again; where a process is forked, they are not shared.

    Attributes:
        data: The file.
        first: Where its lines begin, and one more behind the last one, (n + 1,).
    """

    data: bytes
    first: Ints

    @classmethod
    def of(cls, data: bytes, skipped: int = 0) -> Self:
        r"""Find the lines of a file, but for some in front.

        >>> list(TextLines.of(b"a\n\nb\n", 1))
        [b'', b'b', b'']
        """
        a = np.frombuffer(data, dtype=np.uint8)
        found = (
            np.flatnonzero(a[some] == 10) + some.start
            for some in pieces(len(a), AT_ONCE)
        )
        ends = np.concatenate([*found, np.array([len(a)])])
        return cls(data, np.append(0, ends + 1)[skipped:])

    def __len__(self) -> int:
        """Count the lines."""
        return len(self.first) - 1

    def __iter__(self) -> Iterator[bytes]:
        """Cut out all lines."""
        return iter(self[:])

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        """Cut out the k-th line, or a list of those of a slice."""
        rows = range(len(self))[k]
        if isinstance(rows, int):
            return self.data[self.first[rows] : self.first[rows + 1] - 1]
        if rows.step != 1:
            return [self[row] for row in rows]
        begin, end = self.first[[rows.start, rows.stop]] if rows else (0, 0)
        return self.data[begin : end - 1].split(b"\n") if rows else []
