"""Campaigns of joint targets for tests: who goes where, from which side."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.arm import VirtualArm
from postproc.virtual.arrivals import Arrivals, make_arrivals
from postproc.virtual.drawing import stream
from postproc.virtual.gears import at_start, move
from postproc.virtual.reference import (
    APPROACH,
    MEASURED_EVERY,
    PAYLOAD_COM,
    SPEEDS,
    log_uniform,
    working_angles,
)

START_TEMPERATURE = 22.0  # [deg C]
USUAL_APPROACH = np.radians(2.0)  # where a row says from which side, not from how far


def sample_survey(
    arm: VirtualArm,
    n: int,
    *,
    seed: int = 0,
    tool: Floats | None = None,
    payload: Floats | float = 0.0,
    payload_com: Floats | None = None,
) -> Arrivals:
    """Send an arm to n joint sets, each from a drawn side and distance.

    Args:
        arm: Who goes there; it warms up on the way.
        n: Number of rows.
        seed: Of the campaign, not of the arm.
        tool: TCP (3,), (n, 3) or poses [m]; default a probe off the flange axis.
        payload: [kg], one value or (n,).
        payload_com: (3,) or (n, 3) in the flange frame [m].
    """
    rng = stream(seed, "survey")
    q = working_angles(rng, n)
    side = rng.choice([-1.0, 1.0], (n, 6))
    way = log_uniform(rng, APPROACH, (n, 6))
    time = MEASURED_EVERY * np.arange(n) + rng.uniform(0.0, 2.0, n)
    return follow_rows(
        arm,
        q,
        side,
        way,
        tool=np.array([0.08, -0.04, 0.15]) if tool is None else tool,
        speed=rng.choice(SPEEDS, n),
        time=time,
        temperature=arm.temperature(time, START_TEMPERATURE),
        payload=payload,
        payload_com=PAYLOAD_COM if payload_com is None else payload_com,
    )


def follow_rows(
    arm: VirtualArm,
    q: Floats,
    side: Floats | None = None,
    way: Floats | float = USUAL_APPROACH,
    *,
    travel: Floats | None = None,
    tool: Floats | None = None,
    **covariates: Floats | float,
) -> Arrivals:
    """Visit joint targets one after the other with JOINT moves.

    Args:
        arm: Its gears tell the direction.
        q: Targets in visit order, (n, 6) [rad].
        side: From where each joint comes, (n, 6) in -1, 0, 1: the arm first drives to
            the approach pose q - side * way. None: straight from row to row. 0: the
            gear is left in the middle of its gap.
        way: Length of the approach, (n, 6) or one value [rad].
        travel: Recorded ways since the last reversal (n, 6) [rad], NaN where unknown;
            they replace the ways that follow from the motion.
        tool: As in `make_arrivals`.
        covariates: As in `make_arrivals`.
    """
    q = np.asarray(q, dtype=float)
    approach = q if side is None else q - side * way
    first = stream(arm.seed, "start").choice([-1.0, 1.0], 6)
    state = at_start(arm.gears, approach[0], first)
    states = []
    for stop in zip(approach, q, strict=True):
        state = move(arm.gears, state, np.array(stop))
        states.append(state)
    reached = np.array([s.side for s in states])
    ways = np.array([s.travel for s in states])
    if side is not None:
        reached = np.where(side == 0, 0.0, reached)
    if travel is not None:
        ways = np.where(np.isnan(travel), ways, travel)
    loop = np.array([s.loop for s in states])
    return make_arrivals(q, reached, tool, travel=ways, loop=loop, **covariates)
