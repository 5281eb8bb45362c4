"""Physical laws of the virtual arm: what one imperfection does on every arrival."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.simulation.kinematics import (
    LinkMasses,
    bending_moment,
    foundation_moment,
    payload_torque,
    total_torque,
)
from postproc.simulation.part_motion import TEXT, PlantedMotion
from postproc.simulation.reference import (
    DURATION,
    WORKING_RANGE,
    reference_arrivals,
)
from postproc.simulation.state import REST_TEMPERATURE, VirtualArrivals

# A physical law of the virtual arm: what one imperfection does on every arrival.

Shape = Callable[[VirtualArrivals], Floats]


class Where(Enum):
    """What a law changes: six numbers an arrival, six a joint of `LINKS`."""

    JOINTS = "joints"  # joint angles [rad]
    LINKS = "links"  # twists of all behind the frame before every joint [m, rad]
    LENGTHS = "lengths"  # relative growth of every link
    BASE = "base"  # twist of the arm on its foundation [m, rad]
    TOOL = "tool"  # twist of the tool on the flange [m, rad]
    TRACKER = "tracker"  # twist of what the tracker reads [m, rad]; nothing moves


@dataclass(frozen=True)
class Law:
    """One imperfection.

    Attributes:
        effect: The name an engineer would give it; "" where no name fits.
        where: What it changes.
        joints: Joints that are moved, from 1; empty for lengths and frames.
        source: The joint, or the coupled drive, that drives a joint's error, from 1,
            or 0.
        parameters: The law's own numbers, SI units, for the record.
        shape: (n,) arrivals -> (n, 6) or (n, 36) per unit of `scale`.
        scale: Size of the law.
        peak_mm: Largest TCP displacement over the reference campaign.
    """

    effect: str
    where: Where
    joints: tuple[int, ...]
    source: int
    parameters: dict[str, float]
    shape: Shape
    scale: float = 1.0
    peak_mm: float = float("nan")

    def __call__(self, arrivals: VirtualArrivals) -> Floats:
        """Return the change (n, 6) that the law makes on each arrival."""
        return np.asarray(self.scale * self.shape(arrivals))

    def rescale(self, factor: float, peak_mm: float) -> Law:
        """Return the law with another size."""
        return replace(self, scale=self.scale * factor, peak_mm=peak_mm)


@dataclass(frozen=True)
class Draw:
    """What the drawing of a law may use.

    Attributes:
        rng: Random numbers of this law alone.
        body: The weights of this arm (not the nominal ones).
        joint: The joint asked for, from 1, or 0: draw one.
        rows: How many rows the campaign has, for laws that start at one of them.
        tracker: Where the tracker stands, (3,) [m] in the arm base frame.
    """

    rng: np.random.Generator
    body: LinkMasses
    joint: int
    rows: int
    tracker: Floats

    def pick(self, joints: Sequence[int]) -> int:
        """Return the joint asked for, or one of the given joints."""
        return self.joint or int(self.rng.choice(joints))

    def sign(self) -> float:
        """Return +1 or -1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def phase(self) -> float:
        """Return an angle [rad]."""
        return float(self.rng.uniform(0.0, 2 * np.pi))


def on_joint(joint: int, values: Floats) -> Floats:
    """Put values (n,) [rad] into the column of a joint (from 1) of an (n, 6) array."""
    out = np.zeros((len(values), 6))
    out[:, joint - 1] = values
    return out


def total(laws: Sequence[Law], where: Where, arrivals: VirtualArrivals) -> Floats:
    """Sum the changes (n, 6) or (n, 36) of all laws that act at one place."""
    parts = [law(arrivals) for law in laws if law.where is where]
    width = 36 if where is Where.LINKS else 6
    return np.asarray(sum(parts, np.zeros((len(arrivals), width))))


# Laws that bend or turn a joint: weight, gear teeth, encoders, wear.

KILO = 1e3  # [N m] torques in the laws are counted in thousands


def torque_at(draw: Draw, arrivals: VirtualArrivals) -> Floats:
    """Return the torque (n, 6) [N m] of links and payload about the joints."""
    return total_torque(draw.body, arrivals.q, arrivals.payload, arrivals.payload_com)


