"""Results for the last few arms, computed once for each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from postproc.robot.arm import Arm

T = TypeVar("T")
KEPT = 8  # arms; for more of them results are computed again


class ArmCache(Generic[T]):
    """Results for the last few arms; an arm is recognised by its identity."""

    def __init__(self) -> None:
        """Begin with none."""
        self._made: dict[int, tuple[Arm, T]] = {}

    def of(self, arm: Arm, make: Callable[[Arm], T]) -> T:
        """Return the result for an arm; compute it the first time."""
        found = self._made.get(id(arm))
        if found is None:
            found = self._made[id(arm)] = arm, make(arm)
            for old in list(self._made)[:-KEPT]:
                self._made.pop(old, None)
        return found[1]
