"""Long listings: aligned, streamed, coloured on a terminal only."""

from __future__ import annotations

import io
from itertools import islice

import pytest

from postproc.report.terminal import (
    MEASURED,
    Column,
    arrows,
    print_table,
    status_colour,
)

COLUMNS = (Column("n"), Column("name", "left"), Column("status", "left"))
COLOURS = {"status": status_colour}


class Screen(io.StringIO):
    def isatty(self):
        return True


def printed(rows, out=None):
    out = out or io.StringIO()
    print_table(COLUMNS, rows, COLOURS, out)
    return out.getvalue().splitlines()


def test_columns_are_aligned_and_nothing_trails():
    lines = printed([["1", "a", "corrected"], ["100", "bbb", "rejected: near"]])
    assert lines == [
        "  n  name  status",
        "  1  a     corrected",
        "100  bbb   rejected: near",
    ]


def test_rows_are_printed_as_they_come():
    class Sink(io.StringIO):
        def write(self, text):
            if text.count("\n") > 1:
                raise BrokenPipeError
            return super().write(text)

    taken = iter([str(i), "", ""] for i in range(10**9))
    with pytest.raises(BrokenPipeError):
        print_table(COLUMNS, taken, COLOURS, Sink())
    assert int(next(taken)[0]) <= 2 * MEASURED


def test_a_late_wide_cell_widens_its_column_from_there_on():
    rows = [["1", "a", "x"]] * (MEASURED + 1) + [["1", "a" * 9, "x"], ["1", "a", "x"]]
    *_, before, wide, after = printed(rows)
    assert before.index("x") < wide.index("x") == after.index("x")


def test_colours_only_on_a_terminal_that_wants_them(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    rows = [["1", "a", "rejected: near"], ["2", "b", "corrected"]]
    head, guarded, safe = printed(rows, Screen())
    assert "\x1b[1m" in head and "\x1b[33mrejected: near\x1b[0m" in guarded
    assert "\x1b" not in safe
    assert "\x1b" not in "".join(printed(rows))
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in "".join(printed(rows, Screen()))


def test_cells_cannot_steer_the_terminal():
    assert "\\x1b[2J" in printed([["1", "\x1b[2J", "corrected"]], Screen())[1]


def test_arrows():
    assert arrows([1, -1, 0, 2]) == "↑↓·↕"


def test_nothing_is_listed_of_nothing():
    assert printed(islice([], 0)) == ["n  name  status"]
