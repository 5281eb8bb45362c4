"""Variables keep what a run leaves in them: what the next run begins with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from postproc.language.pdl2.abstract_state import NEVER_SET, GivenValues, wholes
from postproc.language.pdl2.job import World
from postproc.language.pdl2.values import (
    Nothing,
    Value,
    add_unknown,
    join_components,
    may_be,
)

CHANGED = (
    "the program changes it, and the next run begins with what this one leaves: assign "
    "all of it before it is used"
)
RUNS = 4  # that are followed one by one; what they change is then taken for anything


def keep_values(world: World, given: GivenValues, runs: int) -> bool:
    """Let a job begin also with what a run of it may leave; tell if that is new.

    A run may end anywhere, so that a variable may begin with all that it is ever given.
    Only what the program takes before it assigns it is looked at.

    Args:
        world: The job, as it was followed.
        given: What its variables are given at any time.
        runs: How often it was followed.
    """
    found: dict[str, Value] = {}
    for key, value in _list_endings(world, given):
        found[key] = join_components(found.get(key, value), value)
    if runs >= RUNS:
        every = frozenset().union(*map(given.numbers, given))
        found = dict.fromkeys(found, Nothing(CHANGED, every))
    changed = False
    for key, value in found.items():
        numbers = given.numbers(key) | may_be(value)
        before = world.initial.find(key)
        after = _either(before, value, numbers)
        if after is None or after == before:
            continue
        lost = (numbers | may_be(before)) - may_be(after)
        world.pin(Nothing(CHANGED, lost), CHANGED)
        world.initial.change(key, after)
        changed = True
    return changed


def _list_endings(world: World, given: GivenValues) -> Iterator[tuple[str, Value]]:
    """Yield keys that a run takes as it finds them, and what it may leave there."""
    # Variables of routines begin anew with every call.
    kept = {key for key in given if ":" not in key.partition("/")[0]}
    asked = {*world.initial.asked}
    for key in kept:
        value = given.value(key)
        if world.initial.is_asked(key) or not asked.isdisjoint(wholes(key)):
            yield key, value
        if isinstance(value, Nothing):  # it hides its elements and fields
            parts = filter(world.initial.is_asked, world.first_parts(key))
            yield from ((part, value) for part in parts)
    for key in asked:
        for whole in kept.intersection(wholes(key)):
            value = given.value(whole)
            if isinstance(value, Nothing):
                yield key, value


def _either(before: Value | None, left: Value, numbers: frozenset[int]) -> Value | None:
    """Return what a key holds that begins with one value or another, None for none.

    Args:
        before: What the files say.
        left: What a run leaves.
        numbers: Numbers of the positions that it may leave.
    """
    if before is None:
        return replace(NEVER_SET, of=numbers) if numbers else None
    found = join_components(before, left)
    if isinstance(found, Nothing):
        why = found if isinstance(before, Nothing) else Nothing(CHANGED, found.of)
        return add_unknown(why, Nothing("", numbers))
    return found
