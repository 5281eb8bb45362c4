"""Windows of a program must have found the same at their cuts, round by round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.compensation.scale.consensus import (
    SAME,
    Glimpses,
    RoundLog,
    Snapshot,
    same_looks,
)
from postproc.diagnostics import NO_REASON, Code, Reason

FAR = Reason(Code.OUT_OF_REACH, "far")


def glimpse(n: int, off: float = 0.0) -> Snapshot:
    """Make a glimpse at n visits."""
    rows, one = np.arange(6.0 * n).reshape(n, 6) + off, np.arange(n)
    flags = np.zeros((n, 3), dtype=bool)
    return Snapshot(
        values=rows, status=one, why=one % 2, reasons=(NO_REASON, FAR), aim=rows,
        correction=rows[:, :3], foretold=rows[:, :3], left=flags, q=rows * np.nan,
        passed=rows, aside=rows[:, :3], slot=one, side=rows, lo=rows, hi=rows,
    )  # fmt: skip


def seen(*looks: Snapshot, written: Snapshot | None = None) -> Glimpses:
    """Put looks together."""
    return Glimpses(looks, written)


def test_windows_keep_what_is_looked_at_at_their_ends() -> None:
    log = RoundLog(slice(1, 3), slice(4, 6))
    for turn in (0, 1, None, None):
        log.see(turn, glimpse(8, 5.0 if turn is None else turn))
    assert [len(kept.rounds) for kept in (log.begin, log.end)] == [2, 2]
    assert log.begin.rounds[0].aim[0, 0] == 6.0 and len(log.end.rounds[1].aim) == 2
    assert log.end.at(None).aim[0, 0] == 24.0 + 5.0


def test_nothing_is_known_where_nothing_was_looked_at() -> None:
    assert len(Glimpses().sides_at(3)) == len(Glimpses().sides_at(None)) == 0
    assert len(seen(glimpse(4)).sides_at(3)) == 4


def test_looks_agree_as_far_as_they_are_seen() -> None:
    one = seen(glimpse(4))
    assert same_looks(one, seen(glimpse(4)))
    assert same_looks(one, seen(glimpse(4, SAME / 2)))
    assert not same_looks(one, seen(glimpse(4, 2 * SAME)))
    other = replace(glimpse(4), reasons=("", "near"))
    assert not same_looks(one, seen(other))
    assert same_looks(one[1:3], seen(other[2:3])) is False


def test_who_has_come_to_rest_is_seen_as_then() -> None:
    looks, last = (glimpse(2), glimpse(2, 1.0)), glimpse(2, 2.0)
    longer = seen(*looks, written=last)
    assert longer.at(5) is looks[1] and longer.at(None) is last
    assert same_looks(longer, seen(*looks, looks[1], written=last))
    assert not same_looks(longer, seen(*looks, glimpse(2), written=last))


def test_what_is_written_must_agree_too() -> None:
    written = (seen(glimpse(2), written=glimpse(2, off)) for off in (2.0, 3.0))
    assert not same_looks(*written)
