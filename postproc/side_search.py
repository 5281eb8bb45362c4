"""The side at which aim and arrival agree, searched joint by joint."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats

LEAST_SHIFT = 1e-3  # change of an aim that tells how the arrival follows it
FOLLOWS = 0.75  # gain above which the arrival runs away with the aim
SECANTS = 4  # rounds of secant steps, before steps of half the way


class SideSearch:
    """Search, joint by joint, for the side at which aim and arrival agree.

    A correction of a joint is as large as its play, so aiming where it was found last
    may swing or creep. Secant steps settle that; where the arrival follows the aim so
    closely that there is nothing to settle on, the joint is taken to its flank, but
    only once. Neighbours in a fly run move each other, so that later steps go half the
    way.
    """

    def __init__(self) -> None:
        """Start without a history."""
        self._aim: Floats | None = None
        self._found: Floats | None = None
        self._rounds = 0
        self._flanked: Bools = np.zeros((1, 1), dtype=bool)

    def next_aim(self, aim: Floats, found: Floats) -> Floats:
        """Give the sides to aim for next, (n, 6).

        Args:
            aim: Sides that the targets are corrected for, (n, 6).
            found: Sides that joints then arrive at, (n, 6).
        """
        step = found - aim
        if self._rounds >= SECANTS:
            step = step / 2
        elif self._aim is not None and self._found is not None:
            step = self._secant(step, aim - self._aim, found - self._found)
        self._aim, self._found = np.array(aim), np.array(found)
        self._rounds += 1
        return np.clip(aim + step, -1.0, 1.0)

    def _secant(self, step: Floats, shift: Floats, answer: Floats) -> Floats:
        """Scale steps by how arrivals answered the last shift of their aims."""
        known = np.abs(shift) > LEAST_SHIFT
        gain = answer / np.where(known, shift, np.inf)
        follows = gain > FOLLOWS
        to_flank = follows & ~self._flanked
        self._flanked = self._flanked | to_flank
        scaled = step / np.where(follows, 2.0, 1.0 - gain)
        return np.where(to_flank, 2.0 * np.sign(step), scaled)