def compliance(draw: Draw) -> Law:
    """One or two joints yield to the weight they carry: torque / stiffness."""
    first = draw.pick([2, 3, 5])
    joints = [first]
    if not draw.joint and draw.rng.random() < 0.5:
        joints.append(int(draw.rng.choice([j for j in (2, 3) if j != first])))
    softness = np.zeros(6)  # relative; the scale makes it rad / kN m
    softness[first - 1] = 1.0
    for joint in joints[1:]:
        softness[joint - 1] = draw.rng.uniform(0.4, 1.0)

    def shape(arrivals: VirtualArrivals) -> Floats:
        return torque_at(draw, arrivals) / KILO * softness

    parameters = {f"softness_{j}": float(softness[j - 1]) for j in joints}
    return Law("compliance", Where.JOINTS, tuple(joints), 0, parameters, shape)


def bending(draw: Draw) -> Law:
    """Links and bearings behind a joint yield to the weight across its axis."""
    joint = draw.pick([2, 3, 4, 5, 6])
    softness = np.zeros((6, 2))  # relative; the scale makes it rad / kN m
    softness[joint - 1] = draw.rng.uniform(0.3, 1.0, 2)

    def shape(arrivals: VirtualArrivals) -> Floats:
        moment = bending_moment(
            draw.body, arrivals.q, arrivals.payload, arrivals.payload_com
        )
        twists = np.zeros((len(arrivals), 6, 6))
        twists[:, :, 3:5] = moment / KILO * softness
        return twists.reshape(-1, 36)

    parameters = {f"softness_{a}": float(softness[joint - 1, k])
                  for k, a in enumerate("xy")}  # fmt: skip
    return Law("bending", Where.LINKS, (joint,), 0, parameters, shape)


def payload(draw: Draw) -> Law:
    """A joint yields to the declared payload."""
    joint = draw.pick([2, 3, 5])

    def shape(arrivals: VirtualArrivals) -> Floats:
        torque = payload_torque(
            draw.body, arrivals.q, arrivals.payload, arrivals.payload_com
        )
        return on_joint(joint, torque[:, joint - 1] / KILO)

    return Law("payload", Where.JOINTS, (joint,), 0, {}, shape)


def counterbalance(draw: Draw) -> Law:
    """Axis 2 yields to its balancing spring: one between a fixed and a moving pin."""
    fixed, moving = draw.rng.uniform(0.5, 0.8), draw.rng.uniform(0.2, 0.35)  # [m]
    upright = draw.rng.uniform(-0.2, 0.2)  # [rad] where the pins and axis 2 align
    preload = draw.rng.uniform(0.0, 0.3)  # [m] of spring travel at the shortest length
    shortest = fixed - moving

    def shape(arrivals: VirtualArrivals) -> Floats:
        angle = arrivals.q[:, 1] - upright
        length = np.sqrt(
            fixed**2 + moving**2 - 2 * fixed * moving * np.cos(angle)
        )  # law of cosines
        lever = fixed * moving * np.sin(angle) / length
        return on_joint(2, -(length - shortest + preload) * lever)

    parameters = {"fixed_pin": fixed, "moving_pin": moving, "upright": upright}
    return Law("counterbalance", Where.JOINTS, (2,), 0, parameters, shape)


def transmission(draw: Draw) -> Law:
    """A gear runs out of centre: a wave of order 1 or 2 of the joint angle."""
    return _wave(draw, int(draw.rng.choice([1, 2])))


def transmission_free(draw: Draw) -> Law:
    """Gear teeth: a wave of a free order between 7 and 30 of the joint angle."""
    return _wave(draw, int(draw.rng.integers(7, 31)))


def _wave(draw: Draw, order: int) -> Law:
    joint = draw.pick(range(1, 7))
    phase = draw.phase()

    def shape(arrivals: VirtualArrivals) -> Floats:
        return on_joint(joint, np.cos(order * arrivals.q[:, joint - 1] + phase))

    parameters = {"order": float(order), "phase": phase}
    return Law("transmission", Where.JOINTS, (joint,), 0, parameters, shape)


# Gears of the drives: their motors turn fast, and those of a hollow wrist together.

MOTOR_TURNS = (121.0, 121.0, 121.0, 80.0, 80.0, 80.0)  # per turn of the joint
HOLLOW_WRIST = np.eye(6)  # drive angles by joint angles
HOLLOW_WRIST[4, 3], HOLLOW_WRIST[5, 3:5] = -0.02, (-0.03, -1.0)


