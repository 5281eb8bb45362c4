"""Draw a virtual arm from a seed."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.simulation.arm import (
    AsBuilt,
    GearKind,
    Gears,
    VirtualArm,
    draw_as_built,
    draw_body,
    draw_kinds,
)
from postproc.simulation.kinematics import (
    GRAVITY,
    NJ220,
    Chain,
    LinkMasses,
    total_torque,
)
from postproc.simulation.laws import (
    AS_BUILT,
    DEFAULT,
    Draw,
    Law,
    Planted,
    backlash,
    kind_of,
    parse_effects,
)
from postproc.simulation.reference import USUAL_TRACKER, reference_arrivals
from postproc.simulation.state import VirtualArrivals, make_arrivals

TRACKER_NOISE = (0.01e-3, 5e-6)  # [m], [m/m] per axis
SMALL = 1e-6  # a size at which every law is linear
HELD = 0.15  # of the largest torque of gravity about a joint, held by its friction
LEAST_HELD = 20.0  # [N m]
RUNS_ON = 0.25  # of the highest speed of a joint: braking from it changes the flank
REPEATS_WITHIN = (0.02e-3, 0.05e-3)  # [m] rms of the TCP over the reference campaign


def stream(seed: int, name: str) -> np.random.Generator:
    """Return the random numbers of one part, every part having its own."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def virtual_arm(
    seed: int,
    effects: str | Sequence[str | Planted] = DEFAULT,
    *,
    chain: Chain = NJ220,
    coupling: Floats | None = None,
    rows: int = 400,
    tool: Floats | None = None,
    gears: str = GearKind.SHARP.value,
    tracker: Floats | None = None,
    gravity: Floats = GRAVITY,
) -> VirtualArm:
    """Draw an arm.

    Args:
        seed: Same seed, same arm; adding an effect leaves the others as they were.
        effects: Names of `laws.NAMES`, with joints and sizes if wanted.
        chain: The nominal arm.
        coupling: Motor angles = coupling @ joint angles, (6, 6); default identity.
        rows: Length of the campaign in which base or tool shift at some row; nothing
            else depends on it.
        tool: TCP (3,) or pose (4, 4) [m] that sizes in mm refer to; default a probe
            that stands off in all three axes.
        gears: What the gears do in their gaps, see `draw_kinds`; nothing else depends
            on it.
        tracker: Where the tracker stands, (3,) [m]; only what it reads wrongly depends
            on it.
        gravity: Acceleration of gravity in the arm base, (3,) [m/s^2].

    Raises:
        PostprocError: An effect that does not exist.
    """
    planted = parse_effects(effects)
    names = {item.name for item in planted}
    perfect = _perfect(chain, coupling)
    body = draw_body(stream(seed, "body"), chain, gravity)
    stand = USUAL_TRACKER if tracker is None else tracker
    planter = _Planter(seed, body, rows, stand, reference_arrivals(rows, tool), perfect)
    laws = {item: planter.law(item) for item in planted if item.name not in AS_BUILT}
    gaps = [law for law in laws.values() if law.effect == "backlash"]
    gap = gaps[0] if gaps else planter.law(Planted("backlash"))
    rng, at = stream(seed, "arm"), planter.reference
    kinds, reach, bends = draw_kinds(stream(seed, "gears"), gears)
    torque = total_torque(body, at.q, at.payload, at.payload_com)
    return replace(
        perfect,
        seed=seed,
        as_built=draw_as_built(
            stream(seed, "as built"), chain, "geometry" in names, "tool" in names
        ),
        laws=tuple(laws.values()),
        gears=replace(
            perfect.gears,
            gap=_half_gap(gap),
            wave=_wave(gap),
            kinds=kinds,
            reach=reach,
            bends=bends,
            body=body,
            friction=np.maximum(HELD * np.abs(torque).max(axis=0), LEAST_HELD),
            runs_on=RUNS_ON * chain.speed,
        ),
        joint_noise=planter.joint_noise(rng),
        tracker_noise=TRACKER_NOISE,
        warming=(rng.uniform(3.0, 10.0), rng.uniform(1200.0, 3600.0)),
    )


