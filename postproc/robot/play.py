"""The play operator: what a joint with backlash remembers of its path.

A play of half width h has a state z that the joint angle drags along: always
q - h <= z <= q + h. Passing one angle q is the clamp z -> min(max(z, q - h), q + h),
and a sequence of clamps is one clamp again, so that a path of any length costs two
numbers (Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989, chapter 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Ints
from postproc.kernels import native

T = TypeVar("T", np.float64, np.bool_)

SIX = 6  # joints: what the native kernel is made for
BLOCK = 64  # steps that are composed one after the other


@dataclass(frozen=True)
class Clamps:
    """Maps z -> min(max(z, lo), hi) with lo <= hi, any equal shapes [rad]."""

    lo: Floats
    hi: Floats

    def __getitem__(self, rows: int | slice | Ints) -> Clamps:
        """Return some of the maps."""
        return Clamps(self.lo[rows], self.hi[rows])

    def __call__(self, z: Floats) -> Floats:
        """Apply the maps to states."""
        return np.minimum(np.maximum(z, self.lo), self.hi)

    def then(self, after: Clamps) -> Clamps:
        """Compose: these maps first, then the others."""
        return Clamps(after(self.lo), after(self.hi))


def identity(shape: tuple[int, ...]) -> Clamps:
    """Return maps that change nothing."""
    return Clamps(np.full(shape, -np.inf), np.full(shape, np.inf))


def passing(q: Floats, half_width: Floats) -> Clamps:
    """Return the clamp of passing each angle (..., 6) [rad]."""
    return Clamps(q - half_width, q + half_width)


def prefix(steps: Clamps, begins: Bools | None = None) -> Clamps:
    """Compose all steps since the last beginning up to each one, (n, k) -> (n, k).

    Blocks of steps run side by side, then what leads to each block is put in front of
    it: a short loop over long rows instead of a long loop over short ones.

    Args:
        steps: The steps of several sequences, one after the other.
        begins: With which steps a sequence begins, (n,), beside the first one.
    """
    n, k = steps.lo.shape
    begins = np.zeros(n, dtype=bool) if begins is None else begins
    if native is not None and k == SIX:
        return Clamps(*native.prefix(steps, begins))
    length = min(isqrt(max(n - 1, 0)) + 1, BLOCK)
    blocks = -(-n // length)
    lo = _side_by_side(steps.lo, length, -np.inf)
    hi = _side_by_side(steps.hi, length, np.inf)
    new = _side_by_side(begins[:, None], length, False)
    parted: list[bool] = np.any(new, axis=(1, 2)).tolist()
    for i in range(1, length):
        _compose(lo[i - 1], hi[i - 1], lo[i], hi[i], new[i] if parted[i] else None)
    if blocks > 1:
        ends = Clamps(lo[-1, :-1], hi[-1, :-1])
        before = prefix(ends, np.asarray(new[:, :-1, 0].any(axis=0)))
        since: Bools = np.logical_or.accumulate(new[:, 1:], axis=0)
        _compose(
            before.lo, before.hi, lo[:, 1:], hi[:, 1:], since if since.any() else None
        )
    rows = (blocks * length, k)
    return Clamps(
        lo.swapaxes(0, 1).reshape(rows)[:n], hi.swapaxes(0, 1).reshape(rows)[:n]
    )


def _side_by_side(rows: NDArray[T], length: int, rest: float) -> NDArray[T]:
    """Cut rows (n, k) into blocks: (length, blocks, k), step by step."""
    n, k = rows.shape
    blocks = -(-n // length)
    out = np.empty((length, blocks, k), dtype=rows.dtype)
    whole = n // length
    out[:, :whole] = rows[: whole * length].reshape(whole, length, k).swapaxes(0, 1)
    if whole < blocks:
        out[:, whole] = rest
        out[: n - whole * length, whole] = rows[whole * length :]
    return out


def _compose(
    lo0: Floats, hi0: Floats, lo: Floats, hi: Floats, new: Bools | None
) -> None:
    """Put earlier clamps in front of later ones, in place: `Clamps.then`.

    Those that are `new` have nothing in front of them; None: no one is.
    """
    if new is not None:
        lo0, hi0 = np.where(new, -np.inf, lo0), np.where(new, np.inf, hi0)
    low = np.minimum(np.maximum(lo0, lo), hi)
    np.minimum(np.maximum(hi0, lo), hi, out=hi)
    lo[...] = low


def with_turning_values(
    before: Floats, path: Floats, inside: NDArray[np.bool_]
) -> tuple[Floats, Ints]:
    """Put the extreme values between samples into sampled paths.

    The parabola through three consecutive equidistant samples turns somewhere; where
    that lies between them its value is inserted, so that a joint that turns between the
    last two samples is not missed. The others pass their value at the sample again.

    Args:
        before: The sample before each sample, (s, 6) [rad].
        path: The samples, (s, 6) [rad].
        inside: True where the next sample belongs to the same path, (s,).

    Returns:
        What to pass, (t, 6) [rad], and how many rows stand for each sample, (s,).
    """
    row = np.flatnonzero(inside)
    behind, middle = before.take(row, axis=0), path.take(row, axis=0)
    ahead = path.take(row + 1, axis=0)
    # It turns at -rise / (2 bend) of the way to a neighbour.
    rise, bend = (ahead - behind) / 2, (ahead + behind) / 2 - middle
    turns = (np.abs(rise) < 2 * np.abs(bend)) & (rise != 0)
    some = np.unique(np.flatnonzero(turns) // turns.shape[1])
    row, middle = row[some], middle[some]
    rise, bend, turns = rise[some], bend[some], turns[some]
    value = middle - rise**2 / (4 * np.where(turns, bend, 1.0))
    later = (rise > 0) != (bend > 0)
    early, late = turns & ~later, turns & later
    count = np.ones(len(path), dtype=np.int64)
    count[row] += early.any(axis=1).astype(np.int64) + late.any(axis=1)
    end = np.cumsum(count)
    out = np.repeat(path, count, axis=0)
    for inserted, place in ((early, end[row] - count[row]),
                            (late, end[row] - 1)):  # fmt: skip
        some = inserted.any(axis=1)
        out[place[some]] = np.where(inserted, value, middle)[some]
    return out, count
