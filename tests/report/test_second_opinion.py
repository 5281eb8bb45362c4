"""The verdict says of how much it is one."""

from __future__ import annotations

from postproc.report.second_opinion import verdict_of
from postproc.verify.opinion import Opinion, OpinionRow


def row(what: str, compared: int, skipped: int, beyond: int = 0) -> OpinionRow:
    lost = {"fly points": skipped} if skipped else {}
    return OpinionRow(what, "lambda", compared, beyond, 0.0, 0.0, "", lost)


def test_it_counts_the_directions() -> None:
    rows = row("output: place", 9, 0), row("output: approach directions", 1200, 34)
    told = verdict_of(Opinion("job", rows, 0.5))
    assert told == (
        "second opinion: agrees, 1,200 of 1,234 approach directions compared (0.5 s)"
    )


def test_it_does_not_agree_where_nothing_was_compared() -> None:
    rows = row("output: place", 0, 0), row("output: approach directions", 0, 12)
    told = verdict_of(Opinion("job", rows, 0.0))
    assert told == "second opinion: nothing was compared (0.0 s)"


def test_an_arm_file_has_no_directions() -> None:
    told = verdict_of(Opinion("arm", (row("flange: place", 1000, 0),), 0.1))
    assert told == "second opinion: agrees (0.1 s)"
