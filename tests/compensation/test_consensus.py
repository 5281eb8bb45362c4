"""Windows take the rounds of a program, and say where they did otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.consensus import (
    SAME,
    Glimpses,
    RoundLog,
    RoundVote,
    Snapshot,
    Step,
    common,
    fits,
    same_looks,
)
from postproc.diagnostics import NO_REASON, Code, Reason

FAR = Reason(Code.OUT_OF_REACH, "far")

READ_BACK, AIM, BEND = Step.READ_BACK, Step.AIM, Step.BEND


def trail(*steps: Step, moved: bool = False, missed: bool = False) -> RoundLog:
    """Make the trail of a window whose last round was as told."""
    taken = [RoundVote(s, s, s > READ_BACK, s == BEND) for s in steps[:-1]]
    return RoundLog(taken=[*taken, RoundVote(steps[-1], steps[-1], moved, missed)])


def test_all_do_what_any_of_them_needs() -> None:
    trails = trail(AIM, READ_BACK), trail(BEND, AIM, AIM, READ_BACK), trail(READ_BACK)
    assert common(trails) == (BEND, AIM, AIM, READ_BACK)


@pytest.mark.parametrize(
    ("own", "steps", "same"),
    [
        (trail(AIM, READ_BACK), (AIM, READ_BACK), True),
        (trail(AIM, READ_BACK), (AIM, AIM, READ_BACK), True),  # it is at rest
        (trail(AIM, READ_BACK, moved=True), (AIM, AIM, READ_BACK), False),
        (trail(AIM, READ_BACK, missed=True), (AIM, AIM, READ_BACK), True),
        (trail(AIM, READ_BACK, missed=True), (AIM, BEND, READ_BACK), False),
        (trail(AIM, READ_BACK), (BEND, READ_BACK), True),  # nothing to bend by
        (trail(BEND, READ_BACK), (AIM, READ_BACK), False),
        (trail(READ_BACK, READ_BACK), (AIM, READ_BACK), False),
        (trail(READ_BACK, missed=True), (READ_BACK, READ_BACK), True),
    ],
)
def test_a_window_fits_where_other_rounds_would_change_nothing(own, steps, same):
    assert fits(own, steps) == same


def test_only_own_targets_vote_but_those_at_the_cuts_are_told_too() -> None:
    ends = slice(1, 4), slice(3, 5)
    watched = RoundLog(slice(2, 4), *ends, pace=(AIM,))
    missed, far = np.zeros((6, 3)), np.zeros(6, dtype=bool)
    moved = np.array([True, False, False, False, True, False])
    assert watched.take(moved, missed, far) == AIM  # the pace
    assert watched.taken[-1] == RoundVote(AIM, READ_BACK, True, False)
    assert watched.take(moved, missed, far) == READ_BACK
    missed[1] = far[3] = 1.0
    assert watched.take(moved, missed, far) == BEND
    assert watched.taken[-1] == RoundVote(BEND, BEND, True, True)
    out_of_sight = RoundLog(slice(2, 4), *ends)
    out_of_sight.take(np.arange(6) == 5, np.eye(6, 3), far & False)
    assert out_of_sight.taken == [RoundVote(READ_BACK, READ_BACK, False, True)]
    out_of_sight.take(np.arange(6) == 0, np.eye(6, 3)[::-1] * 0.0, far & False)
    assert out_of_sight.taken[1:] == [RoundVote(READ_BACK, READ_BACK, False, False)]


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
