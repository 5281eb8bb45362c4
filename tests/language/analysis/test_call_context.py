"""Places of programs in the order in which a program comes to them."""

from __future__ import annotations

import random

from postproc.language.analysis.call_context import (
    CALLED,
    HERE,
    Context,
    Point,
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


def path(context: Context, at: int) -> list[tuple[int, int]]:
    """List the calls and rounds around a place from the outermost one on, then it."""
    around = [(one.at, one.kind) for one in context.around()]
    return [*around[-2::-1], (at, HERE)]


def test_points_are_in_the_order_in_which_a_program_comes_to_them() -> None:
    for seed in range(30):
        places = [(context, at) for context, at, _ in drawn(seed)]
        found = sorted(places, key=lambda place: Point(*place))
        assert [path(*one) for one in found] == sorted(path(*one) for one in places)


def test_a_context_is_one_object_at_any_depth() -> None:
    root = Context()
    deep = root
    for at in range(1000):
        deep = deep.within(at, CALLED, at)
    assert deep.up_to(500).at == 499 and deep.outer.within(999, CALLED, None) is deep
    assert sum(1 for _ in deep.around()) == 1001
