"""Findings as lines of text."""

from __future__ import annotations

from postproc.diagnostics import Code
from postproc.language.visits import Diagnostic
from postproc.report.findings import list_findings

LINES = (3, 5, 6, 7, 9)
SAME = [Diagnostic("a.pdl", line, Code.FLY_CORNER, "rounded") for line in LINES]
OTHER = Diagnostic("a.pdl", 4, Code.FLY_CORNER, "rounded more")


def test_what_says_the_same_is_one_line_with_its_first_places():
    assert list_findings([SAME[0], OTHER, *SAME[1:]]) == [
        "a.pdl:3: fly-corner: rounded (also 4 lines: 5-7, ..)",
        "a.pdl:4: fly-corner: rounded more",
    ]


def test_every_one_is_listed_where_asked_for():
    assert list_findings(SAME, every=True) == [str(one) for one in SAME]


def test_two_places_name_both():
    assert list_findings(SAME[:2]) == ["a.pdl:3: fly-corner: rounded (also line 5)"]
    assert list_findings(SAME[:1]) == ["a.pdl:3: fly-corner: rounded"]
