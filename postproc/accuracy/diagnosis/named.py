"""The named candidates: physics, with grids over what is not linear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.accuracy.diagnosis.candidate import NAMED, Candidate, Family, shared
from postproc.arrays import Floats
from postproc.model.effects.backlash import Backlash
from postproc.model.effects.backlash_profile import BacklashProfile
from postproc.model.effects.base_shift import BaseShift
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.counterbalance import Counterbalance
from postproc.model.effects.coupling import Coupling
from postproc.model.effects.effect import Effect
from postproc.model.effects.joint_map import JointMap
from postproc.model.effects.lag import Lag
from postproc.model.effects.load_backlash import LoadBacklash
from postproc.model.effects.payload import Payload
from postproc.model.effects.scale import Scale
from postproc.model.effects.thermal import Thermal, growing
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.effects.tracker_drift import TrackerDrift
from postproc.model.effects.transmission import Transmission
from postproc.model.effects.windup import Windup
from postproc.model.kinematics import Batch

JOINTS = (1, 2, 3, 4, 5, 6)
CARRYING = 0.02  # of the largest torque: a joint that carries less cannot yield
FIRST_FREE, LAST_FREE = 3.0, 60.0  # orders of a gear's teeth
STEPS = 48  # moments at which a step is tried
PAIRS = (*Coupling().pairs, (2, 3), (4, 5), (4, 6), (5, 6))  # receiving, driving
EDGE = 10  # rows before and after a step that must show it
LONGEST_WINDUP = float(np.radians(8.0))  # what fades more slowly is no wind-up
WINDUPS = tuple(np.radians([0.5, 1.0, 2.0, 4.0, 7.0]))
SPOTS = tuple(np.radians([3.0, 6.0, 12.0]))
WARM_UPS = (0.1, 0.2, 0.4, 0.8)  # of the campaign's length
FLANKS = (0.1, 0.3, 0.8)  # of the usual torque
STRAIGHT = 3.0  # of it: the law is nearly proportional
SPRINGS = tuple(
    (ratio, float(np.radians(upright)), preload)
    for ratio in (0.25, 0.4, 0.6)
    for upright in (-12.0, -6.0, 0.0, 6.0, 12.0)
    for preload in (0.05, 0.3)
)


def named_candidates(batch: Batch) -> list[Candidate]:
    """List everything with a name that the recorded covariates can show."""
    return [
        *_loads(batch),
        *_angles(batch),
        *_directions(batch),
        *_spots(batch),
        *_moments(batch),
        *_warmth(batch),
    ]


def known(values: Floats) -> bool:
    """Tell whether a covariate was recorded and varies."""
    return bool(
        not np.isnan(values).any()
        and len(values) > 1
        and np.ptp(values) > 1e-9 * max(1.0, float(np.abs(values).max()))
    )


def carrying(batch: Batch) -> tuple[int, ...]:
    """List the joints that carry weight worth the name."""
    torque = np.abs(batch.loads.gravity + batch.loads.payload).max(axis=0)
    enough = torque > CARRYING * float(torque.max(initial=0.0))
    return tuple(int(j) + 1 for j in np.flatnonzero(enough & (torque > 0)))


def _single(
    name: str, joint: int | None, members: list[tuple[Effect, str]]
) -> list[Candidate]:
    return shared(members, Family(name, joint, None, NAMED))


def _loads(batch: Batch) -> list[Candidate]:
    """Compliance, payload, load-dependent backlash, the balancing spring."""
    carried = known(batch.states.payload)
    some = bool(np.nan_to_num(batch.states.payload).any())
    typical = np.median(np.abs(batch.loads.gravity + batch.loads.payload), axis=0)
    out = []
    for j in carrying(batch):
        source = f"torque {j}"
        yields = Compliance.on(batch.arm, (j,), some)
        out += _single("compliance", j, [(yields, source)])
        if carried:
            out += _single("payload", j, [(Payload((j,)), "payload")])
        t0 = max(float(typical[j - 1]), 1e-3)
        laws = [LoadBacklash((j,), "load", t0)]
        laws += [LoadBacklash((j,), "gravity_side", k * t0) for k in FLANKS]
        laws += [LoadBacklash((j,), "signed", k * t0) for k in (*FLANKS, STRAIGHT)]
        out += _single("load_backlash", j, [(law, source) for law in laws])
    springs = [(Counterbalance(*spring), "joint 2") for spring in SPRINGS]
    return out + _single("counterbalance", 2, list(springs))


def orders(batch: Batch, joint: int) -> Floats:
    """Give the free orders to try: steps of half of what the range resolves."""
    covered = max(float(np.ptp(batch.states.q[:, joint - 1])), 0.1)
    return np.arange(FIRST_FREE, LAST_FREE, max(np.pi / covered, 0.25))


def _angles(batch: Batch) -> list[Candidate]:
    """Transmission error, scale, coupling."""
    out = []
    for j in JOINTS:
        source = f"joint {j}"
        free = orders(batch, j)
        low = [Transmission(((j, k),)) for k in (1.0, 2.0)]
        high = [Transmission(((j, float(k)),)) for k in free]
        family = Family("transmission", j, None, NAMED)
        half = float(np.log(0.5))
        for members in (low, high):
            share = half - float(np.log(len(members)))
            out += [Candidate(family, e, source, share) for e in members]
        out += _single("scale", j, [(Scale((j,)), source)])
    for pair in PAIRS:
        driver = f"joint {pair[1]}"
        family = Family("coupling", pair[0], driver, NAMED)
        out += shared([(Coupling((pair,)), driver)], family)
    return out


def _directions(batch: Batch) -> list[Candidate]:
    """Backlash, wind-up and lag: odd in the direction."""
    out = []
    profile = BacklashProfile.propose(batch.arm, batch.states)
    moves = known(batch.states.speed)
    for j in JOINTS:
        out += _single("backlash", j, [(Backlash((j,)), f"lambda {j}")])
        varying = replace(profile, joints=(j,))
        out += _single("backlash_profile", j, [(varying, f"joint {j}")])
        if known(batch.states.travel[:, j - 1]):
            members = [(Windup((j,), float(d0)), f"travel {j}") for d0 in WINDUPS]
            out += _single("windup", j, list(members))
        if moves:
            out += _single("lag", j, [(Lag((j,)), "speed")])
    return out


def _spots(batch: Batch) -> list[Candidate]:
    """Worn spots: single bumps of a joint map."""
    out = []
    for j in JOINTS:
        q = batch.states.q[:, j - 1]
        members: list[tuple[Effect, str]] = [
            (JointMap(((j, float(c)),), float(w)), f"joint {j}")
            for w in SPOTS
            for c in np.arange(q.min(), q.max() + w, w)
        ]
        out += _single("joint_map", j, members)
    return out


def _moments(batch: Batch) -> list[Candidate]:
    """Steps of the base or the tool, slow motion of the tracker."""
    order = np.sort(batch.states.order)
    if len(order) < 3 * EDGE:
        return []
    several = len(np.unique(batch.states.tool.round(6), axis=0)) > 1
    rows = order[np.unique(np.linspace(EDGE, len(order) - EDGE, STEPS).astype(int))]
    base = [(BaseShift(float(r)), "order") for r in rows]
    tool = [(ToolShift(float(r), several), "order") for r in rows]
    drift = TrackerDrift.propose(batch.arm, batch.states)
    return [
        *_single("base_shift", None, list(base)),
        *_single("tool_shift", None, list(tool)),
        *_single("tracker_drift", None, [(drift, drift.clock)]),
    ]


def _warmth(batch: Batch) -> list[Candidate]:
    """Growth with the recorded temperature, or along a warm-up."""
    lengths = growing(batch.arm)
    members: list[tuple[Effect, str]] = []
    if known(batch.states.temperature):
        middle = float(np.mean(batch.states.temperature))
        members.append((Thermal(lengths, reference=middle), "temperature"))
    if known(batch.states.time):
        span = float(np.ptp(batch.states.time))
        cold = Thermal(lengths, form="time", start=float(batch.states.time.min()))
        members += [(replace(cold, time_constant=k * span), "time") for k in WARM_UPS]
    return _single("thermal", None, members) if members else []