def motor_wave(draw: Draw) -> Law:
    """A wave with the motor of a joint that is not coupled, or with twice its turns."""
    joint, twice = draw.pick(range(1, 7)), draw.rng.integers(1, 3)
    own = replace(draw, joint=joint)
    return _wave(own, int(twice * MOTOR_TURNS[joint - 1]))


def drive_wave(draw: Draw) -> Law:
    """A wave of a coupled drive's angle: out of centre, its teeth, or its motor."""
    drive, phase = draw.pick([5, 6]), draw.phase()
    low, high = draw.rng.integers([1, 7], [3, 31]).tolist()
    order = float(draw.rng.choice([low, high, MOTOR_TURNS[drive - 1]]))

    def errs(arrivals: VirtualArrivals) -> Floats:
        angle = arrivals.q @ HOLLOW_WRIST[drive - 1]
        return np.asarray(np.cos(order * angle + phase))

    parameters = {"order": order, "phase": phase}
    return _of_drive("drive_transmission", drive, parameters, errs)


def drive_backlash(draw: Draw) -> Law:
    """A gap in the gear of a drive that drags other joints along."""
    drive = draw.pick([5])

    def errs(arrivals: VirtualArrivals) -> Floats:
        return np.asarray(-arrivals.side[:, drive - 1])

    return _of_drive("drive_backlash", drive, {}, errs)


def _of_drive(name: str, drive: int, parameters: dict[str, float], errs: Shape) -> Law:
    """Let an error (n,) [rad] of a drive move the joints as the gears are coupled."""
    moves = np.linalg.solve(HOLLOW_WRIST, np.eye(6)[drive - 1])

    def shape(arrivals: VirtualArrivals) -> Floats:
        return np.outer(errs(arrivals), moves)

    joints = tuple(int(j) + 1 for j in np.flatnonzero(moves))
    return Law(name, Where.JOINTS, joints, drive, parameters, shape)


def scale(draw: Draw) -> Law:
    """An encoder or gear ratio that is slightly wrong: gain * angle."""
    joint, sign = draw.pick(range(1, 7)), draw.sign()

    def shape(arrivals: VirtualArrivals) -> Floats:
        return on_joint(joint, sign * arrivals.q[:, joint - 1])

    return Law("scale", Where.JOINTS, (joint,), 0, {}, shape)


def coupling(draw: Draw) -> Law:
    """A wrist joint is dragged along by the joint before it."""
    joint = draw.pick([5, 6])
    source = int(draw.rng.choice([4] if joint == 5 else [4, 5]))
    sign = draw.sign()

    def shape(arrivals: VirtualArrivals) -> Floats:
        return on_joint(joint, sign * arrivals.q[:, source - 1])

    return Law("coupling", Where.JOINTS, (joint,), source, {}, shape)


def draw_worn_spot(draw: Draw) -> Law:
    """Worn teeth at one place: a bump a few degrees wide in one joint's error."""
    joint, sign = draw.pick(range(1, 7)), draw.sign()
    low, high = WORKING_RANGE[joint - 1]
    centre = draw.rng.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low))
    width = np.radians(draw.rng.uniform(4.0, 9.0))

    def shape(arrivals: VirtualArrivals) -> Floats:
        away = (arrivals.q[:, joint - 1] - centre) / width
        return on_joint(joint, sign * np.exp(-0.5 * away**2))

    parameters = {"centre": centre, "width": width}
    return Law("joint_map", Where.JOINTS, (joint,), 0, parameters, shape)


def joint_product(draw: Draw) -> Law:
    """An error that no catalogue names: a joint follows a product of two angles."""
    joint = draw.joint or 3
    others = [j for j in range(1, 7) if j != joint]
    one, two = (int(j) for j in draw.rng.choice(others, 2, replace=False))
    middle, sign = WORKING_RANGE.mean(axis=1), draw.sign()

    def shape(arrivals: VirtualArrivals) -> Floats:
        away = arrivals.q - middle
        return on_joint(joint, sign * away[:, one - 1] * away[:, two - 1])

    parameters = {"first": float(one), "second": float(two)}
    return Law("", Where.JOINTS, (joint,), 0, parameters, shape)


