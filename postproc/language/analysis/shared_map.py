"""A mapping that is cheap to copy and to compare: what copies share stays shared."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
T = TypeVar("T")
_COUNT = 64


class SharedMap(Generic[K, T]):
    """Values by key on 64 shelves; a copy shares a shelf until one side writes to it.

    An analysis keeps one copy for every place of a program, and merges copies that
    differ in a few keys of thousands: both cost what differs, not what is held.
    """

    __slots__ = ("_mine", "_shelves")

    def __init__(self) -> None:
        self._shelves: list[dict[K, T]] = [{}] * _COUNT
        self._mine: set[int] | None = set()  # None: not even the row of shelves is

    def copy(self) -> SharedMap[K, T]:
        """Return a mapping that can change on its own."""
        other: SharedMap[K, T] = SharedMap.__new__(SharedMap)
        other._shelves = self._shelves
        other._mine = self._mine = None
        return other

    def __eq__(self, other: object) -> bool:
        """Tell whether all keys hold the same."""
        return isinstance(other, SharedMap) and all(
            self.get(key) == other.get(key) for key in self.differing(other)
        )

    __hash__ = None  # type: ignore[assignment]

    def get(self, key: K) -> T | None:
        """Return what a key holds, None where it holds nothing."""
        return self._shelves[hash(key) % _COUNT].get(key)

    def __setitem__(self, key: K, value: T) -> None:
        """Let a key hold a value."""
        self._own(hash(key) % _COUNT)[key] = value

    def __delitem__(self, key: K) -> None:
        """Let a key hold nothing."""
        self._own(hash(key) % _COUNT).pop(key, None)

    def _own(self, at: int) -> dict[K, T]:
        if self._mine is None:
            self._shelves, self._mine = self._shelves.copy(), set()
        if at not in self._mine:
            self._shelves[at] = self._shelves[at].copy()
            self._mine.add(at)
        return self._shelves[at]

    def __iter__(self) -> Iterator[K]:
        """Iterate over the keys."""
        for shelf in self._shelves:
            yield from shelf

    def differing(self, other: SharedMap[K, T]) -> list[K]:
        """Return the keys that may hold other values in another mapping."""
        found: list[K] = []
        for mine, theirs in zip(self._shelves, other._shelves, strict=True):
            if mine is not theirs:
                found += [k for k, v in mine.items() if theirs.get(k) is not v]
                found += [k for k in theirs if k not in mine]
        return found
