"""Which routines run because one runs, by the definition of both."""

from __future__ import annotations

import random

from postproc.language.analysis.call_graph import lead_to_recursion, reach


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


def test_those_that_call_themselves_and_those_that_come_to_one() -> None:
    for seed in range(50):
        calls = drawn(seed)
        after = closure(calls)
        circle = {one for one, to in after.items() if one in to}
        before = {one for one, to in after.items() if to & circle}
        assert lead_to_recursion(calls) == before
