"""The virtual arm: where the tool really goes, and what a laser tracker reads there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.simulation.kinematics import (
    GRAVITY,
    Chain,
    LinkMasses,
    small_motion,
    total_torque,
)
from postproc.simulation.laws import Law, Where, total
from postproc.simulation.state import LONG_TRAVEL, VirtualArrivals

# The arm as it was really built: numbers of the chain that differ from the drawing.


@dataclass(frozen=True)
class AsBuilt:
    """Geometry of one arm.

    Attributes:
        chain: The chain with its D-H errors.
        base: Twist of the arm on its foundation, (6,) [m, rad].
        mount: Twist of the mounting plate on the flange, (6,) [m, rad]. It belongs to
            the arm: every tool that is put on stands on the same plate.
    """

    chain: Chain
    base: Floats
    mount: Floats


def draw_as_built(
    rng: np.random.Generator, nominal: Chain, geometry: bool, tool: bool
) -> AsBuilt:
    """Draw the errors of one arm.

    Lengths are off by 0.1 to 0.6 mm, angles by 0.1 to 0.6 mrad, the mounting plate by
    0.3 to 1 mm along each axis: 1 to 3 mm at the TCP, as arms come from the factory.

    Args:
        rng: Random numbers of the geometry alone.
        nominal: The arm of the drawing.
        geometry: Whether the chain and the base are off.
        tool: Whether the mounting plate is off.
    """
    length, angle = _off(rng, 0.1e-3, 0.6e-3, (2, 6)), _off(rng, 1e-4, 6e-4, (2, 6))
    beta = np.zeros(6)
    beta[1] = _off(rng, 1e-4, 6e-4, ())  # axes 2 and 3 should be parallel
    base = _twist(rng, (0.1e-3, 0.4e-3), (0.5e-4, 2e-4))
    mount = _twist(rng, (0.3e-3, 1e-3), (2e-4, 6e-4))
    if not geometry:
        length, angle, beta, base = 0 * length, 0 * angle, 0 * beta, 0 * base
    chain = replace(
        nominal,
        a=nominal.a + length[0],
        d=nominal.d + length[1],
        alpha=nominal.alpha + angle[0],
        offset=nominal.offset + angle[1],
        beta=nominal.beta + beta,
    )
    return AsBuilt(chain, base, mount if tool else 0 * mount)


def draw_body(
    rng: np.random.Generator, chain: Chain, gravity: Floats = GRAVITY
) -> LinkMasses:
    """Draw the weights of one arm: 10 % and 20 mm off the estimates.

    Args:
        rng: Random numbers of the weights alone.
        chain: The arm of the drawing.
        gravity: Acceleration of gravity in the arm base, (3,) [m/s^2].
    """
    mass = chain.mass * rng.uniform(0.9, 1.1, 6)
    centre = chain.centre + rng.uniform(-0.02, 0.02, (6, 3))
    return LinkMasses(chain, mass, centre, gravity)


def _off(
    rng: np.random.Generator, low: float, high: float, shape: tuple[int, ...]
) -> Floats:
    """Draw sizes between low and high with either sign."""
    size = rng.uniform(low, high, shape)
    return np.asarray(size * rng.choice([-1.0, 1.0], shape))


def _twist(
    rng: np.random.Generator, shift: tuple[float, float], turn: tuple[float, float]
) -> Floats:
    return np.concatenate([_off(rng, *shift, (3,)), _off(rng, *turn, (3,))])


# The gap in every gear, followed along the motion.
#
# A gear with a gap of 2 g [rad] moves its link only when a flank touches: its place in
# the gap is s = clip(s + dq / g, -1, 1). A joint that stands keeps its flank. The side
# s is thus a physical state, not a sign computed from two targets. A gap that changes
# with the joint angle is as wide for the motor that crosses it as for the link.
#
# Three other kinds of gear are drawn from the same numbers. An elastic one gives way
# before its flank carries all of the load: it goes from flank to flank over ELASTIC
# times the gap, along half a sine. One that gravity preloads lies on the flank that the
# weight of what it carries pushes it to, wherever that is more than its friction holds.
# One that is switched by inertia runs on to the other flank when the arm brakes from
# more than a speed of that joint, and stays there.

STILL = 1e-12  # [rad] below the rounding of the inverse kinematics
ELASTIC = 4.0  # way of an elastic flank from side to side, in gaps
BRAKES = 0.1  # [s] before it stands an arm brakes


class GearKind(Enum):
    """What a gear with a gap does between its flanks."""

    SHARP = "sharp"
    ELASTIC = "elastic"
    GRAVITY = "gravity"
    INERTIA = "inertia"


MIXED = "mixed"  # of every gear one of these kinds is drawn
WIDE = 1.5, 4.0  # [gaps] widths of elastic flanks that are drawn then
ALL_SHARP = (GearKind.SHARP,) * 6


def draw_kinds(
    rng: np.random.Generator, name: str
) -> tuple[tuple[GearKind, ...], Floats, Floats]:
    """Draw the kinds of six gears.

    Args:
        rng: Random numbers of the gears alone.
        name: The kind of all, or `MIXED`.

    Returns:
        The kinds; the gaps over which elastic flanks go; how much of half a sine they
        go along, the rest of it evenly, (6,) each.
    """
    if name != MIXED:
        return (GearKind(name),) * 6, np.full(6, ELASTIC), np.ones(6)
    kinds = tuple(GearKind(str(kind)) for kind in rng.choice(list(_NAMES), 6))
    low, high = np.log(WIDE)
    return kinds, np.exp(rng.uniform(low, high, 6)), rng.uniform(0.0, 1.0, 6)


_NAMES = tuple(kind.value for kind in GearKind)


def even(q: Floats) -> Floats:
    """Leave gaps as wide at all joint angles, (n, 6)."""
    return np.ones_like(q)


@dataclass(frozen=True)
class Gears:
    """The gears of an arm.

    Attributes:
        gap: Half the gap of every gear, (6,) [rad] on the joint side.
        coupling: (6, 6), motor-side angles = coupling @ joint angles.
        kinds: What each of the six does in its gap.
        reach: Gaps over which each goes from flank to flank if it is elastic, (6,).
        bends: How much of half a sine an elastic flank goes along, (6,) from 0 to 1.
        body: The weights that preload them.
        friction: Torque about every joint that holds a link between the flanks, (6,)
            [N m].
        runs_on: Speed of every motor from which inertia changes the flank as the arm
            brakes, (6,) [rad/s] on the joint side.
        wave: How wide the gaps are at joint angles (n, 6) [rad] beside `gap`, (n, 6).
    """

    gap: Floats
    coupling: Floats
    kinds: tuple[GearKind, ...] = ALL_SHARP
    reach: Floats = field(default_factory=lambda: np.full(6, ELASTIC))
    bends: Floats = field(default_factory=lambda: np.ones(6))
    body: LinkMasses | None = None
    friction: Floats = field(default_factory=lambda: np.full(6, np.inf))
    runs_on: Floats = field(default_factory=lambda: np.full(6, np.inf))
    wave: Callable[[Floats], Floats] = even

    def half_gaps(self, angles: Floats) -> Floats:
        """Return half the gaps at angles of the motors (n, 6), (n, 6) [rad]."""
        q: Floats = np.linalg.solve(self.coupling, angles.T).T.astype(float)
        return np.asarray(self.gap * self.wave(q))

    def show_sides(self, arrivals: VirtualArrivals) -> Floats:
        """Return the sides that the links show, (n, 6) from -1 to 1."""
        sides = arrivals.flank
        if (elastic := self.are(GearKind.ELASTIC)).any():
            bent = np.sin(np.pi / 2 * sides)
            sides = np.where(elastic, sides + self.bends * (bent - sides), sides)
        if (heavy := self.are(GearKind.GRAVITY)).any() and self.body is not None:
            torque = total_torque(
                self.body, arrivals.q, arrivals.payload, arrivals.payload_com
            )
            pushed = np.abs(torque) > self.friction  # forward: ahead of its motor
            sides = np.where(heavy & pushed, -np.sign(torque), sides)
        return np.asarray(sides)

    def are(self, kind: GearKind) -> Bools:
        """Return which gears are of a kind, (6,)."""
        return np.array([own is kind for own in self.kinds])

    def brake(self, state: GearState, rate: Floats) -> GearState:
        """Return the state behind braking from joint speeds (6,) [rad/s]."""
        speed = self.coupling @ rate
        on = self.are(GearKind.INERTIA) & (np.abs(speed) > self.runs_on)
        flank = np.where(on, -np.sign(speed), state.flank)
        return replace(state, flank=flank)


@dataclass(frozen=True)
class GearState:
    """Where the gears are, (6,), or at m places one after the other, (m, 6) each.

    Attributes:
        angle: Present angle on the motor side [rad], as all angles here.
        side: Place in a sharp gap by the way alone, -1 .. 1.
        flank: Place in the gap, -1 .. 1.
        heading: Direction of the last motion that was more than the gap, +1 or -1.
        extreme: Furthest angle reached since the last reversal.
        turn: Where the last reversal was.
        turn_before: Where the reversal before it was.
    """

    angle: Floats
    side: Floats
    flank: Floats
    heading: Floats
    extreme: Floats
    turn: Floats
    turn_before: Floats

    @property
    def travel(self) -> Floats:
        """Way since the last reversal [rad]."""
        return np.abs(self.angle - self.turn)

    @property
    def loop(self) -> Floats:
        """Way between the last two reversals [rad]."""
        return np.abs(self.turn - self.turn_before)

    def at(self, k: int) -> GearState:
        """Return the state at one of the places."""
        return GearState(*(column[k] for column in vars(self).values()))


def at_start(gears: Gears, q: Floats, side: Floats) -> GearState:
    """Return the state of an arm that stands at q (6,) with the given sides (6,)."""
    angle = gears.coupling @ q
    turn = angle - side * LONG_TRAVEL
    return GearState(angle, side, side, side, angle, turn, turn + side * LONG_TRAVEL)


def move(gears: Gears, state: GearState, path: Floats) -> GearState:
    """Follow a joint path; return the state at its end.

    Args:
        gears: Gaps and coupling.
        state: The state before.
        path: Joint angles, (m, 6) [rad]; between two of them every joint moves one way.
    """
    angles = np.vstack([state.angle, path @ gears.coupling.T])
    return _steps(gears, state, turning_points(angles)).at(-1)


def follow(gears: Gears, state: GearState, path: Floats) -> GearState:
    """Follow a joint path (m, 6) as `move` does; return the states before and on it."""
    return _steps(gears, state, path @ gears.coupling.T)


def turning_points(path: Floats) -> Floats:
    """Return the points (k, 6) of a path (m, 6) where a joint turns, and its end."""
    steps = np.diff(path, axis=0)
    steps[np.abs(steps) < STILL] = 0.0
    before, after = steps[:-1], steps[1:]
    turns = (before * after <= 0) & ((before != 0) | (after != 0))
    keep = np.append(turns.any(axis=1), True)
    return np.asarray(path[1:][keep])


def _steps(gears: Gears, state: GearState, angles: Floats) -> GearState:
    """Move every motor one way to angles after angles (m, 6); return m + 1 states."""
    gap, every = gears.half_gaps(angles), np.vstack([state.angle, angles])
    reach = gap * np.where(gears.are(GearKind.ELASTIC), gears.reach, 1.0)
    moved = np.diff(every, axis=0)
    (side,), (flank,) = (
        _each(_cross, place, moved / most)
        for place, most in ((state.side, gap), (state.flank, reach))
    )
    known = state.heading, state.extreme, state.turn, state.turn_before
    return GearState(every, side, flank, *_each(_turn, *known, angles, gap))


def _each(
    follow_one: Callable[..., Iterator[tuple[float, ...]]], *columns: Floats
) -> Floats:
    """Follow six motors one by one: what happens at a place is too small for arrays.

    Args:
        follow_one: Yields k numbers of a motor, before it moves and at m places.
        columns: What it is given of each, (6,) or (m, 6).

    Returns:
        (k, m + 1, 6).
    """
    given = zip(*(column.T.tolist() for column in columns), strict=True)
    return np.array([[*follow_one(*own)] for own in given]).transpose(2, 1, 0)


def _cross(place: float, ways: Sequence[float]) -> Iterator[tuple[float]]:
    """Follow a place in a gap over ways that are parts of it."""
    yield (place,)
    for way in ways:
        place = min(max(place + way, -1.0), 1.0)
        yield (place,)


def _turn(
    heading: float, extreme: float, turn: float, turn_before: float,
    angles: Sequence[float], gaps: Sequence[float],
) -> Iterator[tuple[float, ...]]:  # fmt: skip
    """Follow the reversals of a motor."""
    yield heading, extreme, turn, turn_before
    for angle, gap in zip(angles, gaps, strict=True):
        advance = heading * (angle - extreme)
        if advance < -gap:
            turn_before, turn, extreme, heading = turn, extreme, angle, -heading
        elif advance > 0:
            extreme = angle
        yield heading, extreme, turn, turn_before


# The virtual arm: where the tool really goes, and what a laser tracker reads there.


@dataclass(frozen=True)
class VirtualArm:
    """One arm with its own errors; all lengths in metres, in the arm base frame.

    Attributes:
        seed: What it was drawn from.
        nominal: The arm that its controller believes in.
        as_built: The arm that it is.
        laws: Its further imperfections, with sizes: the truth to score against.
        gears: Gaps that the direction comes from.
        joint_noise: Repeatability of every joint, (6,) [rad].
        tracker_noise: Constant [m] and per metre of range, one axis.
        warming: Rise [K] and time constant [s] of the arm's own temperature.
    """

    seed: int
    nominal: Chain
    as_built: AsBuilt
    laws: tuple[Law, ...]
    gears: Gears
    joint_noise: Floats
    tracker_noise: tuple[float, float]
    warming: tuple[float, float]

    def nominal_pose(self, arrivals: VirtualArrivals) -> Floats:
        """Return where the drawing puts the tool, (n, 4, 4)."""
        return np.asarray(self.nominal.flange(arrivals.q) @ arrivals.tool)

    def nominal_tcp(self, arrivals: VirtualArrivals) -> Floats:
        """Return where the drawing puts the TCP, (n, 3)."""
        return np.asarray(self.nominal_pose(arrivals)[:, :3, 3])

    def tcp(
        self, arrivals: VirtualArrivals, joint_noise: Floats | float = 0.0
    ) -> Floats:
        """Return where the TCP really is, (n, 3), without noise unless some is given.

        Args:
            arrivals: Commanded joints and all they depend on.
            joint_noise: Added to the joints, (n, 6) [rad].
        """
        return np.asarray(self.pose(arrivals, joint_noise)[:, :3, 3])

    def pose(
        self, arrivals: VirtualArrivals, joint_noise: Floats | float = 0.0
    ) -> Floats:
        """Return where the tool really is, (n, 4, 4).

        Args:
            arrivals: Commanded joints and all they depend on.
            joint_noise: Added to the joints, (n, 6) [rad].
        """
        arrivals = replace(arrivals, side=self.gears.show_sides(arrivals))
        angles = arrivals.q + total(self.laws, Where.JOINTS, arrivals) + joint_noise
        growth = total(self.laws, Where.LENGTHS, arrivals)
        base = self.as_built.base + total(self.laws, Where.BASE, arrivals)
        mount = self.as_built.mount + total(self.laws, Where.TOOL, arrivals)
        chain = self.as_built.chain.grow(growth)
        twists = None
        if any(law.where is Where.LINKS for law in self.laws):  # before every joint
            twists = total(self.laws, Where.LINKS, arrivals).reshape(-1, 6, 6)
        flange = chain.flange(angles, twists)
        return np.asarray(
            small_motion(base) @ flange @ small_motion(mount) @ arrivals.tool
        )

    def error(self, arrivals: VirtualArrivals) -> Floats:
        """Return the true error, actual minus nominal TCP, (n, 3), without noise."""
        return self.tcp(arrivals) - self.nominal_tcp(arrivals)

    def simulate_readings(self, arrivals: VirtualArrivals, tcp: Floats) -> Floats:
        """Return what a tracker whose stand moves would read at TCPs (n, 3)."""
        motion = small_motion(total(self.laws, Where.TRACKER, arrivals))
        turned = np.einsum("nij,nj->ni", motion[:, :3, :3], tcp)
        return np.asarray(turned + motion[:, :3, 3])

    def measure(
        self, arrivals: VirtualArrivals, tracker: Floats, rng: np.random.Generator
    ) -> Floats:
        """Return noisy tracker readings (n, 3) in the arm base frame.

        Args:
            arrivals: What is measured.
            tracker: Where the tracker stands, (3,).
            rng: Random numbers of this campaign.
        """
        joints = rng.normal(size=arrivals.q.shape) * self.joint_noise
        readings = self.simulate_readings(arrivals, self.tcp(arrivals, joints))
        span = np.linalg.norm(readings - tracker, axis=1)
        sigma = self.tracker_noise[0] + self.tracker_noise[1] * span
        return np.asarray(readings + rng.normal(size=readings.shape) * sigma[:, None])

    def temperature(self, time: Floats, start: float) -> Floats:
        """Return the arm's temperature (n,) [deg C] at times (n,) [s]."""
        rise, constant = self.warming
        return np.asarray(start + rise * (1 - np.exp(-time / constant)))

    def without_noise(self) -> VirtualArm:
        """Return the same arm with perfect repeatability and a perfect tracker."""
        return replace(self, joint_noise=np.zeros(6), tracker_noise=(0.0, 0.0))
