"""The candidates without a name: smooth functions of anything, in any direction."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from postproc.accuracy.diagnosis.candidate import FREE, Candidate, Family, shared
from postproc.accuracy.diagnosis.named import JOINTS, carrying, known
from postproc.model.covariate import covariate
from postproc.model.effects.curve import Curve
from postproc.model.effects.effect import Effect
from postproc.model.effects.joint_map import JointMap
from postproc.model.kinematics import Batch

KNOTS = (12, 24, 48)  # bumps of a joint's map
ROWS_PER_KNOT = 12
PASSING = ("speed", "payload", "temperature", "time", "order")
FRAMES = tuple(f"{frame} {axis}" for frame in ("base", "tool") for axis in "xyz")


def free_candidates(batch: Batch) -> list[Candidate]:
    """List joint maps, and curves over every covariate and every pair of joints."""
    passing = [name for name in PASSING if known(covariate(batch, name))]
    if "time" in passing and "order" in passing:
        passing.remove("order")  # they tell the same
    loaded = carrying(batch)
    out = []
    for j in JOINTS:
        out += _maps(batch, j)
        alone = [f"joint {k}" for k in JOINTS if k != j]
        alone += [*passing, *(f"torque {k}" for k in loaded)]
        out += [_curve(batch, f"joint {j}", (name,)) for name in alone]
        with_side = ["speed"] if "speed" in passing else []
        with_side += [f"torque {k}" for k in loaded if k == j]
        if known(covariate(batch, f"travel {j}")):
            with_side.append(f"travel {j}")
            out.append(_memory(batch, j))
        with_side += [f"joint {k}" for k in JOINTS if k != j]
        out += [_curve(batch, f"joint {j}", (name,), True) for name in with_side]
        if np.ptp(batch.states.direction[:, j - 1]) > 0:
            name = (f"before {j}",)
            out += [_curve(batch, f"joint {j}", name, side) for side in (False, True)]
        pairs = combinations([f"joint {k}" for k in JOINTS], 2)
        out += [_curve(batch, f"joint {j}", pair) for pair in pairs]
    for axis in FRAMES:
        names = [*passing, *(f"joint {k}" for k in JOINTS)]
        out += [_curve(batch, axis, (name,)) for name in names]
    return out


def _memory(batch: Batch, joint: int) -> Candidate:
    """Whatever depends on the last two reversals of a joint."""
    source = (f"travel {joint}", f"loop {joint}")
    return _curve(batch, f"joint {joint}", source, signed=True, whole=True)


def _maps(batch: Batch, joint: int) -> list[Candidate]:
    """Smooth maps of one joint's own angle."""
    q = batch.states.q[:, joint - 1]
    members: list[tuple[Effect, str]] = [
        (JointMap.over(joint, float(q.min()), float(q.max()), k), f"joint {joint}")
        for k in KNOTS
        if k == KNOTS[0] or ROWS_PER_KNOT * k <= len(q)
    ]
    return shared(members, Family("joint_map", joint, None, FREE))


def _curve(
    batch: Batch,
    direction: str,
    source: tuple[str, ...],
    signed: bool = False,
    whole: bool = False,
) -> Candidate:
    """Make the curve of some covariates in one direction."""
    values = [covariate(batch, name) for name in source]
    lower = tuple(float(np.nanmin(v)) for v in values)
    upper = tuple(float(np.nanmax(v)) for v in values)
    effect = Curve(direction, source, lower, upper, signed, whole)
    kind, _, which = direction.partition(" ")
    joint = int(which) if kind == "joint" else None
    driver = " x ".join(source)
    label = f"lambda x {driver}" if signed else driver
    where = label if joint else f"{label} along {direction}"
    return Candidate(Family("curve", joint, where, FREE), effect, driver, 0.0)
