"""What differs between two programs: the numbers of targets, or more."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from postproc.compared import Compared, compare_files
from postproc.compensation.outcome import LEFT_ALONE, Arrivals, Status, read_arrivals
from postproc.compensation.parallel import meanwhile
from postproc.files import VARIABLES
from postproc.rows import Row, Rows

LONG = 10_000_000  # bytes of a file whose record is read beside it


@dataclass(frozen=True)
class Difference:
    """All rows in which two programs (and their variable files) differ.

    Attributes:
        differing: Lines that differ, file by file.
        stamped: The second program carries a stamp.
        untouched: Lines of targets that were left alone on purpose, where a record
            tells, file by file.
        counts: Visits by status, likewise; else empty.
    """

    differing: tuple[Rows, ...]
    stamped: bool
    untouched: tuple[Rows, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All lines that differ, one object each: for programs of some lines."""
        return tuple(row for part in self.differing for row in part)

    @cached_property
    def left(self) -> tuple[Row, ...]:
        """All lines that were left alone, likewise."""
        return tuple(row for part in self.untouched for row in part)

    def __bool__(self) -> bool:
        """Tell whether a line differs."""
        return any(len(part) > 0 for part in self.differing)

    def summary(self) -> str:
        """Say in one line what differs, and what came of the targets."""
        said = self._said() if self else "the targets are the same"
        counts = ", ".join(f"{n} {status}" for status, n in self.counts.items() if n)
        return f"{said}; visits: {counts}" if counts else said

    def _said(self) -> str:
        """Count the rows and their sizes."""
        sizes = np.concatenate([r.change_mm[r.has_change] for r in self.differing])
        texts = sum(len(r.texts) for r in self.differing)
        numbers = sum(len(r) for r in self.differing) - texts
        said = f"{numbers} lines with other numbers"
        if len(sizes):
            said += f", change mean {np.mean(sizes):.3f} mm, max {max(sizes):.3f} mm"
        return said + (f"; {texts} lines with other text" if texts else "")


def diff(original: Path, compensated: Path) -> Difference:
    """Compare two programs, and the variable files beside them.

    Raises:
        ProgramError: A file cannot be read.
    """
    pairs = [(original, compensated)]
    values = original.with_suffix(VARIABLES), compensated.with_suffix(VARIABLES)
    if original.suffix.lower() != VARIABLES and all(v.is_file() for v in values):
        pairs.append(values)
    told_by = partial(read_arrivals, compensated, pairs)
    with meanwhile(told_by, worth=_long(pairs)) as ask:
        files = [compare_files(*pair) for pair in pairs]
        told = ask()
    found = [(f, told.get(f.original.name)) for f in files]
    rows = tuple(f.rows.with_told(own) for f, own in found)
    left = tuple(_left(f, own) for f, own in found if own is not None)
    return Difference(rows, files[0].stamped, left, _counts(told))


def _long(pairs: Iterable[tuple[Path, Path]]) -> bool:
    """Tell whether reading the record takes long."""
    return any(old.is_file() and old.stat().st_size > LONG for old, _ in pairs)


def _left(file: Compared, told: Arrivals) -> Rows:
    """List the targets that were left alone."""
    alone = told.line[np.isin(told.status, LEFT_ALONE)]
    lines = alone[~np.isin(alone, file.rows.line)]
    return Rows.bare(file.original.name, lines, file.targets(lines)).with_told(told)


def _counts(told: Mapping[str, Arrivals]) -> dict[str, int]:
    """Add up the visits of every status."""
    return {
        s.name.lower(): sum(a.counts[s.name.lower()] for a in told.values())
        for s in Status
        if told
    }
