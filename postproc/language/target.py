"""Where a reference leads."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """Where a reference leads: a key and the component of the value there.

    Attributes:
        keys: Keys it may mean.
        exact: It means the one key, not some element of it.
        component: Component of a position: x .. r, pos, ``aux`` and joint indices as
            (``aux``, i) and (``joint``, i); () for the whole value, None if unknown.
    """

    keys: frozenset[str]
    exact: bool
    component: tuple[str, int] | tuple[()] | None = ()

    @property
    def key(self) -> str:
        """Return the one key."""
        return next(iter(self.keys))
