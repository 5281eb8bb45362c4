"""What a residual may be due to: effects with grids of settings, and free curves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import covariate
from postproc.model.effects.backlash import Backlash
from postproc.model.effects.backlash_profile import BacklashProfile
from postproc.model.effects.base_shift import BaseShift
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.counterbalance import Counterbalance
from postproc.model.effects.coupling import Coupling
from postproc.model.effects.curve import Curve
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

# A candidate: one effect, with all its settings, that a residual may be due to.

NAMED, FREE = 0, 1


@dataclass(frozen=True)
class Family:
    """What a person calls one cause: candidates of a family differ in settings only.

    Attributes:
        effect: Name of the effect.
        joint: Joint 1 to 6 that it acts on, or None.
        driver: What drives it where that is part of the name (``joint 5`` of a
            coupling, the covariates of a curve), or None.
        tier: NAMED for physics, FREE for functions that may have any shape.
    """

    effect: str
    joint: int | None
    driver: str | None
    tier: int

    def __str__(self) -> str:
        where = "" if self.joint is None else f" of joint {self.joint}"
        by = "" if self.driver is None else f" by {self.driver}"
        return f"{self.effect}{where}{by}"


@dataclass(frozen=True)
class Candidate:
    """One effect to try.

    Attributes:
        family: Its family.
        effect: The effect with its settings.
        source: Covariate that reveals it, for the report.
        log_prior: Log of its share of the family: a grid shares what the family has.
    """

    family: Family
    effect: Effect
    source: str
    log_prior: float

    @cached_property
    def width(self) -> int:
        """Number of columns."""
        return len(self.effect.parameters())

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of its parameters in a model."""
        effect = self.effect
        return frozenset(f"{effect.name}.{p.name}" for p in effect.parameters())

    @property
    def in_time(self) -> bool:
        """Whether what drives it passes with time rather than from pose to pose."""
        return self.source in ("order", "time", "temperature")

    def driver(self, batch: Batch) -> Floats:
        """Return the covariate along which the candidate varies, (n,)."""
        name = "order" if self.in_time else self.source.split(" x ")[0]
        return np.nan_to_num(covariate(batch, name))


def shared(members: list[tuple[Effect, str]], family: Family) -> list[Candidate]:
    """Make the candidates of a family, each with an equal share of its prior."""
    share = -float(np.log(max(len(members), 1)))
    return [Candidate(family, effect, source, share) for effect, source in members]


# The named candidates: physics, with grids over what is not linear.

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


# The candidates without a name: smooth functions of anything, in any direction.

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