# Laws that depend on how a joint arrives: gaps, friction, load, speed.
#
# Sign: a link lags behind its motor, so a joint that arrives forward (side +1) stands
# short by half the gap: error = side * b with b negative.


def backlash(draw: Draw) -> Law:
    """Every gear has a gap of 0.05 to 0.2 mrad that changes with the joint angle.

    error_j = side_j * b_j (1 + first + second harmonic of the angle).
    """
    half_gap = draw.rng.uniform(0.05e-3, 0.2e-3, 6)  # [rad]
    depth = draw.rng.uniform(0.0, 0.2, (2, 6))
    phase = draw.rng.uniform(0.0, 2 * np.pi, (2, 6))

    def shape(arrivals: VirtualArrivals) -> Floats:
        wave = sum(depth[k - 1] * np.cos(k * arrivals.q + phase[k - 1]) for k in (1, 2))
        return np.asarray(-arrivals.side * half_gap * (1 + wave))

    parameters = {f"b_{j + 1}": -float(half_gap[j]) for j in range(6)}
    joints = tuple(range(1, 7))
    return Law("backlash", Where.JOINTS, joints, 0, parameters, shape)


def load_backlash(draw: Draw) -> Law:
    """The lost motion of a joint grows with the load on its teeth."""
    joint, power = draw.pick([2, 3, 5]), draw.rng.uniform(0.8, 1.2)

    def shape(arrivals: VirtualArrivals) -> Floats:
        load = np.abs(torque_at(draw, arrivals)[:, joint - 1] / KILO)
        return on_joint(joint, -arrivals.side[:, joint - 1] * load**power)

    return Law("load_backlash", Where.JOINTS, (joint,), 0, {"power": power}, shape)


def gravity_side(draw: Draw) -> Law:
    """A gear whose load picks the flank, whatever the direction: tanh(torque / t0).

    Its name for an engineer is that of the other load-dependent backlash.
    """
    joint = draw.pick([2, 3, 5])
    threshold = draw.rng.uniform(0.1, 0.5)  # of what the joint usually carries
    usual = np.array([1.0, 5.0, 1.5, 0.1, 0.1, 0.01])[joint - 1]  # [kN m]

    def shape(arrivals: VirtualArrivals) -> Floats:
        load = torque_at(draw, arrivals)[:, joint - 1] / KILO
        return on_joint(joint, np.tanh(load / (threshold * usual)))

    parameters = {"t0": threshold * usual * KILO}
    return Law("load_backlash", Where.JOINTS, (joint,), 0, parameters, shape)


def windup(draw: Draw) -> Law:
    """Friction winds a shaft up again after every reversal, over a way d0."""
    joint = draw.pick(range(1, 6))
    way = np.radians(draw.rng.uniform(1.0, 6.0))

    def shape(arrivals: VirtualArrivals) -> Floats:
        wound = 1 - 2 * np.exp(-arrivals.travel[:, joint - 1] / way)
        return on_joint(joint, -arrivals.side[:, joint - 1] * wound)

    return Law("windup", Where.JOINTS, (joint,), 0, {"d0": way}, shape)


def lag(draw: Draw) -> Law:
    """A joint trails its command in proportion to the speed."""
    joint = draw.pick(range(1, 6))

    def shape(arrivals: VirtualArrivals) -> Floats:
        return on_joint(joint, -arrivals.side[:, joint - 1] * arrivals.speed)

    return Law("lag", Where.JOINTS, (joint,), 0, {}, shape)


def hysteresis(draw: Draw) -> Law:
    """An error that no catalogue names: it remembers the last two reversals.

    A short way between them leaves the grease and the seals wound up: the error is
    large after a short loop and fades with the way since.
    """
    joint = draw.pick(range(1, 6))
    way, loop = np.radians(draw.rng.uniform([5.0, 10.0], [15.0, 40.0]))

    def shape(arrivals: VirtualArrivals) -> Floats:
        fresh = np.exp(-arrivals.travel[:, joint - 1] / way)
        short = 1 - np.exp(-arrivals.loop[:, joint - 1] / loop)
        return on_joint(joint, -arrivals.side[:, joint - 1] * fresh * short)

    parameters = {"way": way, "loop": loop}
    return Law("", Where.JOINTS, (joint,), 0, parameters, shape)


