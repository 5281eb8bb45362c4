"""Campaigns of a virtual arm with an effect that nobody declared, of a known size."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.design_matrix import DesignMatrix, JointColumns
from postproc.calibration.diagnosis import diagnose
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.model_update import revise
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit, fit_effects
from postproc.exceptions import PostprocError
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.arm import Arm, load_arm
from postproc.robot.direction import arrivals_of_rows
from postproc.robot.state import States, make_states
from postproc.simulation import (
    Planted,
    VirtualArm,
    VirtualArrivals,
    follow_rows,
    sample_survey,
    stream,
    virtual_arm,
)
from postproc.simulation.laws import HOLLOW_WRIST, MOTOR_TURNS, Law

ARM = load_arm("nj220-2.7")
TRACKER = np.array([3.0, -2.0, 1.5])  # [m]
PAYLOADS = np.array([0.0, 40.0, 120.0])  # [kg]
BASE = ("geometry", "tool", "backlash")

NAMED = (
    "compliance", "bending", "payload", "counterbalance", "transmission",
    "transmission_free", "scale", "coupling", "load_backlash", "gravity_side",
    "thermal", "warmup", "windup", "lag", "base_shift", "tool_shift", "tracker_drift",
    "worn_spot", "joint_step", "base_tilt", "elastic_flank", "azimuth", "refraction",
)  # fmt: skip
REVISED = ("joint_offset",)  # what is one with the geometry: a model must be given
NAMELESS = ("joint_product", "hysteresis")
READINGS = ("tracker_drift", "azimuth", "refraction")  # nothing moves, it only seems to
UNTOLD = ("elastic_flank",)  # measured row by row: no travels, no directions told
WAVES = ("motor_wave", "drive_wave", "drive_backlash")  # of an arm whose gears are told
STILL = 0.01  # times the noise: what moves the tool less is not one to be blown up
SIZES = (0.3, 0.5, 1.0, 2.0)  # rms after projection on the base model over the noise


@dataclass(frozen=True)
class Campaign:
    """What an arm with undeclared effects was measured to do.

    Attributes:
        arm: The arm, its laws the truth.
        planted: The undeclared effects.
        arrivals, states: The survey, for the arm and for the model.
        position: Measured, (n, 3) [m].
        sizes: Size of every planted effect after projection, over the noise.
        declared: What the arm file says.
    """

    arm: VirtualArm
    planted: tuple[Planted, ...]
    arrivals: VirtualArrivals
    states: States
    position: np.ndarray
    sizes: tuple[float, ...]
    declared: Arm = ARM

    def base_fit(self) -> Fit:
        """Fit geometry and backlash: what a user declares, or revise such a model."""
        if any(p.name in REVISED for p in self.planted):
            return self.revised()
        effects = propose(BASE_EFFECTS, self.declared, self.states)
        batch = ArmStates(self.declared, self.states)
        return fit_effects(batch, self.position, effects, tuple(TRACKER))

    def revised(self) -> Fit:
        """Revise, by the rows, a model of the arm before its effects came."""
        seed, rows = self.arm.seed, len(self.states)
        clean = planted_arm(seed, rows=rows)
        old = survey(clean, seed + 500_000, rows)
        position = clean.measure(old, TRACKER, stream(seed, "before"))
        model = base_model(measurements(states_of(old), position, "old"), self.declared)
        batch = ArmStates(self.declared, self.states)
        fresh = measurements(self.states, self.position, "fresh")
        origin = (float(TRACKER[0]), float(TRACKER[1]), float(TRACKER[2]))
        return revise(fresh, model, batch, origin)[0]


def measurements(states: States, position: np.ndarray, name: str) -> Measurements:
    """Put states and readings together as a measurement file does."""
    n = len(states)
    ids = tuple(map(str, range(n)))
    lines = np.arange(n) + 2
    inferred = np.zeros(n, dtype=bool)
    return Measurements(Path(name), states, position, ids, lines, inferred, name)


@contextmanager
def few_parts() -> Iterator[None]:
    """Hold out two parts of the rows, not five: each repeats the whole search."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnose, "PARTS", 2)
        yield


