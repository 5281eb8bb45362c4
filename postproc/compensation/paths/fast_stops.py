"""How far targets that fast JOINT moves reach are off if links run on there."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, any_in_rows
from postproc.compensation.paths.path_states import find_fast_stops
from postproc.model.flank_hypotheses import FlankKind, flanks_of
from postproc.model.model import Model
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.cell import Cell
from postproc.robot.pose import lengths
from postproc.robot.state import make_states


def predict_fast_stops(
    cycle: ProgramCycle, cell: Cell, model: Model, temperature: float
) -> Floats:
    """Predict how far targets are off if links run on there.

    They are corrected for links that their drives push. Braking has one cause in all
    joints: the largest deviation counts, of one that runs on, or of all that may.

    Args:
        cycle: The compensated program, n visits.
        cell: The arm, its play as wide as its gaps, and its payload.
        model: The arm's error.
        temperature: Of the arm [deg C], NaN where not known.

    Returns:
        (n,) [m]; 0 where no JOINT move arrives fast, or no hypothesis says so.
    """
    flanks = flanks_of(model, cell.arm)
    open_ = np.array([flank.is_open(FlankKind.RAN_ON) for flank in flanks])
    fast = find_fast_stops(cycle) & open_
    rows = np.flatnonzero(any_in_rows(fast) & ~any_in_rows(np.isnan(cycle.path.q)))
    out, side = np.zeros(len(cycle)), cycle.arrived.side[rows]

    def error(side: Floats) -> Floats:
        states = make_states(
            cycle.path.q[rows], side, cycle.targets.tool[rows, :3, 3],
            travel=cycle.arrived.travel[rows], temperature=temperature,
            payload=cell.payload_mass, payload_com=cell.payload_com,
        )  # fmt: skip
        return model.error(cell.arm, states)

    usual = error(side)
    for runs_on in (fast[rows], *(_alone(fast[rows], joint) for joint in range(6))):
        off = lengths(error(np.where(runs_on, -side, side)) - usual)
        out[rows] = np.maximum(out[rows], off)
    return out


def _alone(fast: Bools, joint: int) -> Bools:
    """Return the same of one joint (from 0) alone, (k, 6)."""
    return np.asarray(fast & (np.arange(6) == joint))
