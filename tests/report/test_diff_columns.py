"""Rows, listing and JSON made in columns are those made line by line."""

from __future__ import annotations

import io
import random
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from postproc.compensation.outcome import Status
from postproc.compensation.output.line_outcomes import LineOutcomes
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.report.diff import (
    Difference,
    DiffRow,
    DiffRows,
    TextLines,
    describe_changes,
    diff,
    join_rows,
)
from postproc.report.diff_output import difference_pieces, print_difference
from tests.reference.text import mask_line, number_value
from tests.report.diff_reference import json_of, list_rows, rows_of

LINES = (
    "  MOVEFLY LINEAR TO POS({}, {}, {}, {}, {}, {},'W T1:0 T2:0 T3:0') ADVANCE",
    "  MOVE JOINT TO {{{}, {}, {}, {}, {}, {}}}",
    "WP_{n} := POS({}, {}, - {}, 4, 5, 6, '') -- to {{3}}",
    " X: {}  Y: {}  Z: {}  A: {}  E: {}  R: {}  1: 22",
    "tab[{n}].x := {} -- {}",
    "WRITE ('{} m', {})",
    "\xe9t\xe9 := {}",
    "p := f({}e3, 0x{n}, {}, .5, {})",
    "{}",
    "s := 'open {}",
    'q := "{}" + {}',
    "list := [" + ", ".join(["{}"] * 20) + "]",
    "huge := POS(1e999, {}, {}, {}, {})",
    "\x01x\x1by := {} ",
    "ELSE: MOVE LINEAR TO POS({}, {}, {}, {}, {}, {}, '')",
    "CASE ({n}): MOVEFLY JOINT TO {{{}, {}, {}, {}, {}, {}}} ADVANCE",
    "again:: wp[{n}] := POS({}, {}, {}, {}, {}, {}, '')",
)


def number(rng: random.Random) -> str:
    """Write a number as programs do."""
    value = rng.choice([rng.uniform(-2000, 2000), rng.uniform(-1, 1), 0.0, -0.00004])
    return f"{value:.{rng.choice((0, 1, 3, 4, 5, 12))}f}"


def texts(seed: int, n: int) -> tuple[list[str], list[str]]:
    """Make a program and the same with other numbers, and some with other text."""
    rng = random.Random(seed)
    before, after = [], []
    for k in range(n):
        line = rng.choice(LINES[:2] if rng.random() < 0.6 else LINES)
        count = line.count("{}")
        old = [number(rng) for _ in range(count)]
        kept = rng.choice((0.0, 0.3, 1.0))
        new = [text if rng.random() < kept else number(rng) for text in old]
        before.append(line.format(*old, n=k))
        after.append(line.format(*new, n=k))
        if rng.random() < 0.05:
            after[-1] += rng.choice((" ", "x", " -- 5", "'"))
    return before, after


def as_lines(lines: list[str]) -> TextLines:
    return TextLines.of("\n".join(lines).encode("latin-1"))


REASONS = (
    NO_REASON,
    Reason(Code.ARC_UNDETERMINED, "too near"),
    Reason(Code.NO_TARGET, "\x1b[31mé "),
)


def told_of(rng: np.random.Generator, lines: int) -> LineOutcomes:
    """Tell something of most lines."""
    line = np.flatnonzero(rng.random(lines) < 0.8) + 1
    return LineOutcomes(
        line,
        rng.integers(0, len(Status), len(line)),
        rng.integers(0, 3, len(line)),
        REASONS,
        rng.integers(-1, 3, (len(line), 6)),
        np.where(rng.random(len(line)) < 0.1, np.nan, rng.random(len(line))),
        {s.name.lower(): int(s) for s in Status},
        {
            k: {"rejected": 1, "corrected": k}
            for k in rng.integers(0, len(line), 9).tolist()
        },
    )


def with_told(row: DiffRow, told: LineOutcomes) -> DiffRow:
    """Add what is told of a row's line."""
    at = np.flatnonzero(told.line == row.line)
    if not len(at):
        return row
    return row._replace(
        status=Status(told.status[at[0]]).name.lower(),
        code=told.reasons[told.why[at[0]]].name,
        reason=told.reasons[told.why[at[0]]].text,
        direction=tuple(told.direction[at[0]].tolist()),
        correction_mm=float(told.correction_mm[at[0]]),
        visits=dict(told.mixed.get(int(at[0]), {})),
    )


