"""What the arm carries at every visit, and how well the model knows it there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.visits import Visits
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.model.validity import name_range
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.robot.state import States

LOADED = frozenset(["payload", "compliance"])  # effects of what the arm carries
MARGIN = 0.5  # [kg] beyond the surveyed loads that counts as surveyed
SHARE = 0.1  # .. of the load itself
USUAL_SOFTNESS = 1e-7  # [rad/(N m)] of the gears of a large arm


def payload_of(
    visits: Visits, cell: Cell, rows: Ints | slice = slice(None)
) -> tuple[Floats, Floats]:
    """Return what the arm carries at some visits: what the program states, or the cell.

    Args:
        visits: k visits.
        cell: Its payload holds where the program states none.
        rows: Those that are asked for.

    Returns:
        Mass (n,) [kg] and centre of mass in the flange frame (n, 3) [m].
    """
    stated = visits.motion.loads[visits.motion.load[rows]]
    mass = np.where(np.isnan(stated[:, 0]), cell.payload_mass, stated[:, 0])
    centre = np.where(np.isnan(stated[:, 1:]), cell.payload_com, stated[:, 1:])
    return mass, centre


def range_of_loads(model: Model, cell: Cell) -> tuple[float, float]:
    """Return the least and the largest load that is surveyed [kg], NaN if unknown."""
    return model.ranges.payload or (cell.payload_mass, cell.payload_mass)


def beyond_survey(model: Model, cell: Cell, states: States) -> Bools:
    """Return where the load lies outside of what was surveyed, (n,)."""
    low, high = range_of_loads(model, cell)
    load = np.broadcast_to(states.payload, (len(states),))
    margin = np.maximum(MARGIN, SHARE * load)
    found: Bools = (load < low - margin) | (load > high + margin)
    return found


def with_surveyed_load(model: Model, cell: Cell, states: States) -> States:
    """Return states whose loads are the nearest that were surveyed."""
    low, high = range_of_loads(model, cell)
    near = np.clip(states.payload, low, high)
    return replace(states, payload=np.where(np.isnan(near), states.payload, near))


def load_error(model: Model, cell: Cell, states: States) -> Floats:
    """Return the standard error that a load beyond the survey adds, (n, 3) [m].

    It is what the standard error of the model grows by where payload or compliance
    are in it. Where none is, the joints yield by what is usual for large arms.

    Args:
        model: The arm's error.
        cell: The arm.
        states: n states.
    """
    out = np.zeros((len(states), 3))
    rows = np.flatnonzero(beyond_survey(model, cell, states))
    if len(rows):
        here = states[rows]
        near = with_surveyed_load(model, cell, here)
        if LOADED & {effect.name for effect in model.effects.effects}:
            grown = model.std_error(cell.arm, here) ** 2
            grown -= model.std_error(cell.arm, near) ** 2
            out[rows] = np.sqrt(np.maximum(grown, 0.0))
        else:
            # How far soft joints may yield to a change of the load, (n, 3) [m].
            batch = ArmStates(cell.arm, here)
            torque = batch.loads.payload - ArmStates(cell.arm, near).loads.payload
            moved = batch.jacobian * (USUAL_SOFTNESS * torque)[:, None, :]
            out[rows] = np.asarray(np.linalg.norm(moved, axis=2))
    return out


def load_reasons(model: Model, cell: Cell, states: States) -> dict[str, Bools]:
    """Return which states the cell rejects for their load, (n,), by reason."""
    most = cell.limits.payload_mm
    error = np.linalg.norm(load_error(model, cell, states), axis=1) / MM
    if "payload" in model.bent:
        error[beyond_survey(model, cell, states)] = np.inf
    low, high = range_of_loads(model, cell)
    text = (
        f"the load is outside the surveyed {name_range(low, high)} kg and adds more "
        f"than {most:g} mm to the standard error. Survey with such a load, or "
        "allow more (payload_mm under [limits] of the cell)"
    )
    return {text: error > most}
