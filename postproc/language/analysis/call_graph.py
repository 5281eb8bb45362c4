"""Which routines run because one of them runs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


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