def _perfect(chain: Chain, coupling: Floats | None) -> VirtualArm:
    """Return an arm that is exactly its drawing."""
    return VirtualArm(
        seed=0,
        nominal=chain,
        as_built=AsBuilt(chain, np.zeros(6), np.zeros(6)),
        laws=(),
        gears=Gears(np.full(6, 1e-4), np.eye(6) if coupling is None else coupling),
        joint_noise=np.zeros(6),
        tracker_noise=(0.0, 0.0),
        warming=(0.0, 1.0),
    )


def _half_gap(law: Law) -> Floats:
    """Return the half gaps (6,) [rad] of the gears of a backlash law."""
    return law.scale * np.array([-law.parameters[f"b_{j}"] for j in range(1, 7)])


def _wave(law: Law) -> Callable[[Floats], Floats]:
    """Return how wide the gaps of a backlash law are at joint angles, beside those."""
    half_gap = _half_gap(law)
    return lambda q: -law(make_arrivals(q, 1.0)) / half_gap


@dataclass(frozen=True)
class _Planter:
    """Draws the laws of one arm and gives them their sizes.

    Attributes:
        seed: Of the arm.
        body: Weights of the arm.
        rows: Length of the campaign.
        tracker: Where the tracker stands, (3,) [m].
        reference: The campaign that sizes refer to.
        perfect: An arm without any error, to measure one law at a time.
    """

    seed: int
    body: LinkMasses
    rows: int
    tracker: Floats
    reference: VirtualArrivals
    perfect: VirtualArm

    def law(self, item: Planted) -> Law:
        """Draw one law and scale it to the size asked for or drawn."""
        rng = stream(self.seed, item.name)
        draw = Draw(rng, self.body, item.joint, self.rows, self.tracker)
        if item.name == "backlash":
            law = backlash(draw)
            return self.scale_to_peak(law, item.peak_mm or self.peak_mm(law))
        kind = kind_of(item.name)
        law = kind.draw(draw).rescale(SMALL, 0.0)
        usual = np.exp(rng.uniform(np.log(kind.low_mm), np.log(kind.high_mm)))
        return self.scale_to_peak(law, item.peak_mm or float(usual))

    def scale_to_peak(self, law: Law, peak_mm: float) -> Law:
        """Scale a law to a peak displacement.

        Raises:
            PostprocError: The law moves nothing at this tool.
        """
        for _ in range(2):  # a turn's displacement is not quite linear in it
            peak = self.peak_mm(law)
            if peak < 1e-9:
                raise PostprocError(
                    f"effect '{law.effect}' on joint {law.joints} does not move this "
                    "TCP. Choose another joint or a tool that stands off the axis"
                )
            law = law.rescale(peak_mm / peak, peak_mm)
        return law

    def peak_mm(self, law: Law) -> float:
        """Return the largest displacement of the TCP over the reference [mm]."""
        arm = replace(self.perfect, laws=(law,))
        moved = arm.simulate_readings(self.reference, arm.tcp(self.reference))
        away = moved - arm.nominal_tcp(self.reference)
        return float(np.linalg.norm(away, axis=1).max() * 1e3)

    def joint_noise(self, rng: np.random.Generator) -> Floats:
        """Draw joint repeatabilities (6,) [rad] that make a usual one at the TCP."""
        noise = SMALL * rng.uniform(0.5, 1.5, 6)
        wanted = rng.uniform(*REPEATS_WITHIN)
        square = np.zeros(len(self.reference))
        centre = self.perfect.nominal_tcp(self.reference)
        for j in range(6):
            only = noise * (np.arange(6) == j)
            away = self.perfect.tcp(self.reference, only) - centre
            square += np.sum(away**2, axis=1)
        return np.asarray(noise * wanted / np.sqrt(square.mean()))
