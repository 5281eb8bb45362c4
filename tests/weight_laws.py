"""Let every joint of an arm yield beside shapes without a law, and see what is named.

    python -m tests.weight_laws [--arms 8] [--first 31000] [--given whole | plain]

All joints that carry weight yield at once; joints 1 to 3 have waves and smooth shapes
of their own angle besides. A model is fitted to a first series without compliance;
`diagnose` is given another one. Both are measured as people measure: along lines, from
row to row, without a payload. Printed is which joints are named as yielding, and what
poses along other lines are left, beside a fit that knows the true shapes.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.diagnosis.model_update import revise
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.direction import arrivals_of_rows
from postproc.robot.state import States, make_states
from postproc.simulation import (
    Planted,
    VirtualArm,
    VirtualArrivals,
    follow_rows,
    stream,
    virtual_arm,
)
from postproc.simulation.laws import Law, Where
from tests.calibration.planted import ARM, TRACKER, measurements
from tests.undeclared_trial import Known, moved

SIZES = (1.0, 2.0, 5.0)  # of compliance after projection on the base, over the noise
BESIDE = 3.0  # the same of all shapes together
YIELD = (2, 3, 4, 5)
SOFTER = {2: 1.0, 3: 0.8, 4: 0.4, 5: 0.4}  # parts of what joint 2 moves the tool by
SHAPED = (1, 2, 3)
ROWS, UNSEEN = 340, 200
LINE = 10  # rows of a line
TOOL = np.array([0.08, -0.04, 0.15])  # [m]
GIVEN = {
    "plain": BASE_EFFECTS,
    "whole": (*BASE_EFFECTS, "coupling", "transmission"),
}
LOW = np.radians([-60.0, -50.0, -60.0, -150.0, -100.0, -150.0])
HIGH = np.radians([60.0, 50.0, 60.0, 150.0, 100.0, 150.0])


@dataclass(frozen=True)
class WeightTrial:
    """One arm, diagnosed and scored.

    Attributes:
        seed, size, given: Of everything; over the noise; effects of the given model.
        found: Every finding and its group.
        named: Joints that are named as yielding, alone or in a group.
        false: Names that are not planted, nor in a group with one.
        true_mm: Unseen poses before, after, and of an informed fit.
        seconds: Processor time of the search.
    """

    seed: int
    size: float
    given: str
    found: list[list[str]]
    named: list[int]
    false: list[str]
    true_mm: tuple[float, float, float]
    seconds: float


def lines(seed: int, rows: int) -> Floats:
    """Draw rows along straight lines of joint space, (rows, 6) [rad]."""
    rng = stream(seed, "lines")
    count = -(-rows // LINE)
    ends = rng.uniform(LOW, HIGH, (2, count, 6))
    share = np.linspace(0.0, 1.0, LINE)[:, None, None]
    every: Floats = (ends[0] + share * (ends[1] - ends[0])).swapaxes(0, 1)
    return every.reshape(-1, 6)[:rows]


def smooth_shape(seed: int, joint: int) -> Law:
    """Draw a smooth error of a joint by its own angle, with two waves."""
    rng = stream(seed, f"shape {joint}")
    at = rng.uniform(LOW[joint - 1], HIGH[joint - 1], 8)
    high = rng.normal(size=8)
    orders, phase = (
        rng.choice([1.0, 2.0, 17.0, 40.0], 2, replace=False),
        rng.uniform(0, 2 * np.pi, 2),
    )

    def shape(arrivals: VirtualArrivals) -> Floats:
        q = arrivals.q[:, joint - 1]
        bumps = np.exp(-0.5 * ((q[:, None] - at) / np.radians(8.0)) ** 2) @ high
        waves = 0.5 * np.sin(orders * q[:, None] + phase).sum(axis=1)
        out = np.zeros((len(q), 6))
        out[:, joint - 1] = bumps + waves
        return out

    return Law("", Where.JOINTS, (joint,), 0, {}, shape, 1e-6)


def states_of(a: VirtualArrivals) -> States:
    """Say what a file of joint angles, in order, tells the model."""
    way = arrivals_of_rows(ARM, a.q)
    return make_states(a.q, way.direction, a.tool[:, :3, 3], travel=way.travel,
                       order=a.order)  # fmt: skip


def size_of(clean: VirtualArm, laws: Sequence[Law], a: VirtualArrivals) -> float:
    """rms of laws after projection on the base model, over the noise."""
    states = states_of(a)
    position = clean.measure(a, TRACKER, stream(clean.seed, "sizes"))
    effects = propose(BASE_EFFECTS, ARM, states)
    fit = fit_effects(ArmStates(ARM, states), position, effects, tuple(TRACKER))
    more = replace(clean, laws=(*clean.laws, *laws)).tcp(a) - clean.tcp(a)
    left = Projection.of(fit).filter(fit.whiten(more)[:, None])
    return float(np.sqrt((left**2).mean()))


def scaled(clean: VirtualArm, laws: Sequence[Law], a: VirtualArrivals,
           size: float) -> list[Law]:  # fmt: skip
    """Scale laws together to a size over the noise."""
    factor = size / size_of(clean, laws, a)
    return [replace(law, scale=law.scale * factor) for law in laws]


def drawn(seed: int, size: float) -> tuple[VirtualArm, list[Law], list[Law]]:
    """Draw an arm with its compliance and its shapes."""
    base = tuple(map(Planted, ("geometry", "tool", "backlash")))
    clean = virtual_arm(seed, base, tracker=TRACKER)
    a = follow_rows(clean, lines(seed, ROWS), tool=TOOL)
    peaks = [Planted("compliance", j, peak_mm=SOFTER[j]) for j in YIELD]
    yields = list(virtual_arm(seed, (*base, *peaks), tracker=TRACKER).laws[1:])
    shapes = [smooth_shape(seed, j) for j in SHAPED]
    return clean, scaled(clean, yields, a, size), scaled(clean, shapes, a, BESIDE)


@dataclass(frozen=True, eq=False)
class Yielding:
    """An arm that yields, a model that does not know it, and fresh rows.

    Attributes:
        clean, arm: Without and with laws.
        laws: The laws.
        fresh, unseen: What is diagnosed, and what nothing sees.
        model: Fitted to another series.
        base: The model, revised by the fresh rows.
        position: Of the fresh rows, (n, 3) [m].
    """

    clean: VirtualArm
    arm: VirtualArm
    laws: tuple[Law, ...]
    fresh: VirtualArrivals
    unseen: VirtualArrivals
    model: Model
    base: Fit
    position: Floats


def measured(seed: int, size: float, given: str, nothing: bool = False) -> Yielding:
    """Draw and measure an arm, and fit a model without compliance."""
    clean, yields, shapes = drawn(seed, size)
    laws = (*([] if nothing else yields), *shapes)
    arm = replace(clean, laws=(*clean.laws, *laws))
    first, fresh, unseen = (
        follow_rows(arm, lines(seed + k * 500_000, n), tool=TOOL)
        for k, n in enumerate((ROWS, ROWS, UNSEEN))
    )
    old, new = (
        measurements(states_of(a), arm.measure(a, TRACKER, stream(seed, n)), n)
        for a, n in ((first, "first"), (fresh, "fresh"))
    )
    model = model_of(fit_survey(old, ARM, GIVEN[given], TRACKER), old)
    base = revise(new, model, ArmStates(ARM, new.states), tuple(TRACKER))[0]
    return Yielding(clean, arm, laws, fresh, unseen, model, base, new.position)


def run(seed: int, size: float, given: str, nothing: bool = False) -> WeightTrial:
    """Draw, fit, diagnose, score."""
    y = measured(seed, size, given, nothing)
    start = time.process_time()
    traced = trace(y.base, seed=0)
    seconds = time.process_time() - start
    there = ArmStates(ARM, states_of(y.unseen))
    told = (
        y.model.error(ARM, there.states),
        moved(traced.search.fit, there, ("arm", "state")),
        _informed(y),
    )
    left = [np.linalg.norm(y.arm.error(y.unseen) - e, axis=1).mean() for e in told]
    groups = [[str(f.family), *map(str, f.rivals)] for f in traced.findings]
    yielding = {
        f.joint
        for t in traced.findings
        for f in (t.family, *t.rivals)
        if f is not None and f.effect == "compliance" and f.joint
    }
    before, after, informed = (float(1e3 * e) for e in left)
    return WeightTrial(
        seed, 0.0 if nothing else size, given, groups, sorted(yielding),
        _false(groups), (before, after, informed), seconds,
    )  # fmt: skip


FREE = ("joint_map", "transmission", "compliance", "curve", "by ")


def _false(groups: Sequence[Sequence[str]]) -> list[str]:
    """List findings with a name that nothing planted has, alone or in its group."""
    return [g[0] for g in groups if not any(any(k in x for k in FREE) for x in g)]


def _informed(y: Yielding) -> Floats:
    """Predict unseen poses by a fit that knows each planted law but for its size."""
    known = []
    for law in y.laws:
        one = replace(y.clean, laws=(*y.clean.laws, law))
        table = [one.tcp(a) - y.clean.tcp(a) for a in (y.fresh, y.unseen)]
        known.append(Known(np.concatenate(table)))
    states = states_of(y.fresh)
    effects = (*propose(BASE_EFFECTS, ARM, states), *known)
    fit = fit_effects(ArmStates(ARM, states), y.position, effects, tuple(TRACKER))
    later = states_of(y.unseen)
    later = replace(later, order=later.order + len(states))
    return moved(fit, ArmStates(ARM, later), ("arm", "state", "setup"))


def main() -> None:
    """Run what the log does not hold yet, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=8)
    parser.add_argument("--first", type=int, default=31_000)
    parser.add_argument("--given", choices=GIVEN, nargs="+", default=list(GIVEN))
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES)
    parser.add_argument("--nothing", action="store_true", help="no joint yields")
    parser.add_argument("--log", type=Path, default=Path("build/weight_laws.jsonl"))
    asked = parser.parse_args()
    asked.log.parent.mkdir(parents=True, exist_ok=True)
    for given in asked.given:
        for size in asked.sizes:
            for seed in range(asked.first, asked.first + asked.arms):
                trial = run(seed, size, given, asked.nothing)
                with asked.log.open("a") as out:
                    out.write(json.dumps(asdict(trial)) + "\n")
                before, after, informed = trial.true_mm
                print(given, size, seed, "yield", trial.named, "false", trial.false,
                      f"{before:.4f} {after:.4f} {informed:.4f}",
                      f"{trial.seconds:.0f}s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
