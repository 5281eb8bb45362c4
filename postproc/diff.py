"""What differs between two programs: the numbers of targets, or more."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from postproc.arrivals import LEFT_ALONE, Arrivals, read_arrivals
from postproc.changed_lines import Row
from postproc.compared import VARIABLES, Compared, compare_files
from postproc.report import Status


@dataclass(frozen=True)
class Difference:
    """All rows in which two programs (and their variable files) differ.

    Attributes:
        rows: Lines that differ.
        stamped: The second program carries a stamp.
        left: Lines of targets that were left alone on purpose, where a record tells.
        counts: Visits by status, likewise; else empty.
    """

    rows: tuple[Row, ...]
    stamped: bool
    left: tuple[Row, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the rows as JSON text."""
        told = {
            "stamped": self.stamped,
            "counts": dict(self.counts),
            "rows": [row._asdict() for row in self.rows],
            "left": [row._asdict() for row in self.left],
        }
        return json.dumps(told, indent=1) + "\n"

    def summary(self) -> str:
        """Say in one line what differs, and what came of the targets."""
        said = self._said() if self.rows else "the targets are the same"
        counts = ", ".join(f"{n} {status}" for status, n in self.counts.items() if n)
        return f"{said}; visits: {counts}" if counts else said

    def _said(self) -> str:
        """Count the rows and their sizes."""
        sizes = [r.change_mm for r in self.rows if r.change_mm is not None]
        texts = sum(bool(r.text) for r in self.rows)
        said = f"{len(self.rows) - texts} lines with other numbers"
        if sizes:
            said += f", change mean {np.mean(sizes):.3f} mm, max {max(sizes):.3f} mm"
        return said + (f"; {texts} lines with other text" if texts else "")


def diff(original: Path, compensated: Path) -> Difference:
    """Compare two programs, and the variable files beside them.

    Raises:
        ProgramError: A file cannot be read.
    """
    files = [compare_files(original, compensated)]
    values = original.with_suffix(VARIABLES), compensated.with_suffix(VARIABLES)
    if original.suffix.lower() != VARIABLES and all(v.is_file() for v in values):
        files.append(compare_files(*values))
    told = read_arrivals(compensated, [(f.original, f.compensated) for f in files])
    rows = [row for f in files for row in _marked(f.rows, told.get(f.original.name))]
    left = [row for f in files for row in _left(f, told.get(f.original.name))]
    return Difference(tuple(rows), files[0].stamped, tuple(left), _counts(told))


def _marked(rows: Sequence[Row], told: Arrivals | None) -> Iterator[Row]:
    """Add to every row what the record says of its line."""
    if told is None:
        yield from rows
        return
    found = told.find([row.line for row in rows]).tolist()
    for row, k in zip(rows, found, strict=True):
        yield row if k < 0 else _with(row, told, k)


def _with(row: Row, told: Arrivals, k: int) -> Row:
    """Add the k-th entry of a record to a row."""
    return row._replace(
        status=Status(told.status[k]).name.lower(),
        why=told.reasons[told.why[k]],
        direction=tuple(told.direction[k].tolist()),
        correction_mm=float(told.correction_mm[k]),
    )


def _left(file: Compared, told: Arrivals | None) -> Iterator[Row]:
    """List the targets that were left alone."""
    if told is None:
        return
    differ = {row.line for row in file.rows}
    for k in np.flatnonzero(np.isin(told.status, LEFT_ALONE)).tolist():
        line = int(told.line[k])
        if line not in differ:
            bare = Row(file.original.name, line, file.target(line), (), (), None)
            yield _with(bare, told, k)


def _counts(told: Mapping[str, Arrivals]) -> dict[str, int]:
    """Add up the visits of every status."""
    return {
        s.name.lower(): sum(a.counts[s.name.lower()] for a in told.values())
        for s in Status
        if told
    }
