"""The reference campaign: what sizes in millimetres refer to."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.simulation.state import VirtualArrivals, make_arrivals

# Angles between which each joint works in a usual campaign, (6, 2) [rad].
WORKING_RANGE = np.radians(
    [[-75, 75], [-40, 60], [-150, -40], [-160, 160], [-100, 100], [-160, 160]]
)
PROBE = np.array([0.1, 0.05, 0.2])  # [m] off the flange axis, so that joint 6 shows
# Where a tracker stands when nobody says so: to the right in front of the arm.
USUAL_TRACKER = np.array([4.0, -3.0, 1.5])  # [m] in the arm base frame
MEASURED_EVERY = 14.0  # [s] a tracker campaign's usual pace
ROWS = 400  # and length
DURATION = ROWS * MEASURED_EVERY  # [s]
APPROACH = np.radians([0.5, 30.0])  # ways since the last reversal
SPEEDS = np.array([0.05, 0.15, 0.4])  # [m/s]
PAYLOADS = np.array([0.0, 40.0, 120.0])  # [kg]
PAYLOAD_COM = np.array([0.0, 0.0, 0.2])  # [m]


def working_angles(
    rng: np.random.Generator, n: int, within: Floats = WORKING_RANGE
) -> Floats:
    """Draw joint sets (n, 6) [rad] by Latin hypercube.

    Args:
        rng: Draws.
        n: How many.
        within: Ends of every joint's range, (6, 2) [rad].
    """
    strata = rng.permuted(np.tile(np.arange(n), (6, 1)), axis=1).T
    unit = (strata + rng.random((n, 6))) / n
    low, high = within.T
    return np.asarray(low + unit * (high - low))


def log_uniform(
    rng: np.random.Generator, ends: Floats, shape: tuple[int, ...]
) -> Floats:
    """Draw numbers between two ends, evenly in their logarithm."""
    return np.asarray(np.exp(rng.uniform(np.log(ends[0]), np.log(ends[1]), size=shape)))


def reference_arrivals(rows: int, tool: Floats | None = None) -> VirtualArrivals:
    """Return one campaign, always the same, in which every covariate varies.

    Args:
        rows: How many rows its order counts to; nothing else depends on it, so that
            an arm stays the same arm in a short and in a long campaign.
        tool: TCP (3,) or pose (4, 4) [m].
    """
    rng = np.random.default_rng(220)
    return make_arrivals(
        working_angles(rng, ROWS),
        rng.choice([-1.0, 1.0], (ROWS, 6)),
        PROBE if tool is None else tool,
        travel=log_uniform(rng, APPROACH, (ROWS, 6)),
        loop=log_uniform(rng, APPROACH, (ROWS, 6)),
        speed=rng.choice(SPEEDS, ROWS),
        time=np.linspace(0.0, DURATION, ROWS),
        temperature=22.0 + 8.0 * np.linspace(0.0, 1.0, ROWS),
        payload=rng.choice(PAYLOADS, ROWS),
        payload_com=PAYLOAD_COM,
        order=np.linspace(0.0, rows - 1.0, ROWS),
    )