def elastic_flank(draw: Draw) -> Law:
    """A gear that yields before it carries, or grease and seals that bend (Dahl).

    Teeth go from flank to flank along an S over a way of some degrees. In the bristles
    of grease the force z goes on from where the reversal left it, dz = (1 - z) ds / d0;
    where that was follows from the way between the last two reversals.
    """
    joint, dahl = draw.pick(range(1, 6)), bool(draw.rng.random() < 0.5)
    way = np.radians(draw.rng.uniform(1.0, 6.0))

    def shape(arrivals: VirtualArrivals) -> Floats:
        gone = arrivals.travel[:, joint - 1] / way
        if dahl:
            before = 2 * np.exp(-arrivals.loop[:, joint - 1] / way) - 1
            place = 1 - (1 - before) * np.exp(-gone)
        else:
            third = np.clip(gone / 3, 0.0, 1.0)  # a cubic, flat at its ends
            place = 2 * third**2 * (3 - 2 * third) - 1
        return on_joint(joint, -arrivals.side[:, joint - 1] * place)

    parameters = {"d0": way, "dahl": float(dahl)}
    return Law("windup", Where.JOINTS, (joint,), 0, parameters, shape)


# Laws that move more than a joint: heat, foundations, tool holders, the tracker.

STEEL = 12e-6  # [1/K] linear expansion


def thermal(draw: Draw) -> Law:
    """Every link grows with the temperature, cast iron and aluminium mixed."""
    expansion = STEEL * draw.rng.uniform(0.8, 1.6, 6)

    def shape(arrivals: VirtualArrivals) -> Floats:
        return np.outer(arrivals.temperature - REST_TEMPERATURE, expansion)

    parameters = {f"alpha_{j + 1}": float(expansion[j]) for j in range(6)}
    return Law("thermal", Where.LENGTHS, (), 0, parameters, shape)


def warmup(draw: Draw) -> Law:
    """Motors heat the links from inside, unseen by any thermometer."""
    expansion = STEEL * draw.rng.uniform(0.8, 1.6, 6)
    constant = DURATION * draw.rng.uniform(0.15, 0.5)

    def shape(arrivals: VirtualArrivals) -> Floats:
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

    def shape(arrivals: VirtualArrivals) -> Floats:
        return np.outer(arrivals.order >= row, twist)

    return Law(name, where, (), 0, {"row": float(row)}, shape)


def joint_step(draw: Draw) -> Law:
    """A joint loses its zero once: a crash, or a motor that was exchanged."""
    joint, sign = draw.pick(range(1, 7)), draw.sign()
    row = int(np.ceil(draw.rows * draw.rng.uniform(0.2, 0.8)))

    def shape(arrivals: VirtualArrivals) -> Floats:
        return on_joint(joint, np.where(arrivals.order >= row, sign, 0.0))

    return Law("joint_step", Where.JOINTS, (joint,), 0, {"row": float(row)}, shape)


def joint_offset(draw: Draw) -> Law:
    """A joint was mastered again before the campaign: its zero is another."""
    joint, sign = draw.pick(range(1, 7)), draw.sign()

    def shape(arrivals: VirtualArrivals) -> Floats:
        return on_joint(joint, np.full(len(arrivals), sign))

    return Law("joint_offset", Where.JOINTS, (joint,), 0, {}, shape)


def base_tilt(draw: Draw) -> Law:
    """A table or foundation leans under the weight that hangs over it.

    It is soft along two directions at right angles, anyhow round the vertical, and
    turns about a point below the arm.
    """
    soft = draw.rng.uniform([0.5, 0.2], [1.5, 1.0])
    angle, depth = draw.rng.uniform(0.0, np.pi), draw.rng.uniform(0.0, 0.8)
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    across = np.array([-np.sin(angle), np.cos(angle), 0.0])

    def shape(arrivals: VirtualArrivals) -> Floats:
        moment = foundation_moment(
            draw.body, arrivals.q, arrivals.payload, arrivals.payload_com
        )
        turn = soft[0] * np.outer(moment @ along, along)
        turn += soft[1] * np.outer(moment @ across, across)
        shift = np.cross(turn, [0.0, 0.0, depth])  # the base is above what it turns on
        return np.concatenate([shift, turn], axis=1) / KILO

    parameters = {"angle": angle, "depth": depth}
    return Law("base_tilt", Where.BASE, (), 0, parameters, shape)


