"""One branch of the inverse kinematics at a time, for very many poses.

The formulas are those of py-opw-kinematics (Brandstoetter, Angerer, Hofbaur 2014, see
`inverse`), which solves for all eight branches and needs several times as long for it.
Paths and corrections stay on one branch that is known beforehand.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.pose import MM
from postproc.robot.arm_file import OpwSection

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CHUNK = 8192  # poses solved at a time: what they need stays in the cache
WRIST, SHOULDER, ELBOW = 4, 2, 1  # bits of a slot


class ClosedForm:
    """The closed form of one arm, in its geometric joint angles."""

    def __init__(self, parameters: OpwSection) -> None:
        """Take the arm file's section."""
        p = parameters
        self._a1, self._b, self._c1 = p.a1_mm * MM, p.b_mm * MM, p.c1_mm * MM
        self._c2, self._c4 = p.c2_mm * MM, p.c4_mm * MM
        self._forearm = float(np.hypot(p.a2_mm, p.c3_mm)) * MM
        self._bent = float(np.arctan2(p.a2_mm, p.c3_mm))
        self._offset = np.deg2rad(p.offsets_deg)
        self._sign = np.where(p.flip_axes, -1.0, 1.0)

    def branch(self, flange: Array, slot: Ints) -> Array:
        """Solve for one branch of every pose.

        Args:
            flange: Flange poses, (n, 4, 4) [m].
            slot: Slots 4 W + 2 S + E, (n,).

        Returns:
            Geometric joint angles on no particular turn, (n, 6) [rad], NaN where the
            branch does not exist.
        """
        out = np.empty((len(flange), 6))
        for a in range(0, len(flange), CHUNK):
            rows = slice(a, a + CHUNK)
            out[rows] = self._branch(flange[rows], slot[rows])
        return out

    def slot(self, theta: Array) -> Ints:
        """Name the branch of geometric joint angles (n, 6) [rad], (n,)."""
        t = theta * self._sign - self._offset
        upper = self._c2 * np.sin(t[:, 1])
        lower = self._forearm * np.sin(t[:, 1] + t[:, 2] + self._bent)
        behind = self._a1 + upper + lower < 0
        other = np.sin(t[:, 2] + self._bent) < 0
        negative = np.sin(t[:, 4]) < 0
        slots: Ints = WRIST * negative + SHOULDER * behind + ELBOW * other
        return slots

    def _branch(self, flange: Array, slot: Ints) -> Array:
        """Solve for one branch of some poses."""
        behind = (slot & SHOULDER) > 0
        elbow = np.where((slot & ELBOW) > 0, -1.0, 1.0)
        wrist = np.where((slot & WRIST) > 0, -1.0, 1.0)
        R, c2, c3 = flange[:, :3, :3], self._c2, self._forearm
        centre = flange[:, :3, 3] - self._c4 * R[:, :, 2]
        cx, cy, z = centre[:, 0], centre[:, 1], centre[:, 2] - self._c1
        with np.errstate(invalid="ignore", divide="ignore"):
            reach = np.sqrt(cx**2 + cy**2 - self._b**2)
            aside = np.arctan2(self._b, reach)
            t1 = np.arctan2(cy, cx) + np.where(behind, aside - np.pi, -aside)
            x = np.where(behind, -reach, reach) - self._a1
            far = x**2 + z**2
            lean = np.arccos((far + c2**2 - c3**2) / (2 * np.sqrt(far) * c2))
            t2 = np.arctan2(x, z) - elbow * lean
            fold = np.arccos((far - c2**2 - c3**2) / (2 * c2 * c3))
            t3 = elbow * fold - self._bent
        s1, c1 = np.sin(t1)[:, None], np.cos(t1)[:, None]
        s23, c23 = np.sin(t2 + t3)[:, None], np.cos(t2 + t3)[:, None]
        ahead = c1 * R[:, 0] + s1 * R[:, 1]  # rows of the flange seen from axis 1
        across = c1 * R[:, 1] - s1 * R[:, 0]
        out = ahead * c23 - R[:, 2] * s23  # .. and seen from the forearm
        along = ahead * s23 + R[:, 2] * c23
        t4 = np.arctan2(wrist * across[:, 2], wrist * out[:, 2])
        t5 = wrist * np.arctan2(np.hypot(across[:, 2], out[:, 2]), along[:, 2])
        t6 = np.arctan2(wrist * along[:, 1], -wrist * along[:, 0])
        angles = np.stack([t1, t2, t3, t4, t5, t6], axis=1)
        angles[np.isnan(angles).any(axis=1)] = np.nan
        solved: Array = (angles + self._offset) * self._sign
        return solved
