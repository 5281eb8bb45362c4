"""What was made of a few objects, kept while these are in use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from postproc.robot.arm import Arm

T = TypeVar("T")
KEPT = 8  # arms; a service that loads more of them makes things anew


class ArmCache(Generic[T]):
    """What was made of the last few arms, each told from others by its identity."""

    def __init__(self) -> None:
        """Begin with none."""
        self._made: dict[int, tuple[Arm, T]] = {}

    def of(self, arm: Arm, make: Callable[[Arm], T]) -> T:
        """Return what was made of an arm, or make it."""
        found = self._made.get(id(arm))
        if found is None:
            found = self._made[id(arm)] = arm, make(arm)
            for old in list(self._made)[:-KEPT]:
                self._made.pop(old, None)
        return found[1]
