"""How the arm arrives at every target, and which effect has which share in that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.solver.payload import payload_of
from postproc.compensation.solver.targets import few_frames
from postproc.language.visits import Visits
from postproc.model.model import CHUNK, Model
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.state import States, make_states


@dataclass(frozen=True)
class ArrivalStates:
    """The states that n visits are corrected for (structure of arrays).

    States and shares are evaluated when they are asked for.

    Attributes:
        visits: Tell the tools.
        q: Planned joint angles, (n, 6) [rad].
        side: Where every joint then lies in its play, (n, 6) from -1 to 1.
        travel: Of every joint since its last reversal, (n, 6) [rad].
        speed: Of the TCP, (n,) [m/s], NaN where nobody asked.
        temperature: [deg C], NaN where not known.
        cell: The arm and its payload.
        model: The arm's error.
    """

    visits: Visits
    q: Floats
    side: Floats
    travel: Floats
    speed: Floats
    temperature: float
    cell: Cell
    model: Model

    @cached_property
    def _tools(self) -> Floats:
        """TCP of every tool of the program in the flange frame, (m, 3) [m]."""
        return few_frames(self.visits)[:, :3, 3]

    def states(self, rows: Ints) -> States:
        """Describe some arrivals in the terms of the accuracy model."""
        mass, centre = payload_of(self.visits, self.cell, rows)
        return make_states(
            self.q[rows],
            self.side[rows],
            self._tools[self.visits.frame.tool[rows]],
            travel=self.travel[rows],
            speed=self.speed[rows],
            temperature=self.temperature,
            payload=mass,
            payload_com=centre,
            order=rows,
        )

    @property
    def effects(self) -> tuple[str, ...]:
        """Name the k shares: the compensated effects, and their interaction."""
        return self.model.share_names

    def shares(self, rows: Ints) -> Floats:
        """Split the predicted error at some visits, (r, k, 3) [m], base frame.

        That is the error that the visit is corrected for: at its planned joint angles,
        reached from where the corrected program reaches it. The correction is minus
        that (and what a taught frame is off), where there is one.

        Args:
            rows: Visits, ascending. Those beside them are looked at too, as far as an
                effect depends on the visit before.

        Returns:
            See `Combination.shares`; NaN where joint angles or the tool are not known.
        """
        return self._by_block(rows, self.model.shares, len(self.effects))

    @property
    def free_forms(self) -> tuple[str, ...]:
        """Name the effects without a law among those that have a share."""
        return self.model.free_forms

    def free(self, rows: Ints) -> Floats:
        """Return what free forms predict at some visits, and how surely, (r, 2, 3) [m].

        Args:
            rows: Visits, ascending, as for `shares`.

        Returns:
            Their part of the error and its standard error per axis, base frame; NaN
            where joint angles or the tool are not known.
        """

        def both(arm: Arm, states: States) -> Floats:
            part = self.model.free_part(arm, states)
            return np.stack([part.error, part.std], axis=1)

        return self._by_block(rows, both, 2)

    def _by_block(
        self, rows: Ints, evaluate: Callable[[Arm, States], Floats], k: int
    ) -> Floats:
        """Evaluate k vectors at some visits, together with those beside them.

        Args:
            rows: Visits, ascending.
            evaluate: Arm and n states -> (n, k, 3) [m].
            k: How many they are.
        """
        out = np.full((len(rows), k, 3), np.nan)
        for block in np.unique(rows // CHUNK).tolist():
            first, end = np.searchsorted(rows, [block * CHUNK, (block + 1) * CHUNK])
            end_of_block = min((block + 1) * CHUNK, len(self.visits))
            states = self.states(np.arange(block * CHUNK, end_of_block))
            told = np.concatenate([states.q, states.tool], axis=1)
            known = np.flatnonzero(np.isfinite(told).all(axis=1))
            whole = np.full((len(states), k, 3), np.nan)
            whole[known] = evaluate(self.cell.arm, states[known])
            out[first:end] = whole[rows[first:end] - block * CHUNK]
        return out

    def sizes(self, rows: Ints) -> Floats:
        """Return the size of every share at some visits, ascending, (r, k) [m]."""
        return np.asarray(np.linalg.norm(self.shares(rows), axis=2))
