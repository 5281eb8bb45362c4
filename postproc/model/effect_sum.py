"""The sum of effects: one vector of parameters, exact where geometry enters exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.model.effects.effect import Effect, JointEffect, Parameter
from postproc.model.effects.geometry import Geometry
from postproc.model.kinematics import NOMINAL, ArmStates, Deviation
from postproc.robot.pose import rotation_vector

INTERACTION = "interaction"  # what effects do through each other, beside their names


@dataclass(frozen=True)
class Combination:
    """Effects whose errors add up; their parameters are laid end to end.

    Geometry and joint errors go through the full kinematics together, so their
    products are right; other effects are added to the position.
    """

    effects: tuple[Effect, ...]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, in column order."""
        return tuple(p for e in self.effects for p in e.parameters())

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names ``effect.parameter`` of all parameters."""
        return tuple(f"{e.name}.{p.name}" for e in self.effects for p in e.parameters())

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Names ``effect.group`` of the prior group of every parameter."""
        return tuple(
            f"{e.name}.{p.group}" for e in self.effects for p in e.parameters()
        )

    @cached_property
    def scales(self) -> Floats:
        """Prior scales before the data rescale them, (p,)."""
        return np.array([p.scale for p in self.parameters], dtype=float)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Columns of every effect."""
        ends = np.cumsum([0, *(len(e.parameters()) for e in self.effects)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    def where(self, *origins: str) -> NDArray[np.bool_]:
        """Tell which parameters belong to effects of the given origins, (p,)."""
        return np.array(
            [e.belongs_to() in origins for e in self.effects for _ in e.parameters()],
            dtype=bool,
        )

    def shift(self, batch: ArmStates, p: Floats) -> Floats:
        """Sum the joint errors of all joint effects, (n, 6) [rad]."""
        total = np.zeros((len(batch), 6))
        for effect, part in zip(self.effects, self.slices, strict=True):
            if isinstance(effect, JointEffect):
                total += effect.angles(batch, p[part])
        return total

    def deviation(self, p: Floats) -> Deviation:
        """Read the geometry's parameters as deviations of the chain."""
        for effect, part in zip(self.effects, self.slices, strict=True):
            if isinstance(effect, Geometry):
                return effect.deviation(p[part])
        return NOMINAL

    @property
    def placing(self) -> list[Geometry]:
        """List the effects that deviate the chain itself: one at most, of one model."""
        return [e for e in self.effects if isinstance(e, Geometry)]

    def at(self, batch: ArmStates, p: Floats) -> ArmStates:
        """Return the batch with its kinematics taken at parameters p."""
        return batch.move(self.deviation(p), self.shift(batch, p))

    def error(self, batch: ArmStates, p: Floats) -> Floats:
        """Sum the errors: actual minus nominal TCP position, (n, 3) [m].

        Args:
            batch: States with nominal kinematics.
            p: All parameters, (p,).
        """
        return self.error_at(self.at(batch, p), batch, p)

    def error_at(self, at: ArmStates, batch: ArmStates, p: Floats) -> Floats:
        """Sum the errors where the kinematics at parameters p are known already."""
        error: Floats = at.tcp - batch.tcp
        for effect, part in zip(self.effects, self.slices, strict=True):
            if not isinstance(effect, Geometry | JointEffect):
                error = error + effect.displacement(batch, p[part])
        return error

    @cached_property
    def _kinds(self) -> dict[str, tuple[Combination, NDArray[np.int64]]]:
        """Group effects of one name, with the columns of their parameters."""
        columns = np.arange(len(self.parameters))
        kinds = {}
        for name in dict.fromkeys(e.name for e in self.effects):
            parts = zip(self.effects, self.slices, strict=True)
            own = [(e, columns[part]) for e, part in parts if e.name == name]
            alone = Combination(tuple(e for e, _ in own))
            kinds[name] = (alone, np.concatenate([c for _, c in own]))
        return kinds

    @cached_property
    def free(self) -> tuple[Combination, NDArray[np.int64]]:
        """Take the free forms, with the columns of their parameters."""
        kinds = [kind for kind in self._kinds.values() if kind[0].effects[0].free]
        effects = tuple(e for alone, _ in kinds for e in alone.effects)
        none = np.zeros(0, dtype=np.int64)
        return Combination(effects), np.concatenate([none, *(c for _, c in kinds)])

    @property
    def share_names(self) -> tuple[str, ...]:
        """Names of the k shares of the error; of several, the last is the rest."""
        names = tuple(self._kinds)
        return (*names, INTERACTION) if len(names) > 1 else names

    def shares(self, batch: ArmStates, p: Floats) -> Floats:
        """Split the error into the shares of the effects, (n, k, 3) [m], base frame.

        The share of an effect is the error that the arm would have with this effect
        alone, all others away, through the full kinematics:

            share_k = error(p_k),  interaction = error(p) - sum_k share_k

        Effects of one name, such as several curves, have one share. The interaction is
        what effects do only together: a joint error turns the arm as the geometry has
        built it. It is a product of two errors, micrometres where they are
        millimetres; so the shares sum to the error exactly, and leaving an effect out
        changes the error by its share but for that.

        Args:
            batch: n states with nominal kinematics.
            p: All parameters, (p,).
        """
        alone, shift = [], np.zeros((len(batch), 6))
        interaction = -batch.tcp
        for kind, own in self._kinds.values():
            turned = kind.shift(batch, p[own])
            at = batch.move(kind.deviation(p[own]), turned)
            alone.append(kind.error_at(at, batch, p[own]))
            shift = shift + turned
            interaction = interaction - (at.tcp - batch.tcp)
        if len(alone) > 1:
            all_ = batch.move(self.deviation(p), shift)
            alone.append(interaction + all_.tcp)
        return np.stack(alone, axis=1) if alone else np.zeros((len(batch), 0, 3))

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the error at the batch's kinematics, (n, 3, p)."""
        if not self.effects:
            return np.zeros((len(batch), 3, 0))
        return np.concatenate([e.columns(batch) for e in self.effects], axis=2)

    def turn(self, batch: ArmStates, p: Floats) -> Floats:
        """Turn the tool: its rotation from nominal to actual, (n, 3) [rad]."""
        at = self.at(batch, p).walk.flange
        turn = rotation_vector(at @ np.swapaxes(batch.walk.flange, 1, 2))
        for effect, part in zip(self.effects, self.slices, strict=True):
            if isinstance(effect, Geometry | JointEffect):
                continue
            if (columns := effect.rotation_columns(batch)) is not None:
                turn = turn + columns @ p[part]
        return turn

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation at the batch's kinematics, (n, 3, p)."""
        out = np.zeros((len(batch), 3, len(self.parameters)))
        for effect, part in zip(self.effects, self.slices, strict=True):
            columns = effect.rotation_columns(batch)
            if columns is not None:
                out[:, :, part] = columns
        return out

    def direction_slopes(self, batch: ArmStates, p: Floats) -> Floats:
        """Give each joint's position error per unit of direction, (n, 3, 6) [m]."""
        ones = np.ones_like(batch.states.q)
        forward = self.shift(batch.arriving(ones), p)
        backward = self.shift(batch.arriving(-ones), p)
        slopes: Floats = batch.jacobian * ((forward - backward) / 2)[:, None, :]
        for effect, part in zip(self.effects, self.slices, strict=True):
            own = effect.direction_slopes(batch, p[part])
            if own is not None:
                slopes = slopes + own
        return slopes
