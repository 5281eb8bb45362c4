"""The play operator: what a joint with backlash remembers of its path.

A play of half width h has a state z that the joint angle drags along: always
q - h <= z <= q + h. Passing one angle q is the clamp z -> min(max(z, q - h), q + h),
and a sequence of clamps is one clamp again, so that a path of any length costs two
numbers (Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989, chapter 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Clamps:
    """Maps z -> min(max(z, lo), hi) with lo <= hi, any equal shapes [rad]."""

    lo: Array
    hi: Array

    def __getitem__(self, rows: int | slice | Ints) -> Clamps:
        """Return some of the maps."""
        return Clamps(self.lo[rows], self.hi[rows])

    def __call__(self, z: Array) -> Array:
        """Apply the maps to states."""
        return np.minimum(np.maximum(z, self.lo), self.hi)

    def then(self, after: Clamps) -> Clamps:
        """Compose: these maps first, then the others."""
        return Clamps(after(self.lo), after(self.hi))


def identity(shape: tuple[int, ...]) -> Clamps:
    """Return maps that change nothing."""
    return Clamps(np.full(shape, -np.inf), np.full(shape, np.inf))


def passing(q: Array, half_width: Array) -> Clamps:
    """Return the clamp of passing each angle (..., 6) [rad]."""
    return Clamps(q - half_width, q + half_width)


def prefix(steps: Clamps) -> Clamps:
    """Compose all steps up to and including each one, (n, k) -> (n, k).

    Blocks of about sqrt(n) steps run side by side, then the blocks are joined: two
    short loops instead of one long one, in linear time.
    """
    n, k = steps.lo.shape
    length = isqrt(max(n - 1, 0)) + 1
    blocks = -(-n // length)
    pad = identity((blocks * length, k))
    pad.lo[:n], pad.hi[:n] = steps.lo, steps.hi
    lo, hi = pad.lo.reshape(blocks, length, k), pad.hi.reshape(blocks, length, k)
    for i in range(1, length):
        _compose(lo[:, i - 1], hi[:, i - 1], lo[:, i], hi[:, i])
    for b in range(1, blocks):
        _compose(lo[b - 1, -1], hi[b - 1, -1], lo[b], hi[b])
    return Clamps(lo.reshape(-1, k)[:n], hi.reshape(-1, k)[:n])


def _compose(lo0: Array, hi0: Array, lo: Array, hi: Array) -> None:
    """Put earlier clamps in front of later ones, in place: `Clamps.then`."""
    low = np.minimum(np.maximum(lo0, lo), hi)
    np.minimum(np.maximum(hi0, lo), hi, out=hi)
    lo[...] = low


def with_turning_values(before: Array, path: Array, inside: Array) -> Array:
    """Put the extreme values between samples into sampled paths.

    The parabola through three consecutive equidistant samples turns somewhere; where
    that lies between them its value is inserted, so that a joint that turns between the
    last two samples is not missed.

    Args:
        before: The sample before each sample, (s, 6) [rad].
        path: The samples, (s, 6) [rad].
        inside: True where the next sample belongs to the same path, (s,).

    Returns:
        (s, 3, 6): what to pass before, at and after each sample; repeated values where
        there is nothing to insert.
    """
    out = np.repeat(path[:, None, :], 3, axis=1)
    at = np.flatnonzero(inside)
    if not len(at):
        return out
    middle, rise = path[at], (path[at + 1] - before[at]) / 2
    bend = (path[at + 1] + before[at]) / 2 - middle
    with np.errstate(divide="ignore", invalid="ignore"):
        where = -rise / (2 * bend)
        value = middle - rise**2 / (4 * bend)
    out[at, 0] = np.where((where > -1) & (where < 0), value, middle)
    out[at, 2] = np.where((where > 0) & (where < 1), value, middle)
    return out
