"""The chain with deviations, for a batch of states at once."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.robot.arm import DH, Arm
from postproc.robot.pose import cross
from postproc.robot.state import States

# A Denavit-Hartenberg chain with deviations, for many poses at once.
#
# The arm's own kinematics are nominal. A calibrated chain differs in every placement,
# and its derivatives are wanted at the deviated place: both fall out of one walk along
# the chain that keeps the axes and points of every elementary motion.


@dataclass(frozen=True)
class Deviation:
    """What a real chain's placements differ by from the nominal ones.

    Attributes:
        base: Shift x, y, z [m] of the base, then rotations about x, y, z [rad], (6,).
        link: Per joint a [m], d [m], alpha, theta, beta [rad], (6, 5); beta is Hayati's
            rotation about the y axis of the link frame, after alpha.
        tool: Shift of the TCP in the flange frame [m], (3,).
    """

    base: Floats
    link: Floats
    tool: Floats


NOMINAL = Deviation(np.zeros(6), np.zeros((6, 5)), np.zeros(3))


@dataclass(frozen=True)
class Walk:
    """Axes and points met along the chain, base frame; n poses.

    Poses lie next to each other in memory: long passes are faster than short ones.

    Attributes:
        turn, pivot: Axis z of every joint and a point on it, (n, 6, 3).
        link, corner: Axis x of a and alpha and a point on it, (n, 6, 3).
        bend: Axis y of beta, through `corner`, (n, 6, 3).
        base_axes: Axes of the three base rotations, (3, 3), through `base_point`.
        flange: Rotation of the flange, (n, 3, 3).
        tcp: Tool centre point, (n, 3) [m].
    """

    turn: Floats
    pivot: Floats
    link: Floats
    corner: Floats
    bend: Floats
    base_axes: Floats
    base_point: Floats
    flange: Floats
    tcp: Floats


def _turn_axes(a: Floats, b: Floats, cos: Floats | float, sin: Floats | float) -> tuple:  # type: ignore[type-arg]
    """Turn the orthogonal axes a towards b by an angle, about a x b."""
    return cos * a + sin * b, cos * b - sin * a


def _base(deviation: Deviation) -> tuple[Floats, Floats]:
    """Give the base's axes as columns, and the axes of its three rotations as rows."""
    axes, about = np.eye(3), np.eye(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        angle = deviation.base[3 + k]
        about[k] = axes[:, k]
        axes[:, i], axes[:, j] = _turn_axes(
            axes[:, i].copy(), axes[:, j].copy(), np.cos(angle), np.sin(angle)
        )
    return axes, about


def base_of(deviation: Deviation) -> Floats:
    """Give the base's axes, the axes of its three rotations and its point, (7, 3)."""
    axes, about = _base(deviation)
    return np.concatenate([axes.T, about, deviation.base[None, :3]])


def deviate(dh: DH, deviation: Deviation) -> DH:
    """Return the real parameters, but for base, tool and Hayati's rotations."""
    da, dd, dalpha, dtheta, _ = deviation.link.T
    return replace(
        dh, a=dh.a + da, d=dh.d + dd, alpha=dh.alpha + dalpha, offset=dh.offset + dtheta
    )


def walk(dh: DH, q: Floats, tool: Floats, deviation: Deviation = NOMINAL) -> Walk:
    """Walk along the chain from the base to the tool centre point.

    Args:
        dh: Nominal parameters.
        q: Joint angles, (n, 6) [rad].
        tool: TCP in the flange frame, (n, 3) [m].
        deviation: Deviations of the placements.
    """
    shape = (3, len(q))
    theta = np.ascontiguousarray((dh.angles(q) + deviation.link[:, 3]).T)
    cos, sin = np.cos(theta), np.sin(theta)
    axes, about = _base(deviation)
    x, y, z = (np.broadcast_to(axis[:, None], shape) for axis in axes.T)
    p: Floats = np.broadcast_to(deviation.base[:3, None], shape)
    turn, pivot, link, corner, bend = (np.empty((6, *shape)) for _ in range(5))
    for i in range(6):
        da, dd, dalpha, _, beta = deviation.link[i]
        alpha = dh.alpha[i] + dalpha
        turn[i], pivot[i] = z, p
        x, y = _turn_axes(x, y, cos[i], sin[i])
        p = p + (dh.d[i] + dd) * z + (dh.a[i] + da) * x
        y, z = _turn_axes(y, z, np.cos(alpha), np.sin(alpha))
        link[i], corner[i], bend[i] = x, p, y
        if beta != 0.0:
            z, x = _turn_axes(z, x, np.cos(beta), np.sin(beta))
    flange, (tx, ty, tz) = np.stack([x, y, z]), (tool + deviation.tool).T
    tcp = p + (x * tx + y * ty + z * tz)
    point = np.array(deviation.base[:3])
    turn, pivot, link, corner, bend = (
        np.moveaxis(a, 2, 0) for a in (turn, pivot, link, corner, bend)
    )
    return Walk(turn, pivot, link, corner, bend, about, point, flange.T, tcp.T)


def tcp(dh: DH, q: Floats, tool: Floats, deviation: Deviation = NOMINAL) -> Floats:
    """Place the tool centre point alone, (n, 3) [m]: `Walk.tcp` at a third of the cost.

    Args:
        dh: Nominal parameters.
        q: Joint angles, (n, 6) [rad].
        tool: TCP in the flange frame, (n, 3) [m].
        deviation: Deviations of the placements.
    """
    axes, _ = _base(deviation)
    real, beta = deviate(dh, deviation), deviation.link[:, 4]
    placed = real.place(q, tool + deviation.tool, beta)
    moved: Floats = placed @ axes.T + deviation.base[:3]
    return moved


# Kinematics and torque of one batch of states, computed once for all effects.

T = TypeVar("T")


@dataclass(eq=False)
class Loads:
    """Torques about the joints: they depend on the nominal arm only."""

    arm: Arm
    states: States

    @cached_property
    def _torques(self) -> tuple[Floats, Floats]:
        """Torques of links and payload, (n, 6) [N m] each."""
        s = self.states
        return self.arm.torques(s.q, np.nan_to_num(s.payload), self._com)

    @property
    def _com(self) -> Floats:
        """Centre of mass of the payload, (n, 3) [m]: at the TCP where none is known."""
        s = self.states
        return np.where(np.isnan(s.payload_com), s.tool, s.payload_com)

    @property
    def gravity(self) -> Floats:
        """Torque of the arm's own links, (n, 6) [N m]."""
        return self._torques[0]

    @cached_property
    def payload(self) -> Floats:
        """Torque of the payload, (n, 6) [N m]; 0 where it is not known."""
        own, carried = self._torques
        # By way of both loads: the last bits of fitted models hang on it.
        torque: Floats = (own + carried) - own
        return torque

    @cached_property
    def total(self) -> Floats:
        """Torque of links and payload, (n, 6) [N m]."""
        total: Floats = self.gravity + self.payload
        return total

    @cached_property
    def tilting(self) -> Floats:
        """Moment of links and payload about the base's axes, (n, 3) [N m]."""
        s = self.states
        return self.arm.tilting_moment(s.q, np.nan_to_num(s.payload), self._com)

    @cached_property
    def bending(self) -> Floats:
        """Moment of links and payload across every joint, (n, 6, 2) [N m]."""
        s = self.states
        return self.arm.bending_moments(s.q, np.nan_to_num(s.payload), self._com)

    @cached_property
    def bending_basis(self) -> Floats:
        """The same per unit of the links' first moments, (n, 6, 2, 6, 3)."""
        return self.arm.bending_basis(self.states.q)

    @cached_property
    def basis(self) -> Floats:
        """Torque per unit of every lumped mass parameter, (n, 6, k)."""
        return self.arm.gravity_basis(self.states.q)


@dataclass(eq=False)
class ArmStates:
    """States of an arm, with what effects need of its kinematics.

    Attributes:
        arm: The nominal arm.
        states: n states.
        deviation: Placement errors that the kinematics are taken at.
        shift: Joint errors that the kinematics are taken at, (n, 6) [rad].
        known: What effects have asked for `once`, shared by batches of the same poses.
    """

    arm: Arm
    states: States
    deviation: Deviation = NOMINAL
    shift: Floats | None = None
    loads: Loads = field(init=False)
    known: dict[Hashable, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.loads = Loads(self.arm, self.states)

    def __len__(self) -> int:
        """Return the number of states."""
        return len(self.states)

    def move(self, deviation: Deviation, shift: Floats | None) -> ArmStates:
        """Return the same states with the kinematics taken at a deviated arm."""
        return self._beside(ArmStates(self.arm, self.states, deviation, shift))

    def arriving(self, direction: Floats) -> ArmStates:
        """Return the same poses reached from other sides, (n, 6)."""
        states = self.states.with_(direction=direction)
        return self._beside(ArmStates(self.arm, states, self.deviation, self.shift))

    def _beside(self, batch: ArmStates) -> ArmStates:
        """Share what depends on the nominal poses alone."""
        batch.loads, batch.known = self.loads, self.known
        return batch

    def once(self, who: Hashable, evaluate: Callable[[Floats], T]) -> T:
        """Evaluate a function of the joint angles alone, once for all directions.

        Args:
            who: Names the function.
            evaluate: Takes the joint angles (n, 6) [rad].
        """
        if who not in self.known:
            self.known[who] = evaluate(self.states.q)
        found: T = self.known[who]
        return found

    @property
    def angles(self) -> Floats:
        """Joint angles that the kinematics are taken at, (n, 6) [rad]."""
        return self.states.q if self.shift is None else self.states.q + self.shift

    @cached_property
    def walk(self) -> Walk:
        """Axes, points and TCP along the (deviated) chain."""
        return walk(self.arm.dh, self.angles, self.states.tool, self.deviation)

    @cached_property
    def tcp(self) -> Floats:
        """Tool centre point along the (deviated) chain, (n, 3) [m]."""
        if "walk" in vars(self):
            return self.walk.tcp
        return tcp(self.arm.dh, self.angles, self.states.tool, self.deviation)

    def __getitem__(self, rows: NDArray[np.int64]) -> ArmStates:
        """Return some of the states, with the kinematics taken at the same arm."""
        shift = None if self.shift is None else self.shift[rows]
        return ArmStates(self.arm, self.states[rows], self.deviation, shift)

    @cached_property
    def jacobian(self) -> Floats:
        """Derivative of the TCP by the controller's joint angles, (n, 3, 6) [m/rad]."""
        w = self.walk
        turned = cross(w.turn, w.tcp[:, None, :] - w.pivot)
        return self._to_controller(turned)

    @cached_property
    def angular(self) -> Floats:
        """Angular velocity of the tool by joint angle, (n, 3, 6)."""
        return self._to_controller(self.walk.turn)

    def _to_controller(self, per_axis: Floats) -> Floats:
        """Convert derivatives (n, 6, 3) by geometric angles to the controller's."""
        dh, axes = self.arm.dh, np.moveaxis(per_axis, 0, 2)
        flat = (axes * dh.sense[:, None, None]).reshape(6, -1)
        out: Floats = (dh.mix.T @ flat).reshape(axes.shape)
        return out.T
