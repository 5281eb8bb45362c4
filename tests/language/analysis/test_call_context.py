"""Places of programs in the order in which a program comes to them."""

from __future__ import annotations

import random

from postproc.language.analysis.call_context import (
    CALLED,
    Context,
    Point,
    in_program_order,
)


def drawn(seed: int) -> list[tuple[Context, int, int]]:
    """Draw rows in calls and in rounds of loops, at any depth."""
    rng, root = random.Random(seed), Context()
    contexts = [root]
    for _ in range(30):
        kind = rng.choice([CALLED, 0, 1, 2])
        contexts.append(rng.choice(contexts).within(rng.randrange(9), kind, None))
    places = {(rng.choice(contexts), rng.randrange(9)) for _ in range(60)}
    found = [(context, at, k) for context, at in places for k in range(2)]
    rng.shuffle(found)
    return found


def test_places_are_sorted_as_points_are() -> None:
    """Points compare two places; the order of all of them is found in one pass."""
    for seed in range(30):
        keys = drawn(seed)
        wanted = sorted(
            range(len(keys)), key=lambda k: (Point(*keys[k][:2]), keys[k][2])
        )
        assert in_program_order(keys) == wanted


def test_nothing_has_an_order_too() -> None:
    assert in_program_order([]) == []


def test_a_context_is_one_object_at_any_depth() -> None:
    root = Context()
    deep = root
    for at in range(1000):
        deep = deep.within(at, CALLED, at)
    assert deep.up_to(500).at == 499 and deep.outer.within(999, CALLED, None) is deep
    assert sum(1 for _ in deep.around()) == 1001
