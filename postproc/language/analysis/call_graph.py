"""Which routines run because one of them runs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import suppress
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)


def reach(
    first: Iterable[T], calls: Callable[[T], Iterable[T]], key: Callable[[T], Hashable]
) -> Iterator[T]:
    """Yield routines, and all that they may come to call, each once.

    What a routine calls is asked when the next one is wanted.

    Args:
        first: Where to begin.
        calls: What a routine calls itself.
        key: Tells routines apart.

    >>> calls = {"a": "bc", "b": "a", "c": ""}
    >>> [*reach("a", calls.__getitem__, str)]
    ['a', 'c', 'b']
    """
    waiting, seen = [*first], set[Hashable]()
    while waiting:
        one = waiting.pop()
        if key(one) not in seen:
            seen.add(key(one))
            yield one
            waiting += calls(one)


def lead_to_recursion(calls: Mapping[K, set[K]]) -> frozenset[K]:
    """Return the routines that call themselves, or come to one that does.

    Routines that call none that is left are taken out, again and again.

    >>> sorted(lead_to_recursion({1: {2}, 2: {1, 3}, 3: set(), 4: {1}}))
    [1, 2, 4]
    """
    order, left = TopologicalSorter(calls), set(calls)
    with suppress(CycleError):
        order.prepare()
    while ready := order.get_ready():
        left.difference_update(ready)
        order.done(*ready)
    return frozenset(left)
