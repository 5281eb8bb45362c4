"""Inverse kinematics of an arm: all branches or one, on turns within its range.

By a closed form where the arm file has one, else by Newton's method from many starts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc import _native
from postproc.arrays import Floats, Ints, floats
from postproc.robot.arm_file import OpwSection
from postproc.robot.pose import MM

# The closed-form inverse kinematics of an ortho-parallel arm, for very many poses.
#
# Brandstoetter, Angerer, Hofbaur: An analytical solution of the inverse kinematics
# problem of industrial serial manipulators with an ortho-parallel basis and a spherical
# wrist (2014). For one branch alone where that is known: a correction stays on it.


class ClosedForm:
    """The closed form of one arm, in its geometric joint angles.

    Branches are named by slots 4 W + 2 S + E. W: axis 5 negative; S: wrist centre
    behind axis 1; E: the other elbow.
    """

    def __init__(self, parameters: OpwSection) -> None:
        """Take the arm file's section."""
        p = parameters
        forearm = np.hypot(p.a2_mm, p.c3_mm)
        lengths_mm = p.a1_mm, p.b_mm, p.c1_mm, p.c2_mm, forearm, p.c4_mm
        self._packed = np.array([
            *(length * MM for length in lengths_mm), np.arctan2(p.a2_mm, p.c3_mm),
            *np.deg2rad(p.offsets_deg), *np.where(p.flip_axes, -1.0, 1.0),
        ])  # fmt: skip

    def branches(self, flange: Floats) -> Floats:
        """Solve for all branches of every pose.

        Args:
            flange: Flange poses, (n, 4, 4) [m].

        Returns:
            Geometric joint angles on no particular turn, (n, 8, 6) [rad], NaN where a
            branch does not exist.
        """
        return _native.branches(self._packed, floats(flange))

    def branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch of every pose.

        Args:
            flange: Flange poses, (n, 4, 4) [m].
            slot: Branches, (n,).

        Returns:
            Geometric joint angles on no particular turn, (n, 6) [rad], NaN where the
            branch does not exist.
        """
        slot = np.ascontiguousarray(slot)
        return _native.branch(self._packed, floats(flange), slot)

    def solver(self, mix: Floats, unmix: Floats) -> _native.Solver:
        """Return what goes from pose to pose, see `Inverse.nearest`."""
        return _native.Solver.of_closed_form(self._packed, (floats(mix), floats(unmix)))


class NumericForm:
    """The inverse kinematics of any chain with six axes, in the controller's angles.

    Newton's method starts from the solutions of the pose before, then from many places
    that fill the joints' space; what it finds is a solution to 1e-11 m and rad, what it
    does not find counts as none. Branches are told apart by what vanishes at their
    singularities: W: the sine of axis 5 is negative; E: the wrist comes nearer to axis
    2 as axis 3 turns on; S: the sign of what is left of the determinant of the
    Jacobian. Where these bits do not tell solutions apart there is none.
    """

    def __init__(self, packed: Floats) -> None:
        """Take the chain, see `DH.pack`."""
        self._packed = packed

    def branches(self, flange: Floats) -> Floats:
        """Solve for all branches of flange poses (n, 4, 4) [m], as `ClosedForm`."""
        return _native.numeric_branches(self._packed, floats(flange))

    def branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch of every pose, as `ClosedForm`."""
        return self.branches(flange)[np.arange(len(flange)), slot]

    def solver(self, mix: Floats, unmix: Floats) -> _native.Solver:
        """Return what goes from pose to pose; its angles are the controller's."""
        return _native.Solver.of_chain(self._packed)


# Inverse kinematics of an arm: all branches or one, on turns within its range.


@dataclass(frozen=True)
class Branches:
    """All solutions of n flange poses, in stable slots 4 W + 2 S + E.

    Attributes:
        q: (n, 8, 6) [rad], NaN where a branch does not exist. Axes lie in the arm's
            range where a turn of 360 deg can bring them there, else in (-pi, pi].
    """

    q: Floats


def wrap(angle: Floats) -> Floats:
    """Wrap angles into [-pi, pi)."""
    wrapped: Floats = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    return wrapped


class Inverse:
    """The inverse kinematics of one arm."""

    def __init__(
        self,
        form: ClosedForm | NumericForm,
        mix: Floats,
        lower: Floats,
        upper: Floats,
    ) -> None:
        """Build it from a form, the angles' mixing in it, and joint limits [rad]."""
        self._form = form
        self._mix, self._unmix = mix, np.asarray(np.linalg.inv(mix), dtype=float)
        self._lower, self._upper = lower, upper
        self.solver = form.solver(self._mix, self._unmix)

    def nearest(self, flange: Floats, near: Floats, slot: Ints) -> Floats:
        """Solve for joint angles on branches, on the turns nearest to given ones.

        An arm without a closed form can have more solutions than branches: there that
        one counts which Newton's method reaches and no singularity parts from `near`,
        if there is one.

        Args:
            flange: Flange poses, (n, 4, 4) [m].
            near: Joint angles to stay close to, (n, 6) [rad].
            slot: Branches, (n,).

        Returns:
            (n, 6) [rad], NaN where there is no solution.
        """
        slot = np.ascontiguousarray(slot)
        return self.solver.nearest(floats(flange), floats(near), slot)

    def branches(self, flange: Floats) -> Branches:
        """Solve for all branches of flange poses (n, 4, 4) [m]."""
        q = self._form.branches(flange) @ self._unmix.T
        return Branches(self.into_range(q))

    def branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch each of flange poses (n, 4, 4) [m], on any turn.

        Returns:
            (n, 6) [rad], NaN where the branch does not exist.
        """
        q: Floats = self._form.branch(flange, slot) @ self._unmix.T
        return q

    def slot(self, q: Floats) -> Ints:
        """Name the branch (slot 4 W + 2 S + E) of joint angles (n, 6) [rad]."""
        return self.solver.slots(floats(q))

    def into_range(self, q: Floats) -> Floats:
        """Shift angles by whole turns into the joint range where that is possible."""
        rows = floats(q.reshape(-1, 6))
        return _native.into_range(rows, self._lower, self._upper).reshape(q.shape)
