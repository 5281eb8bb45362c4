"""Kinematics and torque of one batch of states, computed once for all effects."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.chain import NOMINAL, Deviation, Walk, tcp, walk
from postproc.arrays import Floats
from postproc.robot.arm import Arm
from postproc.robot.pose import cross
from postproc.robot.state import States

T = TypeVar("T")


@dataclass(eq=False)
class Loads:
    """Torques about the joints: they depend on the nominal arm only."""

    arm: Arm
    states: States

    @cached_property
    def gravity(self) -> Floats:
        """Torque of the arm's own links, (n, 6) [N m]."""
        return self.arm.gravity_torque(self.states.q)

    @cached_property
    def payload(self) -> Floats:
        """Torque of the payload, (n, 6) [N m]; 0 where it is not known.

        Where no centre of mass is known, the mass is taken to sit at the TCP.
        """
        s = self.states
        mass = np.nan_to_num(s.payload)
        if not mass.any():
            return np.zeros((len(s), 6))
        com = np.where(np.isnan(s.payload_com), s.tool, s.payload_com)
        loaded = self.arm.gravity_torque(s.q, mass, com)
        torque: Floats = loaded - self.gravity
        return torque

    @cached_property
    def total(self) -> Floats:
        """Torque of links and payload, (n, 6) [N m]."""
        total: Floats = self.gravity + self.payload
        return total

    @cached_property
    def basis(self) -> Floats:
        """Torque per unit of every lumped mass parameter, (n, 6, k)."""
        return self.arm.gravity_basis(self.states.q)


@dataclass(eq=False)
class Batch:
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

    def moved(self, deviation: Deviation, shift: Floats | None) -> Batch:
        """Return the same states with the kinematics taken at a deviated arm."""
        return self._beside(Batch(self.arm, self.states, deviation, shift))

    def arriving(self, direction: Floats) -> Batch:
        """Return the same poses reached from other sides, (n, 6)."""
        states = self.states.with_(direction=direction)
        return self._beside(Batch(self.arm, states, self.deviation, self.shift))

    def _beside(self, batch: Batch) -> Batch:
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

    def __getitem__(self, rows: NDArray[np.int64]) -> Batch:
        """Return some of the states, with the kinematics taken at the same arm."""
        shift = None if self.shift is None else self.shift[rows]
        return Batch(self.arm, self.states[rows], self.deviation, shift)

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
