"""Windows of a program must have found the same at their cuts, round by round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.compensation.consensus import (
    SAME,
    Glimpses,
    RoundLog,
    Snapshot,
    same_looks,
)
from postproc.diagnostics import NO_REASON, Code, Reason

FAR = Reason(Code.OUT_OF_REACH, "far")


def test_windows_keep_what_is_looked_at_at_their_ends() -> None:
    log = RoundLog(slice(1, 3), slice(4, 6))
    log.see((0, False), glimpse(8))
    assert log.begin[0, False].aim[0, 0] == 6.0 and len(log.end[0, False].aim) == 2
    whole = RoundLog()
    whole.see((0, False), glimpse(8))
    assert not whole.begin and not whole.end


def glimpse(n: int, off: float = 0.0) -> Snapshot:
    """Make a glimpse at n visits."""
    rows, one = np.arange(6.0 * n).reshape(n, 6) + off, np.arange(n)
    flags = np.zeros((n, 3), dtype=bool)
    return Snapshot(
        values=rows, status=one, why=one % 2, reasons=(NO_REASON, FAR), aim=rows,
        correction=rows[:, :3], bent=rows[:, :3], left=flags, q=rows * np.nan,
        passed=rows, aside=rows[:, :3], slot=one, side=rows, lo=rows, hi=rows,
    )  # fmt: skip


def test_looks_agree_as_far_as_they_are_seen() -> None:
    seen = Glimpses({(0, False): glimpse(4)})
    assert same_looks(seen, Glimpses({(0, False): glimpse(4)}))
    assert same_looks(seen, Glimpses({(0, False): glimpse(4, SAME / 2)}))
    assert not same_looks(seen, Glimpses({(0, False): glimpse(4, 2 * SAME)}))
    other = replace(glimpse(4), reasons=("", "near"))
    assert not same_looks(seen, Glimpses({(0, False): other}))
    assert same_looks(seen[1:3], Glimpses({(0, False): other[2:3]})) is False


def test_who_has_come_to_rest_is_seen_as_then() -> None:
    looks = {(0, False): glimpse(2), (1, False): glimpse(2, 1.0)}
    seen = Glimpses({**looks, (1, True): glimpse(2, 2.0)})
    assert seen.at((5, False)) is looks[1, False]
    assert seen.at((5, True)).values[0, 0] == 2.0
    assert not same_looks(seen, Glimpses(looks))


def test_written_numbers_stand_for_those_of_another_round() -> None:
    looks = {(0, False): glimpse(2), (1, False): glimpse(2, 1.0)}
    early = Glimpses({(0, False): glimpse(2), (0, True): glimpse(2, 2.0)})
    late = Glimpses({**looks, (1, True): glimpse(2, 2.0)})
    assert late.at((0, True)).values[0, 0] == 2.0
    assert not same_looks(early, late)  # what was aimed for differs
    rested = Glimpses({**looks, (1, False): glimpse(2), (1, True): glimpse(2, 2.0)})
    assert same_looks(early, rested) and same_looks(rested, early)
