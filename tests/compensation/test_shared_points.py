"""Which moves can share a point: by definition, on drawn arrivals."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.output.clones import (
    MoveSlot,
    SlotArrivals,
    group_arrivals,
    unite_overlapping,
)

LIMIT = 0.5


def drawn(rng: np.random.Generator) -> list[SlotArrivals]:
    """Draw stops of two variables at two literals, some fixed, some unusable."""
    members = []
    for line in range(int(rng.integers(1, 9))):
        literals = rng.choice(2, rng.integers(1, 3), replace=False).tolist()
        middle = rng.integers(0, 3, 3).astype(float)
        changes = {
            k: middle + rng.uniform(-0.1, 0.1, (int(rng.integers(1, 4)), 3))
            for k in literals
        }
        if rng.random() < 0.1:
            changes[literals[0]] = rng.uniform(-3, 3, (3, 3))
        variable = str(rng.choice(["", "p", "q"], p=[0.2, 0.5, 0.3]))
        members.append(
            SlotArrivals(
                MoveSlot(0, line, False), variable, changes, rng.random() < 0.9
            )
        )
    return members


@pytest.mark.parametrize("seed", range(60))
def test_groups_hold_every_stop_once_and_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    members, stays = drawn(rng), bool(rng.random() < 0.2)
    by_stop = {m.stop: m for m in members}
    original, *groups = group_arrivals(members, stays, LIMIT)
    found = [stop for group in (original, *groups) for stop in group.stops]
    assert sorted(found, key=lambda s: s.line) == [m.stop for m in members]
    for group in groups:
        mine = [by_stop[stop] for stop in group.stops]
        assert {m.variable for m in mine} == {group.variable} and group.variable
        assert all(m.usable for m in mine)
        for literal in group.bounds:
            rows = [m.changes[literal] for m in mine if literal in m.changes]
            box = np.ptp(np.concatenate(rows), axis=0)
            assert np.linalg.norm(box) <= LIMIT
    kept = [by_stop[stop] for stop in original.stops]
    apart = {
        literal
        for literal in (0, 1)
        if (rows := [m.changes[literal] for m in kept if literal in m.changes])
        and np.linalg.norm(np.ptp(np.concatenate(rows), axis=0)) > LIMIT
    }
    if stays or apart or not all(m.usable for m in kept):
        fixed = [m for m in kept if m.variable and m.usable and m.agree(LIMIT)]
        assert fixed == []  # whoever can go has a point of its own


def test_all_that_agree_share() -> None:
    change = {0: np.zeros((1, 3))}
    members = [SlotArrivals(MoveSlot(0, k, False), "p", change, True) for k in range(5)]
    (only,) = group_arrivals(members, False, LIMIT)
    assert len(only.stops) == 5
    original, one = group_arrivals(members, True, LIMIT)
    assert original.stops == [] and len(one.stops) == 5


def test_overlapping_sets_are_united() -> None:
    rng = np.random.default_rng(0)
    sets = [frozenset(rng.integers(0, 60, 2).tolist()) for _ in range(40)]
    found = unite_overlapping(sets)
    assert frozenset().union(*found) == frozenset().union(*sets)
    assert all(a is b or a.isdisjoint(b) for a in found for b in found)
    assert all(any(s <= whole for whole in found) for s in sets)
