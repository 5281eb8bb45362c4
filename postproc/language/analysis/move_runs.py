"""Moves that follow each other and differ only in where they go, read at once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence, Set
from itertools import pairwise
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, chunks
from postproc.language.analysis.control_flow import ControlFlow
from postproc.language.text.statement_table import StatementText

LEAST = 8  # statements that are worth it
Runs = dict[int, int]
"""From the first row that is read for all, to the row behind the last such one."""


def find_runs(
    text: StatementText[Any],
    flow: ControlFlow,
    apart: Set[int],
    places_of: Callable[[Any], Sequence[int] | None],
    plain: Callable[[Floats], Bools],
) -> Runs:
    """Find the moves of a routine that differ only in where they go.

    All numbers else, and all words, are the same in them. The first and the last of
    such a run are read by themselves: what comes before or behind tells of them.

    Args:
        text: The statements of its file.
        flow: The routine.
        apart: Rows that are read by themselves.
        places_of: Which numbers of a statement (by their place in it) say nothing but
            where it goes, None for statements of another kind.
        plain: Tells which numbers of this kind, (m, k), need no word of their own.
    """
    runs: Runs = {}
    for first, behind in _alike(text, flow, apart):
        places = places_of(text.statement(first))
        if places is None:
            continue
        start, end = int(text.first[first]), int(text.first[behind])
        numbers = text.value[start:end].reshape(behind - first, -1)
        rows = chunks(len(numbers))
        own = np.concatenate([plain(numbers[k][:, places]) for k in rows])
        same = own[1:] & own[:-1]
        for column in {*range(numbers.shape[1])}.difference(places):
            same &= numbers[1:, column] == numbers[:-1, column]
        cuts = [0, *(np.flatnonzero(~same) + 1).tolist(), len(numbers)]
        for a, b in pairwise(cuts):
            if b - a >= LEAST:
                runs[first + a + 1] = first + b - 1
    return runs


def _alike(
    text: StatementText[Any], flow: ControlFlow, apart: Set[int]
) -> Iterator[tuple[int, int]]:
    """Yield the rows of statements of one shape on one way: first, and behind."""
    shape = text.shape[flow.first : flow.last]
    cut = np.zeros(len(shape) + 1, dtype=bool)
    cut[1:-1] = shape[1:] != shape[:-1]
    cut[[0, -1]] = True
    cut[[row - flow.first for row in flow.joins if flow.first <= row < flow.last]] = (
        True
    )
    for row in apart & {*range(flow.first, flow.last)}:
        cut[row - flow.first : row - flow.first + 2] = True
    at = np.flatnonzero(cut)
    long = np.flatnonzero(np.diff(at) >= LEAST)
    for k in long.tolist():
        yield flow.first + int(at[k]), flow.first + int(at[k + 1])


def rows_of_lines(text: StatementText[Any], lines: Collection[int]) -> set[int]:
    """Return the statements that stand on some lines."""
    return {row for line in lines for row in text.rows_on(line)}
