"""What the numbers of a position mean: X, Y, Z, A, B, C, and the bits of S and T."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.pose_encoding import Dialect, Terms, nearer
from postproc.language.text.comment_directives import Comments
from postproc.robot.pose import MM

MM_DECIMALS, ANGLE_DECIMALS, JOINT_DECIMALS = 3, 4, 5
COMMENTS = Comments(";", '"')
HEADS = tuple("XYZABCST")
COMPONENTS = tuple(name.lower() for name in HEADS)
WIDTH = len(HEADS)
STATUS, TURN = 6, 7
AXES = np.arange(6)
NOT_WRITTEN = -1.0  # value of S or T where the position has none
MEASURED, UNKNOWN_STATUS = 16, 32  # bit 4 of S, and the first value that is none
# [rad] around 0 where the bit of an axis may be either: axes at 0 are common, and a
# wrong bit turns an axis by 360 deg.
BORDER = np.deg2rad(0.02)
SURE = np.deg2rad(0.0005)  # [rad] more than the last digits of a target move an axis by
LEAVING = 4.0 * SURE  # by which axes are taken away from 0

_FLAGS_SAY = "S or T name another configuration or other turns than the move ends with"
TERMS = Terms(
    tool="$TOOL",
    base="$ROBROOT",
    uframe="$BASE",
    tool_remote="$IPO_MODE = #TCP: the tool stands still, the arm holds the part",
    blend=(
        "C_DIS",
        "moves overlapping by {:g} % ($APO.CPTP)",
        "distances of {:g} mm ($APO.CDIS)",
        "blending that begins at its distance",
    ),
    corner="as $APO says: it is corrected for where the path passes; to hit it, leave "
    "C_DIS out",
    branch_stops=_FLAGS_SAY,
    branch_may_stop=_FLAGS_SAY,
    turn_stops=_FLAGS_SAY,
    turn_may_stop=_FLAGS_SAY,
    branch="S names another configuration than the arm is in ({})",
    nearest="T names another turn than the nearest ({}, {})",
    wrist="on a line with $ORI_TYPE = #JOINT the wrist may end differently",
    overruled="the path arrives in another configuration than S and T name",
    law_unknown="how the tool turns along the path is not known here ($ORI_TYPE, "
    "$CIRC_TYPE)",
    angles="how the tool turns along the path is uncertain: {}",
    arc="how the tool turns along this arc is uncertain ({}): turn it in smaller steps",
    laws=("", "#VAR", "$CIRC_TYPE, $CIRC_MODE", "", "", "$ORI_TYPE = #JOINT"),
    border="axis {} ends within 0.02 deg of 0, where T is uncertain: a wrong T turns "
    "it by 360 deg",
)


@dataclass(frozen=True)
class KrlNumbers(Dialect):
    """Position [mm], angles [deg], S and T of a position, or six joint angles."""

    runs_alone: bool = True
    terms: Terms = TERMS
    heads: tuple[str, ...] = HEADS
    flag_joints: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    flag_step: float = 1e6  # 0 alone
    sign_flags: bool = True
    flag_columns: tuple[int, ...] = (STATUS, TURN)
    pose_decimals: tuple[int, ...] = (
        *(MM_DECIMALS,) * 3,
        *(ANGLE_DECIMALS,) * 3,
        *(0,) * 2,
    )
    joint_decimals: tuple[int, ...] = (JOINT_DECIMALS,) * WIDTH

    def rotations(self, written: Floats) -> Floats:
        """Return the rotations Rz(A) Ry(B) Rx(C) of A, B, C (.., 3) [deg]."""
        a, b, c = np.moveaxis(np.deg2rad(np.asarray(written, dtype=float)), -1, 0)
        ca, sa, cb, sb, cc, sc = (f(x) for x in (a, b, c) for f in (np.cos, np.sin))
        R = np.empty((*a.shape, 3, 3))
        R[..., 0, 0], R[..., 1, 0], R[..., 2, 0] = ca * cb, sa * cb, -sb
        R[..., 0, 1], R[..., 0, 2] = ca * sb * sc - sa * cc, ca * sb * cc + sa * sc
        R[..., 1, 1], R[..., 1, 2] = sa * sb * sc + ca * cc, sa * sb * cc - ca * sc
        R[..., 2, 1], R[..., 2, 2] = cb * sc, cb * cc
        return R

    def orientations(self, R: Floats, near: Floats) -> Floats:
        """Return the A, B, C of rotations next to others, (k, 3) [deg].

        Where B is 90 deg only a difference of A and C is told: A stays.
        """
        near = np.deg2rad(near)
        cosine = np.hypot(R[:, 0, 0], R[:, 1, 0])
        b = np.arctan2(-R[:, 2, 0], cosine)
        a = np.arctan2(R[:, 1, 0], R[:, 0, 0])
        a = np.where(cosine < 1e-9, near[:, 0], a)
        # With A known the rest is a turn about x.
        x = np.stack([-np.sin(a), np.cos(a), np.zeros_like(a)], axis=1)
        y, z = (np.einsum("ki,ki->k", x, R[:, :, axis]) for axis in (1, 2))
        c = np.arctan2(-z, y)
        one = np.stack([a, b, c], axis=1)
        other = np.stack([a + np.pi, np.pi - b, c + np.pi], axis=1)
        return np.rad2deg(nearer(one, other, near, 2 * np.pi))

    def shift_rotations(self, angles: Floats) -> Floats:
        """Return the rotations of A, B, C (k, 3) [deg], see `Dialect`."""
        return self.rotations(angles)

    def shift_angles(self, rotations: Floats, near: Floats) -> Floats:
        """Return A, B, C of rotations, see `Dialect`."""
        return self.orientations(rotations, near)

    def flags(
        self, config: Ints, configs: tuple[str, ...], values: Floats
    ) -> tuple[Ints, Floats]:
        """Read S and T, see `Dialect.flags`.

        Bit 0 of S: the wrist centre is behind axis 1; bit 1: the elbow. On which side
        axis 5 is, bit 4 of T says: sources disagree on bit 2 of S. A sign is half a
        turn: the axis lies around 180 or -180 deg, 0.02 deg beyond 0 at the most.
        """
        s, bits = _whole(values[:, STATUS]), turn_bits(values[:, TURN])
        slot = (bits[:, 4] << 2) | ((s & 1) << 1) | (1 - ((s >> 1) & 1))
        half = 0.5 - BORDER / (2 * np.pi)
        turns = np.full((len(values), 3), np.nan)
        for column, axis in enumerate((3, 5)):
            turns[:, column] = np.where(bits[:, axis] > 0, -half, half)
        return slot, turns

    def rewrite_flags(self, values: Floats, q: Floats, before: Floats) -> Floats:
        """Write T anew for axes that have passed 0, see `Dialect`.

        S says the branch, which no correction leaves. A bit that was not that of its
        axis before is kept where it is not clearly wrong because of the correction.
        """
        out = np.array(values)
        bits = turn_bits(values[:, TURN])
        off = _beyond(bits, q, SURE)
        off &= ~_beyond(bits, before, SURE) | (
            _beyond(bits, q) & ~_beyond(bits, before)
        )
        new = np.where(off, 1 - bits, bits)
        changed = off.any(axis=1) & (values[:, TURN] >= 0)
        high = values[:, TURN] - (bits << AXES).sum(axis=1)
        out[changed, TURN] = ((new << AXES).sum(axis=1) + high)[changed]
        return out

    def misses(self, values: Floats, q: Floats) -> Bools:
        """Tell where signs of T are not those of joints (k, 6) [rad], (k,)."""
        return np.asarray(_beyond(turn_bits(values[:, TURN]), q).any(axis=1))

    def near_border(
        self, values: Floats, q: Floats, before: Floats, rounded: bool = False
    ) -> Bools:
        """Tell which joints are so near 0 that T may be wrong, see `Dialect`.

        One that the correction takes away from 0, to the side that its bit names, is
        there on the controller, too, if the source is.
        """
        inwards = _side_of(values)
        away = (q - before) * inwards >= (0.0 if rounded else SURE)
        away &= before * inwards >= -SURE
        return np.asarray((np.abs(q) <= BORDER) & ~away)

    def leave_border(self, values: Floats, q: Floats, before: Floats) -> Floats:
        """Say how far joints must move to be on their side of 0, see `Dialect`."""
        inwards = _side_of(values)
        moves = np.maximum(before * inwards, 0.0) + LEAVING - q * inwards
        able = self.near_border(values, q, before) & (before * inwards >= -SURE)
        return np.where(able & (values[:, TURN] >= 0)[:, None], moves * inwards, 0.0)


KRL_DIALECT = KrlNumbers()


def _whole(values: Floats) -> Ints:
    """Return whole numbers from 0 on, 0 for what is none, (k,)."""
    known = (values >= 0) & (values < 2**31) & (values == np.round(values))
    return np.where(known, values, 0).astype(np.int64)


def turn_bits(values: Floats) -> Ints:
    """Return the six bits of T, (k, 6): axis i + 1 is negative."""
    return np.asarray((_whole(values)[:, None] >> AXES) & 1)


def _side_of(values: Floats) -> Floats:
    """Return 1 for axes that T says to be at 0 or above, -1 for the others, (k, 6)."""
    return np.where(turn_bits(values[:, TURN]) > 0, -1.0, 1.0)


def _beyond(bits: Ints, q: Floats, by: float = BORDER) -> Bools:
    """Tell which joints (k, 6) [rad] are on the other side of 0 than bits say."""
    return np.asarray(np.where(bits > 0, q > by, q < -by))


def numbers_of(pose: Floats) -> list[float]:
    """Return X, Y, Z [mm] and A, B, C [deg] of a pose, (4, 4) [m]."""
    angles = KRL_DIALECT.orientations(pose[None, :3, :3], np.zeros((1, 3)))[0]
    return [*(pose[:3, 3] / MM).tolist(), *angles.tolist()]
