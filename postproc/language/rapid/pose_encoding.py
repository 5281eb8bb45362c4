"""What the numbers of a robtarget or jointtarget mean: quaternions, quarter turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.pose_encoding import WIDEST, Dialect, Terms
from postproc.language.text.comment_directives import Comments

MM_DECIMALS, QUATERNION_DECIMALS, JOINT_DECIMALS = 3, 6, 5
HEADS = ("x", "y", "z", "q1", "q2", "q3", "q4", "cf1", "cf4", "cf6", "cfx")
WIDTH = len(HEADS)
COMMENTS = Comments("!", '"')
COUNTED = (0, 3, 5)  # joints whose quarter turns are counted
QUARTER = np.pi / 2
# [rad] beyond a quarter's border a count still holds: axes at 0 or 90 deg are common,
# and what rounding moves a joint by is far less.
BORDER = np.deg2rad(0.02)
SURE = np.deg2rad(0.0005)  # [rad] more than the last digits of a target move a joint by

_FLAGS_SAY = (
    "confdata counts other quarter turns, or names another configuration, than where "
    "the move arrives"
)
TERMS = Terms(
    tool="the tool",
    base="the arm's base",
    uframe="the work object",
    tool_remote="robhold: the tool stands still, or the arm holds the work object",
    blend=(
        "zones",
        "moves overlapping by {:g} %",
        "zones of {:g} mm",
        "zones that begin at their radius",
    ),
    corner="as its zone says: it is corrected for where the path passes; to hit it, "
    "stop there (fine)",
    branch_stops=f"{_FLAGS_SAY}: with ConfL or ConfJ \\On the controller stops here",
    branch_may_stop=f"{_FLAGS_SAY}, and whether that is checked is not known here",
    turn_stops=f"{_FLAGS_SAY}: with ConfL or ConfJ \\On the controller stops here",
    turn_may_stop=f"{_FLAGS_SAY}, and whether that is checked is not known here",
    branch="confdata names another configuration than the arm is in: whether it "
    "counts is uncertain (ConfJ {})",
    nearest="confdata names another turn than the nearest: which of the two counts is "
    "uncertain (ConfJ {}, {})",
    wrist="confdata names another configuration or turn than the nearest: whether a "
    "line with SingArea \\Wrist leads there is uncertain",
    overruled="the path arrives in another configuration than confdata names: with "
    "ConfL \\Off the path decides",
    law_unknown="how the tool turns along the path is not known here (SingArea, "
    "CirPathMode)",
    angles="how the tool turns along the path is uncertain: {}",
    arc="how the tool turns along this arc is uncertain ({}): turn it in smaller steps",
    laws=("", "SingArea \\Off", "CirPathMode \\PathFrame", "", "", "SingArea \\Wrist"),
)


@dataclass(frozen=True)
class RapidNumbers(Dialect):
    """Position [mm], quaternion and confdata of a robtarget, or six joint angles."""

    terms: Terms = TERMS
    heads: tuple[str, ...] = HEADS
    flag_joints: tuple[int, ...] = COUNTED
    flag_step: float = QUARTER
    flag_columns: tuple[int, ...] = (7, 8, 9, 10)
    orientation: ClassVar = slice(3, 7)
    pose_decimals: tuple[int, ...] = (
        *(MM_DECIMALS,) * 3,
        *(QUATERNION_DECIMALS,) * 4,
        *(0,) * 4,
    )
    joint_decimals: tuple[int, ...] = (JOINT_DECIMALS,) * WIDTH

    @property
    def widest(self) -> tuple[float, ...]:
        """Return numbers that none of a pose is longer than, see `Dialect.widest`."""
        return (WIDEST,) * 3 + (-1.0,) * 8

    def rotations(self, written: Floats) -> Floats:
        """Return the rotations of quaternions (.., 4)."""
        return rotation_from_quaternion(written)

    def orientations(self, R: Floats, near: Floats) -> Floats:
        """Return quaternions (k, 4) that keep the sign of others."""
        new = quaternion_from_rotation(R)
        new[np.einsum("kc,kc->k", new, near) < 0.0] *= -1.0
        return new

    def flags(
        self, config: Ints, configs: tuple[str, ...], values: Floats
    ) -> tuple[Ints, Floats]:
        """Read confdata, see `Dialect.flags`.

        cfx of arms with six axes counts behind axis 1, behind the lower arm and
        negative axis 5 as 4, 2 and 1. What is no such number is slot 0, and `misses`
        tells it.
        """
        cf4, cf6, cfx = values[:, 8], values[:, 9], values[:, 10]
        x = np.where((cfx >= 0) & (cfx < 8), cfx, 0).astype(np.int64)
        slot = ((x & 1) << 2) | ((x & 4) >> 1) | ((x & 2) >> 1)
        turns = np.full((len(values), 3), np.nan)
        turns[:, 0], turns[:, 1] = np.floor((cf4 + 2) / 4), np.floor((cf6 + 2) / 4)
        return slot, turns

    def count_flags(self, values: Floats, q: Floats) -> Floats:
        """Count the quarter turns of new poses, see `Dialect.count_flags`."""
        out = np.array(values)
        out[:, 7:10] = np.floor(q[:, COUNTED] / QUARTER)
        return out

    def rewrite_flags(self, values: Floats, q: Floats, before: Floats) -> Floats:
        """Count the quarter turns anew of joints that left theirs, see `Dialect`.

        A count that was beside its quarter by no more than the border is kept where it
        still is.
        """
        out = np.array(values)
        for column, joint in zip((7, 8, 9), COUNTED, strict=True):
            count = out[:, column]
            off = _beyond(count, q[:, joint], SURE)
            was = _beyond(count, before[:, joint], SURE)
            off &= ~was | _beyond(count, q[:, joint])
            out[off, column] = np.floor(q[off, joint] / QUARTER)
        return out

    def misses(self, values: Floats, q: Floats) -> Bools:
        """Tell where quarter turns are not those of joints (k, 6) [rad], (k,)."""
        cfx = values[:, 10]
        found = ~((cfx >= 0) & (cfx < 8) & (cfx == np.round(cfx)))
        for column, joint in zip((7, 8, 9), COUNTED, strict=True):
            found |= _beyond(values[:, column], q[:, joint])
        return np.asarray(found)


RAPID_DIALECT = RapidNumbers()


def _beyond(count: Floats, q: Floats, by: float = BORDER) -> Bools:
    """Tell which joints (k,) [rad] lie outside of the quarter turns counted, (k,)."""
    low = count * QUARTER
    return np.asarray((q < low - by) | (q > low + QUARTER + by))


def rotation_from_quaternion(q: Floats) -> Floats:
    """Convert quaternions (..., 4), scalar first and of any length, to (..., 3, 3)."""
    q = np.asarray(q, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    R = np.empty((*q.shape[:-1], 3, 3))
    R[..., 0, 0], R[..., 1, 1] = 1 - 2 * (y * y + z * z), 1 - 2 * (x * x + z * z)
    R[..., 2, 2] = 1 - 2 * (x * x + y * y)
    R[..., 0, 1], R[..., 1, 0] = 2 * (x * y - z * w), 2 * (x * y + z * w)
    R[..., 0, 2], R[..., 2, 0] = 2 * (x * z + y * w), 2 * (x * z - y * w)
    R[..., 1, 2], R[..., 2, 1] = 2 * (y * z - x * w), 2 * (y * z + x * w)
    return R


def quaternion_from_rotation(R: Floats) -> Floats:
    """Convert rotations (k, 3, 3) to unit quaternions (k, 4), scalar first.

    The largest component is found first and is positive (Shepperd 1978).
    """
    d = np.stack([R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]], axis=1)
    trace = d.sum(axis=1, keepdims=True)
    square = np.concatenate([1 + trace, 1 + 2 * d - trace], axis=1)  # 4 c^2
    first = square.argmax(axis=1)
    off = {
        (0, 1): R[:, 2, 1] - R[:, 1, 2],
        (0, 2): R[:, 0, 2] - R[:, 2, 0],
        (0, 3): R[:, 1, 0] - R[:, 0, 1],
        (1, 2): R[:, 1, 0] + R[:, 0, 1],
        (1, 3): R[:, 0, 2] + R[:, 2, 0],
        (2, 3): R[:, 2, 1] + R[:, 1, 2],
    }  # 4 c_i c_j
    products = np.empty((len(R), 4, 4))
    for (i, j), value in off.items():
        products[:, i, j] = products[:, j, i] = value
    products[:, range(4), range(4)] = square
    rows = np.arange(len(R))
    scale = 2.0 * np.sqrt(np.maximum(square[rows, first], 0.0))
    return np.asarray(products[rows, first] / scale[:, None])