def said(found: Difference) -> tuple[str, str]:
    """Return the listing without its summary, and the JSON."""
    out = io.StringIO()
    print_difference(found, out)
    listing = out.getvalue().rpartition(found.summary())[0]
    return listing, "".join(difference_pieces(found))


def same(rows: list[DiffRow], wanted: list[DiffRow]) -> bool:
    """Compare rows; NaN equals NaN."""
    return list(map(repr, rows)) == list(map(repr, wanted))


@pytest.mark.parametrize("seed", range(6))
def test_rows_are_those_made_line_by_line(seed: int) -> None:
    before, after = texts(seed, 700)
    found = describe_changes("a.pdl", as_lines(before), as_lines(after))
    wanted = rows_of("a.pdl", before, after)
    assert len(wanted) > 300 and {bool(row.text) for row in wanted} == {True, False}
    assert same(list(found), wanted)
    assert same(found[3:9], wanted[3:9])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("told", [False, True])
def test_listing_and_json_are_those_made_row_by_row(seed: int, told: bool) -> None:
    n = (40, 1500, 6500, 12000)[seed]
    before, after = texts(seed, n)
    files = [("a.pdl", before, after), ("a.lsv", after[:50], before[:50])]
    record = told_of(np.random.default_rng(seed), n) if told else None
    parts, wanted = [], []
    for name, old, new in files[: 1 + seed % 2]:
        rows = describe_changes(name, as_lines(old), as_lines(new))
        parts.append(rows.with_record(record))
        own = rows_of(name, old, new)
        wanted += [with_told(row, record) for row in own] if record else own
    counts = dict(record.counts) if record else {}
    listing, text = said(Difference(tuple(parts), True, (), counts))
    assert text == json_of(True, counts, wanted, [])
    out = io.StringIO()
    list_rows(wanted, 0 if seed % 2 else 1, told, out)
    assert listing == out.getvalue()


def test_what_was_left_alone_is_in_the_json_too() -> None:
    told = told_of(np.random.default_rng(3), 90)
    left = DiffRows.bare("a.pdl", told.line[::2], ["MOVE TO"] * len(told.line[::2]))
    found = Difference((), False, (left.with_record(told),), dict(told.counts))
    wanted = [
        with_told(DiffRow("a.pdl", line, "MOVE TO", (), (), None), told)
        for line in told.line[::2].tolist()
    ]
    assert said(found)[1] == json_of(False, dict(told.counts), [], wanted)
    assert not found and found.summary().startswith("the targets are the same")


def test_rows_of_parts_are_those_of_all() -> None:
    before, after = texts(9, 400)
    old, new = as_lines(before), as_lines(after)
    cuts = [0, 1, 7, 200, 200, 400]
    parts = [
        describe_changes("a.pdl", old.part(a, b), new.part(a, b), a)
        for a, b in pairwise(cuts)
    ]
    whole = describe_changes("a.pdl", old, new)
    assert same(list(join_rows("a.pdl", parts)), list(whole))


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_files_that_also_came_and_went(tmp_path, ending: str) -> None:
    before, after = texts(5, 120)
    after[40:40] = ["new := 1", "new := 2"]
    del after[90:95]
    paths = tmp_path / "a.pdl", tmp_path / "b.pdl"
    for path, lines in zip(paths, (before, after), strict=True):
        path.write_bytes(ending.join(lines).encode("latin-1"))
    found = diff(*paths)
    signs = Counter(row.text[:2] for row in found.rows if row.text[:2] in ("+ ", "- "))
    assert signs["+ "] - signs["- "] == len(after) - len(before)
    assert [row for row in found.rows if row.line == 0 and row.text[:2] != "+ "] == []
    numbers = [row for row in found.rows if not row.text]
    assert numbers
    for row in numbers:
        text = before[row.line - 1]
        masked = mask_line(text)
        spans = zip(masked.start, masked.end, strict=True)
        assert row.original == tuple(number_value(text[a:b]) for a, b in spans)