# Laws of the tracker: what it reads wrongly while nothing moves.


def _beam(draw: Draw, arrivals: VirtualArrivals) -> Floats:
    """Return the way from the tracker to the TCP of the drawing, (n, 3) [m]."""
    flange = draw.body.chain.flange(arrivals.q)
    return np.asarray((flange @ arrivals.tool)[:, :3, 3] - draw.tracker)


def azimuth(draw: Draw) -> Law:
    """The tracker's horizontal circle is out of centre: one wave a turn."""
    phase = draw.phase()

    def shape(arrivals: VirtualArrivals) -> Floats:
        beam = _beam(draw, arrivals)
        wrong = np.sin(np.arctan2(beam[:, 1], beam[:, 0]) + phase)
        turn = np.outer(wrong, [0.0, 0.0, 1.0])  # about the tracker, not the arm
        return np.concatenate([-np.cross(turn, draw.tracker), turn], axis=1)

    return Law("azimuth", Where.TRACKER, (), 0, {"phase": phase}, shape)


def refraction(draw: Draw) -> Law:
    """Air that is warmer above bends the beam: it sags by half curvature x range^2."""
    sign = draw.sign()

    def shape(arrivals: VirtualArrivals) -> Floats:
        beam = _beam(draw, arrivals)
        reach, level = np.linalg.norm(beam, axis=1), np.hypot(beam[:, 0], beam[:, 1])
        angle = sign * 0.5 * level  # curvature counts for the level part of the way
        outward = np.column_stack([beam[:, 0], beam[:, 1]]) / level[:, None]
        side = np.column_stack([-outward * beam[:, 2:], level]) / reach[:, None]
        sag = side * (angle * reach)[:, None]
        return np.concatenate([sag, np.zeros_like(sag)], axis=1)

    return Law("refraction", Where.TRACKER, (), 0, {}, shape)


def tracker_drift(draw: Draw) -> Law:
    """The tracker's stand moves slowly while it measures; the arm does not."""
    ends = draw.rng.normal(size=(2, 6)) * np.repeat([1.0, 0.3], 3)
    phase = draw.phase()

    def shape(arrivals: VirtualArrivals) -> Floats:
        progress = arrivals.time / DURATION
        swing = np.sin(np.pi * progress + phase) - np.sin(phase)
        return np.outer(progress, ends[0]) + 0.5 * np.outer(swing, ends[1])

    return Law("tracker_drift", Where.TRACKER, (), 0, {"phase": phase}, shape)


# Any other small motion of a link: a cell of the table of all of them.

USUAL_CELL = 0.05, 0.5  # [mm]


def cell(draw: Draw, text: str) -> Law:
    """A link, the base or the tool moves a little by what the text says."""
    asked = PlantedMotion.parse(text)
    drive = asked.draw(draw.rng, draw.body, reference_arrivals(draw.rows))
    place, link = asked.place, asked.link

    def shape(arrivals: VirtualArrivals) -> Floats:
        twists = np.zeros((len(arrivals), 6, 6))
        twists[:, max(link - 1, 0), place] = drive(arrivals)
        return twists.reshape(-1, 36) if link else twists[:, 0]

    whole = {"base": Where.BASE, "tool": Where.TOOL}
    where = whole.get(asked.body, Where.LINKS)
    return Law(text, where, (link,) if link else (), 0, {}, shape)


# All imperfections by name, and the text that asks for them.

DEFAULT = ("geometry", "tool", "backlash")
AS_BUILT = ("geometry", "tool")  # drawn as numbers of the chain, not as laws


@dataclass(frozen=True)
class LawKind:
    """A law by name: how it is drawn, and its usual peak size on the TCP [mm]."""

    draw: Callable[[Draw], Law]
    low_mm: float
    high_mm: float