def base_model(rows: Measurements, arm: Arm = ARM) -> Model:
    """Fit what a user declares, and keep it as a model."""
    return model_of(fit_survey(rows, arm, BASE_EFFECTS, TRACKER), rows)


def campaign(
    seed: int, kinds: tuple[str, ...], size: float, rows: int = 400
) -> Campaign:
    """Measure an arm with undeclared effects.

    Args:
        seed: Draws the arm, its effects and the campaign.
        kinds: Names of the undeclared effects.
        size: rms of each after projection on the base model over the noise; 0 leaves
            the usual size that was drawn.
        rows: Number of rows.
    """
    wrist = coupling_of(kinds)
    clean = planted_arm(seed, coupling=wrist, rows=rows)
    untold = not set(kinds).isdisjoint(UNTOLD)
    arrivals = (row_by_row if untold else survey)(clean, seed, rows)
    planted = tuple(Planted(kind) for kind in kinds)
    reached = tuple(_size(clean, seed, p, arrivals, rows) for p in planted)
    if size > 0 and any(reach < STILL for reach in reached):
        raise PostprocError(f"one of {', '.join(kinds)} moves nothing")
    if size > 0:
        planted = tuple(
            replace(p, peak_mm=float(_peak(seed, p, rows) * size / was))
            for p, was in zip(planted, reached, strict=True)
        )
        reached = (size,) * len(kinds)
    arm = planted_arm(seed, *planted, coupling=wrist, rows=rows)
    position = arm.measure(arrivals, TRACKER, stream(seed, "tracker"))
    states = states_of(arrivals)
    if untold:
        ways = arrivals_of_rows(ARM, arrivals.q)
        states = states.with_(direction=ways.direction, travel=ways.travel)
    told = declared(kinds)
    return Campaign(arm, planted, arrivals, states, position, reached, told)


def planted_arm(
    seed: int, *planted: Planted, coupling: np.ndarray | None = None, rows: int
) -> VirtualArm:
    """Draw the arm of a campaign."""
    every = (*map(Planted, BASE), *planted)
    return virtual_arm(seed, every, coupling=coupling, rows=rows, tracker=TRACKER)


def row_by_row(arm: VirtualArm, seed: int, rows: int) -> VirtualArrivals:
    """Send an arm straight from row to row: to where it approaches from, then there."""
    told = survey(arm, seed, rows)
    half = rows // 2
    way = told.travel[:half] * np.sign(told.side[:half])
    q = np.stack([told.q[:half] - way, told.q[:half]], axis=1).reshape(-1, 6)
    kept = ("speed", "time", "temperature", "payload", "payload_com")
    same = {name: getattr(told, name)[: len(q)] for name in kept}
    return follow_rows(arm, q, tool=told.tool[: len(q)], **same)


def coupling_of(kinds: tuple[str, ...]) -> np.ndarray | None:
    """The wrist gears of the arm that effects are planted in, None: not coupled."""
    return HOLLOW_WRIST if any(k.startswith("drive_") for k in kinds) else None


def declared(kinds: tuple[str, ...]) -> Arm:
    """The arm as its file says: with gears where waves of gears are planted."""
    if not set(kinds) & set(WAVES):
        return ARM
    wrist = coupling_of(kinds)
    coupling = ARM.coupling if wrist is None else wrist
    return replace(ARM, gear_ratio=np.array(MOTOR_TURNS), coupling=coupling)


def survey(arm: VirtualArm, seed: int, rows: int) -> VirtualArrivals:
    """Send an arm to random poses with three payloads."""
    payload = stream(seed, "payload").choice(PAYLOADS, rows)
    return sample_survey(arm, rows, seed=seed, payload=payload)


