"""Which moves can go on sharing a point, and which need one of their own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import Floats

Box = Mapping[int, tuple[Floats, Floats]]


@dataclass(frozen=True)
class Stop:
    """One place in a move statement that names where to go.

    Attributes:
        file, line: Where the statement stands.
        via: It is the VIA point of an arc.
    """

    file: int
    line: int
    via: bool


@dataclass(frozen=True)
class Arrivals:
    """All arrivals at one stop.

    Attributes:
        stop: Where.
        variable: What it can be separated from by another name, "" for nothing.
        changes: The changes that the arrivals need, one row each [mm], by literal.
        usable: Every arrival can be corrected.
    """

    stop: Stop
    variable: str
    changes: Mapping[int, Floats]
    usable: bool

    def box(self) -> Box:
        """Return the bounds of the changes at every literal."""
        return {k: (c.min(axis=0), c.max(axis=0)) for k, c in self.changes.items()}

    def agree(self, agree_mm: float) -> bool:
        """Tell whether the arrivals at this one stop agree."""
        return _size(self.box()) <= agree_mm


@dataclass
class Group:
    """Stops that can share one point.

    Attributes:
        variable: Its name, "" where stops of several variables share the literal.
        stops: The stops.
        bounds: Bounds of the changes at every literal.
    """

    variable: str
    stops: list[Stop] = field(default_factory=list)
    bounds: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)

    def take(self, arrivals: Arrivals, agree_mm: float) -> bool:
        """Take in a stop that agrees with those at hand; tell whether it does."""
        box = _union(self.bounds, arrivals.box())
        if _size(box) > agree_mm:
            return False
        self.bounds = box
        self.stops.append(arrivals.stop)
        return True


def regroup(
    members: Sequence[Arrivals], stays: bool, agree_mm: float
) -> tuple[Group, ...]:
    """Divide the stops that share literals into groups whose arrivals agree.

    The first group keeps the original: it holds what cannot be separated from it, and
    where something needs the original as it is, nobody else.

    Args:
        members: All stops at some literals, in program order.
        stays: The literals must keep their values.
        agree_mm: Largest distance of changes that agree.

    Returns:
        The group that keeps the original, then those that need a point of their own.
    """
    original = Group("")
    free: list[Arrivals] = []
    for member in members:
        if member.variable and member.usable and member.agree(agree_mm):
            free.append(member)
        elif not (member.usable and original.take(member, agree_mm)):
            stays = True
            original.stops.append(member.stop)
    groups: list[Group] = []
    for member in free:
        mine = [g for g in groups if g.variable == member.variable]
        choices = mine if stays else [original, *mine]
        if not any(group.take(member, agree_mm) for group in choices):
            group = Group(member.variable)
            group.take(member, agree_mm)
            groups.append(group)
    return (original, *groups)


def _union(a: Box, b: Box) -> dict[int, tuple[Floats, Floats]]:
    box = dict(a)
    for key, (low, high) in b.items():
        if key in box:
            low, high = np.minimum(low, box[key][0]), np.maximum(high, box[key][1])
        box[key] = (low, high)
    return box


def _size(box: Box) -> float:
    return max(
        (float(np.linalg.norm(high - low)) for low, high in box.values()), default=0.0
    )


def connected(sets: Iterable[frozenset[int]]) -> list[frozenset[int]]:
    """Unite the sets that overlap, in order of their smallest members.

    >>> [sorted(s) for s in connected([frozenset({1, 2}), frozenset({3}),
    ...                                frozenset({2, 5})])]
    [[1, 2, 5], [3]]
    """
    owner: dict[int, frozenset[int]] = {}
    for one in sets:
        whole = one.union(*(owner[k] for k in one if k in owner))
        owner |= dict.fromkeys(whole, whole)
    return sorted({*owner.values()}, key=min)
