"""Which routines run because one runs, by the definition of both."""

from __future__ import annotations

import random

from postproc.language.analysis.call_graph import reach


def drawn(seed: int) -> dict[int, set[int]]:
    rng = random.Random(seed)
    return {
        one: {rng.randrange(8) for _ in range(rng.randrange(3))} for one in range(8)
    }


def closure(calls: dict[int, set[int]]) -> dict[int, set[int]]:
    """Follow calls again and again until nothing is added."""
    found = {one: set(to) for one, to in calls.items()}
    for _ in calls:
        found = {k: to.union(*(found[one] for one in to)) for k, to in found.items()}
    return found


def test_each_routine_is_reached_once() -> None:
    for seed in range(50):
        calls = drawn(seed)
        found = [*reach([0], calls.__getitem__, int)]
        assert len(found) == len({*found})
        assert {*found} == {0} | closure(calls)[0]