KINDS = {
    "compliance": LawKind(compliance, 0.1, 1.0),
    "bending": LawKind(bending, 0.05, 0.5),
    "payload": LawKind(payload, 0.2, 2.0),
    "counterbalance": LawKind(counterbalance, 0.1, 0.5),
    "transmission": LawKind(transmission, 0.05, 0.3),
    "transmission_free": LawKind(transmission_free, 0.05, 0.3),
    "motor_wave": LawKind(motor_wave, 0.05, 0.3),
    "drive_wave": LawKind(drive_wave, 0.05, 0.3),
    "drive_backlash": LawKind(drive_backlash, 0.05, 0.3),
    "scale": LawKind(scale, 0.05, 0.3),
    "coupling": LawKind(coupling, 0.05, 0.3),
    "load_backlash": LawKind(load_backlash, 0.05, 0.3),
    "gravity_side": LawKind(gravity_side, 0.05, 0.3),
    "thermal": LawKind(thermal, 0.1, 1.0),
    "warmup": LawKind(warmup, 0.1, 1.0),
    "windup": LawKind(windup, 0.03, 0.15),
    "lag": LawKind(lag, 0.03, 0.25),
    "base_shift": LawKind(base_shift, 0.05, 0.5),
    "tool_shift": LawKind(tool_shift, 0.05, 0.5),
    "tracker_drift": LawKind(tracker_drift, 0.03, 0.1),
    "joint_step": LawKind(joint_step, 0.05, 0.5),
    "joint_offset": LawKind(joint_offset, 0.1, 1.0),
    "base_tilt": LawKind(base_tilt, 0.1, 1.0),
    "elastic_flank": LawKind(elastic_flank, 0.03, 0.15),
    "azimuth": LawKind(azimuth, 0.03, 0.1),
    "refraction": LawKind(refraction, 0.03, 0.1),
    "worn_spot": LawKind(draw_worn_spot, 0.05, 0.5),
    "joint_product": LawKind(joint_product, 0.05, 0.3),
    "hysteresis": LawKind(hysteresis, 0.05, 0.3),
}
NAMES = (*DEFAULT, *KINDS)


def kind_of(name: str) -> LawKind:
    """Find how a law is drawn: one by name, or a cell by its text."""
    if " by " in name:
        return LawKind(lambda draw: cell(draw, name), *USUAL_CELL)
    return KINDS[name]


@dataclass(frozen=True)
class Planted:
    """One imperfection asked for.

    Attributes:
        name: One of `NAMES`, or the text of a cell.
        joint: From 1, or 0: drawn.
        peak_mm: Largest displacement of the TCP, or 0: drawn from the usual sizes.
    """

    name: str
    joint: int = 0
    peak_mm: float = 0.0


def parse_effects(text: str | Sequence[str | Planted]) -> tuple[Planted, ...]:
    """Read a list of effects: ``name``, ``name@joint``, ``name=mm``, ``name@joint=mm``.

    ``all`` stands for every name. Any other motion is asked for by its `cell` and the
    size in mm, ``rotation:link3:x by temperature linear 0.02``.

    >>> parse_effects("geometry,compliance@2=0.4")[1]
    Planted(name='compliance', joint=2, peak_mm=0.4)

    Raises:
        PostprocError: A name, joint or size that does not exist.
    """
    items = text.split(",") if isinstance(text, str) else text
    found: list[Planted] = []
    for item in items:
        if isinstance(item, Planted):
            found.append(item)
        elif item.strip() == "all":
            found += [Planted(name) for name in NAMES]
        elif item.strip():
            found.append(_read(item.strip()))
    return tuple(found)


def _read(item: str) -> Planted:
    if " by " in item:
        return _read_cell(item)
    match = re.fullmatch(r"(\w+)(?:@([1-6]))?(?:=([0-9.]+(?:e-?\d+)?))?", item)
    if match is None or match[1] not in NAMES:
        raise PostprocError(
            f"the virtual arm has no effect '{item}'. Write name, name@joint, name=mm "
            f"or name@joint=mm with one of: {', '.join(NAMES)}; or any motion of a "
            "link, for instance rotation:link3:x by temperature linear 0.02"
        )
    return Planted(match[1], int(match[2] or 0), float(match[3] or 0.0))


def _read_cell(item: str) -> Planted:
    """Read a cell, the size in mm behind it where there is one."""
    if TEXT.fullmatch(item):
        return Planted(str(PlantedMotion.parse(item)))
    text, _, size = item.replace("=", " ").rpartition(" ")
    if re.fullmatch(r"\d+\.?\d*|\.\d+", size) is None:
        text = item  # refused as it stands
    return Planted(str(PlantedMotion.parse(text)), 0, float(size))
