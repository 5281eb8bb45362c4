"""Which routines run because one of them runs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
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


def find_recursive(calls: Mapping[K, set[K]]) -> frozenset[K]:
    """Return the routines that may call themselves, and those between such.

    Routines that call none that is left are taken out, then those that none calls.

    >>> sorted(find_recursive({1: {2}, 2: {1, 3}, 3: set(), 4: {1}}))
    [1, 2]
    """
    callers = _reverse_edges(_without_sinks(calls))
    return frozenset(_without_sinks(callers))


def _without_sinks(edges: Mapping[K, set[K]]) -> dict[K, set[K]]:
    """Take out, again and again, what leads to nothing that is left."""
    back, count = _reverse_edges(edges), {one: len(to) for one, to in edges.items()}
    waiting = [one for one, left in count.items() if not left]
    gone: set[K] = set()
    while waiting:
        sink = waiting.pop()
        gone.add(sink)
        for one in back[sink]:
            count[one] -= 1
            if not count[one]:
                waiting.append(one)
    return {one: to - gone for one, to in edges.items() if one not in gone}


def _reverse_edges(edges: Mapping[K, set[K]]) -> dict[K, set[K]]:
    """Turn the edges of a graph round."""
    back: dict[K, set[K]] = {one: set() for one in edges}
    for one, to in edges.items():
        for other in to:
            back[other].add(one)
    return back
