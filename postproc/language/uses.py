"""What else depends on the numbers of a target than the moves that go to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import Ints
from postproc.language.visits import Literals

_IN_PART = "a target is computed from a part of it"


def find_uses(
    literals: Literals,
    slots: Ints,
    bases: Mapping[int, tuple[int, ...]],
    literal: Ints,
    pinned: Mapping[int, str],
) -> tuple[Literals, Ints]:
    """Find which literals computed targets move along with, and which must stay.

    Args:
        literals: m literals.
        slots: Numbers of every visit's literal, (n, 6), -1 where it has none.
        bases: The six numbers that computed targets are made of, by visit.
        literal: Literal of every visit, (n,), -1 where it has none.
        pinned: Numbers that must stay, and why.

    Returns:
        The literals with what pins them, and for every visit the literal that it moves
        along with, (n,), -1 where there is none.
    """
    direct = np.flatnonzero(literal >= 0)
    numbers = np.full((len(literals), 6), -1, dtype=slots.dtype)
    numbers[literal[direct]] = slots[direct]
    most = max([-1, *pinned, *map(max, bases.values()), numbers.max(initial=-1)])
    owner = np.full(int(most) + 2, -1, dtype=slots.dtype)  # the last is that of slot -1
    owner[numbers] = np.arange(len(literals))[:, None]
    owner[-1] = -1
    stay = {int(owner[slot]): why for slot, why in pinned.items() if owner[slot] >= 0}
    follows = np.full(len(literal), -1, dtype=np.int64)
    for visit, base in bases.items():
        rows = owner[[*base]]
        if rows[0] >= 0 and (numbers[rows[0]] == base).all():
            follows[visit] = rows[0]
        else:
            stay |= {row: _IN_PART for row in rows.tolist() if 0 <= row not in stay}
    if not stay:
        return literals, follows
    why = tuple(stay.get(row, "") for row in range(len(literals)))
    return replace(literals, pinned=why), follows