def states_of(a: VirtualArrivals) -> States:
    """Translate arrivals into what a measurement file tells the model."""
    return make_states(
        a.q, np.sign(a.side), a.tool[:, :3, 3], travel=a.travel, speed=a.speed,
        time=a.time, temperature=a.temperature, payload=a.payload,
        payload_com=a.payload_com, order=a.order,
    )  # fmt: skip


def seen_error(arm: VirtualArm, arrivals: VirtualArrivals) -> np.ndarray:
    """What a perfect tracker on a stand that may move would read, less the nominal."""
    return arm.simulate_readings(arrivals, arm.tcp(arrivals)) - arm.nominal_tcp(
        arrivals
    )


def displacement(
    clean: VirtualArm, seed: int, planted: Planted, arrivals: VirtualArrivals, rows: int
) -> np.ndarray:
    """What one undeclared effect adds to the noise-free readings, (n, 3) [m]."""
    arm = planted_arm(seed, planted, rows=rows)
    return seen_error(arm, arrivals) - seen_error(clean, arrivals)


def part_sizes(c: Campaign) -> dict[int, float]:
    """Sizes of the parts of a law of several joints, by joint, over the noise.

    Each is the rms of one joint's part after projection on the base model and on the
    other parts: what nothing else can absorb.
    """
    many = [x for x in c.arm.laws[1:] if len(x.joints) > 1 and not x.source]
    if not many:
        return {}
    (law,) = many
    none = replace(c.arm, laws=tuple(x for x in c.arm.laws if x is not law))
    clean = _clean_fit(none, c.arm.seed, c.arrivals)
    filtered = Projection.of(clean)
    start = seen_error(none, c.arrivals)
    parts = []
    for joint in law.joints:
        alone = replace(none, laws=(*none.laws, _only(law, joint)))
        moved = seen_error(alone, c.arrivals) - start
        parts.append(filtered.filter(clean.whiten(moved)[:, None])[:, 0])
    sizes = {}
    for k, joint in enumerate(law.joints):
        others = np.column_stack([p for i, p in enumerate(parts) if i != k])
        left = parts[k] - others @ np.linalg.lstsq(others, parts[k])[0]
        sizes[joint] = float(np.sqrt((left**2).mean()))
    return sizes


def _only(law: Law, joint: int) -> Law:
    """Keep what a law does to one joint."""
    mask = np.arange(1, 7) == joint
    return replace(law, joints=(joint,), shape=lambda a: law.shape(a) * mask)


def _peak(seed: int, planted: Planted, rows: int) -> float:
    """The peak size [mm] that a law was drawn with."""
    arm = planted_arm(seed, planted, rows=rows)
    return arm.laws[-1].peak_mm


def _size(
    clean: VirtualArm, seed: int, planted: Planted, arrivals: VirtualArrivals, rows: int
) -> float:
    """rms of an effect after projection on the base model, in units of the noise."""
    fit = _clean_fit(clean, seed, arrivals)
    added = fit.whiten(displacement(clean, seed, planted, arrivals, rows))
    if planted.name in REVISED:
        return float(np.sqrt((added**2).mean()))
    left = Projection.of(fit).filter(added[:, None])[:, 0]
    return float(np.sqrt((left**2).mean()))


def _clean_fit(clean: VirtualArm, seed: int, arrivals: VirtualArrivals) -> Fit:
    """Fit the base model to the arm without undeclared effects."""
    position = clean.measure(arrivals, TRACKER, stream(seed, "tracker"))
    effects = propose(BASE_EFFECTS, ARM, states_of(arrivals))
    batch = ArmStates(ARM, states_of(arrivals))
    return fit_effects(batch, position, effects, tuple(TRACKER))


def plain_design(X: np.ndarray) -> DesignMatrix:
    """Take columns (3 n, p) as those of effects that turn no joint."""
    n, none = len(X) // 3, np.zeros(0, dtype=np.int64)
    turning = JointColumns(none, none, np.zeros((n, 0)))
    columns = X.reshape(n, 3, -1)
    places = np.arange(X.shape[1])
    return DesignMatrix(np.zeros((n, 3, 6)), turning, (), columns, places)
