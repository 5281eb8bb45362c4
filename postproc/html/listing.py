"""Source lines for a page: all of a small program, the moves of a large one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from postproc.html.columns import Columns
from postproc.html.text import short, visible
from postproc.language.source import Source

WHOLE = 150_000  # lines of all files together, up to which the page carries them all
LONGEST = 500  # characters of a line

Listing = dict[str, dict[str, list[int] | list[str]]]


def listing(sources: Mapping[str, bytes], columns: Columns) -> Listing:
    """Choose the lines that a page shows.

    Args:
        sources: Bytes by file name, perhaps none.
        columns: The visits on the page.

    Returns:
        By file name ``line``, the first line of every stretch and how many there are,
        alternating, and ``text``, the lines.
    """
    given = {name: Source(name, data) for name, data in sources.items()}
    total = sum(len(source.line_starts) for source in given.values())
    out: Listing = {}
    for name, source in given.items():
        last = len(source.line_starts)
        wanted = np.arange(1, last + 1) if total <= WHOLE else _used(columns, name)
        wanted = wanted[(wanted >= 1) & (wanted <= last)]
        out[visible(name)] = {"line": stretches(wanted), "text": _texts(source, wanted)}
    return out


def _used(columns: Columns, name: str) -> NDArray[np.int64]:
    """Return the lines of a file that the visits name, ascending."""
    pairs = (
        (columns.file, columns.line),
        (columns.literal_file, columns.literal_line),
    )
    number = [k for k, file in enumerate(columns.files) if file == name]
    lines = [line[np.isin(file, number)] for file, line in pairs]
    return np.unique(np.concatenate(lines))


def stretches(lines: NDArray[np.int64]) -> list[int]:
    """Pack ascending line numbers.

    >>> stretches(np.array([3, 4, 5, 9]))
    [3, 3, 9, 1]
    """
    if len(lines) == 0:
        return []
    first = np.flatnonzero(np.diff(lines, prepend=lines[0] - 2) != 1)
    count = np.diff(np.append(first, len(lines)))
    return [int(v) for v in np.column_stack([lines[first], count]).ravel()]


def _texts(source: Source, lines: Iterable[int]) -> list[str]:
    """Take lines out of a file, fit to look at."""
    starts = np.append(source.line_starts, len(source.data)).tolist()
    text = source.text
    return [
        short(visible(text[starts[k - 1] : starts[k]].rstrip("\r\n")), LONGEST)
        for k in np.asarray(lines).tolist()
    ]
