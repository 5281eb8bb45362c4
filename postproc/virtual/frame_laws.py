"""Laws that move more than a joint: heat, foundations, tool holders, the tracker."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.arrivals import REST_TEMPERATURE, Arrivals
from postproc.virtual.law import Draw, Law, Where
from postproc.virtual.reference import DURATION

STEEL = 12e-6  # [1/K] linear expansion


def thermal(draw: Draw) -> Law:
    """Every link grows with the temperature, cast iron and aluminium mixed."""
    expansion = STEEL * draw.rng.uniform(0.8, 1.6, 6)

    def shape(arrivals: Arrivals) -> Floats:
        return np.outer(arrivals.temperature - REST_TEMPERATURE, expansion)

    parameters = {f"alpha_{j + 1}": float(expansion[j]) for j in range(6)}
    return Law("thermal", Where.LENGTHS, (), 0, parameters, shape)


def warmup(draw: Draw) -> Law:
    """Motors heat the links from inside, unseen by any thermometer."""
    expansion = STEEL * draw.rng.uniform(0.8, 1.6, 6)
    constant = DURATION * draw.rng.uniform(0.15, 0.5)

    def shape(arrivals: Arrivals) -> Floats:
        return np.outer(1 - np.exp(-arrivals.time / constant), expansion)

    return Law("thermal", Where.LENGTHS, (), 0, {"time_constant": constant}, shape)


def base_shift(draw: Draw) -> Law:
    """The foundation gives way once: a step of the base at one moment."""
    return _step(draw, "base_shift", Where.BASE)


def tool_shift(draw: Draw) -> Law:
    """The tool slips in its holder once, or a nest is moved."""
    return _step(draw, "tool_shift", Where.TOOL)


def _step(draw: Draw, name: str, where: Where) -> Law:
    row = int(np.ceil(draw.rows * draw.rng.uniform(0.2, 0.8)))
    shift = draw.rng.normal(size=3)
    turn = draw.rng.normal(size=3) * 0.3  # [rad / m]: a third of a mrad for a mm
    twist = np.concatenate([shift, turn])

    def shape(arrivals: Arrivals) -> Floats:
        return np.outer(arrivals.order >= row, twist)

    return Law(name, where, (), 0, {"row": float(row)}, shape)


def tracker_drift(draw: Draw) -> Law:
    """The tracker's stand moves slowly while it measures; the arm does not."""
    ends = draw.rng.normal(size=(2, 6)) * np.repeat([1.0, 0.3], 3)
    phase = draw.phase()

    def shape(arrivals: Arrivals) -> Floats:
        progress = arrivals.time / DURATION
        swing = np.sin(np.pi * progress + phase) - np.sin(phase)
        return np.outer(progress, ends[0]) + 0.5 * np.outer(swing, ends[1])

    return Law("tracker_drift", Where.TRACKER, (), 0, {"phase": phase}, shape)
