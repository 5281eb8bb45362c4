"""How the arm arrives at every target, and which effect has which share in that."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.targets import few_frames
from postproc.language.visits import Visits
from postproc.model.model import CHUNK, Model
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
        return make_states(
            self.q[rows],
            self.side[rows],
            self._tools[self.visits.tool[rows]],
            travel=self.travel[rows],
            speed=self.speed[rows],
            temperature=self.temperature,
            payload=self.cell.payload_mass,
            payload_com=self.cell.payload_com,
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
        out = np.full((len(rows), len(self.effects), 3), np.nan)
        for block in np.unique(rows // CHUNK).tolist():
            first, end = np.searchsorted(rows, [block * CHUNK, (block + 1) * CHUNK])
            end_of_block = min((block + 1) * CHUNK, len(self.visits))
            whole = np.arange(block * CHUNK, end_of_block)
            out[first:end] = self._of_block(whole)[rows[first:end] - whole[0]]
        return out

    def _of_block(self, rows: Ints) -> Floats:
        """Split the error at all visits of a block, (r, k, 3) [m]."""
        states = self.states(rows)
        told = np.concatenate([states.q, states.tool], axis=1)
        known = np.flatnonzero(np.isfinite(told).all(axis=1))
        out = np.full((len(rows), len(self.effects), 3), np.nan)
        out[known] = self.model.shares(self.cell.arm, states[known])
        return out

    def sizes(self, rows: Ints) -> Floats:
        """Return the size of every share at some visits, ascending, (r, k) [m]."""
        return np.asarray(np.linalg.norm(self.shares(rows), axis=2))
