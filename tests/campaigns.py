"""Campaigns as people measure: repeats, nests, rounds, rounded angles, one side or two.

python -m tests.campaigns [--count 50] [--first 0] [--poses LOW HIGH] [--jobs 2]

Every campaign is of an arm of its own. Printed are the true errors at poses that no
fit has seen, of the default fit and of `geometry,backlash`, and how many of the stated
intervals hold them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from postproc.calibration.fit import Calibration, fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.exceptions import PostprocError
from postproc.robot.cell import Cell, load_cell
from postproc.robot.state import States, make_states
from tests.calibration.simulator import (
    HIGH,
    LOW,
    PLATE,
    Simulated,
    random_arm,
    survey_of,
)
from tests.reference import generalised_least_squares as gls

CHECKED = 400  # poses that no fit has seen
MOST_ROWS = 1800
PLAIN = ("geometry", "backlash")


@dataclass(frozen=True)
class Habit:
    """How somebody measures.

    Attributes:
        poses: Number of commanded poses.
        repeats: Readings while the arm stands still.
        nests: Probe points that are read at every stop.
        rounds: Times that all poses are visited.
        sides: 1, or 2 where every pose is approached from both sides.
        decimals: Of the joint angles in the file [deg].
        joint: Scatter of joint angles from stop to stop [rad].
        shift: Scatter of a stop per axis [m].
        tracker: Scatter of a reading per axis [m].
        clock: Whether the file has times.
    """

    poses: int
    repeats: int
    nests: int
    rounds: int
    sides: int
    decimals: int
    joint: float
    shift: float
    tracker: float
    clock: bool


def draw_habit(rng: np.random.Generator, low: int, high: int) -> Habit:
    """Draw how a campaign is measured, of `low` to `high` poses."""
    poses = int(np.exp(rng.uniform(np.log(low), np.log(high))))
    habit = Habit(
        poses=poses,
        repeats=int(rng.choice([1, 1, 2, 3, 5, 10])),
        nests=int(rng.choice([1, 1, 2, 3])),
        rounds=int(rng.choice([1, 1, 1, 2, 3])),
        sides=int(rng.choice([1, 2])),
        decimals=int(rng.choice([1, 2, 3, 4, 5])),
        joint=float(rng.choice([0.0, 5e-6, 2e-5])),
        shift=float(rng.choice([0.0, 1e-5, 3e-5, 8e-5])),
        tracker=float(rng.choice([1e-5, 2e-5, 4e-5])),
        clock=bool(rng.integers(2)),
    )
    while rows_of(habit) > MOST_ROWS and (habit.repeats > 1 or habit.rounds > 1):
        habit = replace(
            habit, repeats=max(1, habit.repeats // 2), rounds=max(1, habit.rounds - 1)
        )
    return habit


def rows_of(habit: Habit) -> int:
    """Count the rows of a campaign."""
    return habit.poses * habit.repeats * habit.nests * habit.rounds * habit.sides


def measure(arm: Simulated, habit: Habit, rng: np.random.Generator) -> Measurements:
    """Measure an arm; the angles in the file are rounded, those of the arm are not."""
    q = rng.uniform(LOW, HIGH, (habit.poses, 6))
    one_side = rng.choice([-1.0, 1.0], (habit.poses, 6))
    rows: list[tuple[np.ndarray, np.ndarray, int, float]] = []
    position, clock = [], 0.0
    for _ in range(habit.rounds):
        for k in range(habit.poses):
            for side in range(habit.sides):
                came = one_side[k] if side == 0 else -one_side[k]
                shaken = q[k] + habit.joint * rng.standard_normal(6)
                shift = habit.shift * rng.standard_normal(3)
                clock += rng.uniform(8.0, 12.0)
                for nest in range(habit.nests):
                    at = arm.tcp(shaken[None], came[None], PLATE[nest][None])[0] + shift
                    for _ in range(habit.repeats):
                        clock += 0.5
                        rows.append((q[k], came, nest, clock))
                        position.append(at + habit.tracker * rng.standard_normal(3))
    angles = np.round(np.rad2deg([r[0] for r in rows]), habit.decimals)
    nests = np.array([r[2] for r in rows])
    states = make_states(
        np.deg2rad(angles), np.array([r[1] for r in rows]), PLATE[nests], tool_id=nests
    )
    if habit.clock:
        states = states.with_(time=np.array([r[3] for r in rows]))
    return survey_of(states, np.array(position))


def best_possible(
    arm: Simulated,
    habit: Habit,
    survey: Measurements,
    checked: tuple[States, np.ndarray],
) -> float:
    """Return what generalised least squares with all that is true leaves [mm]."""
    n = len(survey)
    stop = np.arange(n) // (habit.repeats * habit.nests)
    step = np.deg2rad(10.0**-habit.decimals)
    scatter = gls.Scatter(
        habit.joint, habit.shift, habit.tracker, float(step / np.sqrt(12.0))
    )
    p = gls.solve(arm.arm, survey.states, survey.position, stop, scatter)
    states, true = checked
    at = states.q, states.direction, states.tool
    nominal = gls.place(arm.arm, *at, np.zeros(len(p)))
    off = gls.place(arm.arm, *at, p) - nominal - true
    return 1e3 * float(np.linalg.norm(off, axis=1).mean())


def unseen(arm: Simulated, rng: np.random.Generator) -> tuple[States, np.ndarray]:
    """Draw poses that no fit has seen, with the true error of the arm, (n, 3) [m]."""
    q = rng.uniform(LOW, HIGH, (CHECKED, 6))
    side = rng.choice([-1.0, 1.0], (CHECKED, 6))
    states = make_states(q, side, PLATE[:1].repeat(CHECKED, axis=0))
    true = arm.tcp(q, side, states.tool)
    return states, true - arm.arm.tcp(q, states.tool)


@dataclass(frozen=True)
class Outcome:
    """What a fit leaves of the true errors.

    Attributes:
        mean, worst: Length of what is left [mm].
        covered: Share of coordinates within the stated 95 % intervals.
        stated: Mean stated standard error per axis [mm].
        names: Effects of the model that the arm has not.
        seconds: Time that the fit took.
    """

    mean: float
    worst: float
    covered: float
    stated: float
    names: tuple[str, ...]
    seconds: float


def judge(
    survey: Measurements,
    cell: Cell,
    effects: tuple[str, ...] | None,
    checked: tuple[States, np.ndarray],
) -> Outcome | str:
    """Fit a survey and compare with the truth; words where it was refused."""
    begun = time.perf_counter()
    try:
        found: Calibration = fit_measurements(
            survey, cell, effects=effects, validate=effects is None
        )
    except PostprocError as refused:
        return str(refused)
    seconds = time.perf_counter() - begun
    states, true = checked
    predicted = found.model.predict(cell.arm, states)
    off = predicted.error - true
    size = 1e3 * np.linalg.norm(off, axis=1)
    covered = float((np.abs(off) < 1.96 * predicted.std_model).mean())
    named = [e.name for e in found.model.effects.effects]
    planted = {"geometry", "backlash", "backlash_profile", "probe"}
    if found.rejected:
        return "rejected: " + found.rejected
    return Outcome(
        float(size.mean()), float(size.max()), covered,
        1e3 * float(predicted.std_model.mean()),
        tuple(n for n in named if n not in planted), seconds,
    )  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """One campaign and what came of it.

    Attributes:
        seed: Of the draw.
        habit: How it was measured.
        full, plain: Of the default fit, and of `geometry,backlash`.
        best: What is possible at best [mm].
        refused: Why there is no model; "" where there is one.
    """

    seed: int
    habit: Habit
    full: Outcome | None
    plain: Outcome | None
    best: float
    refused: str = ""

    def __str__(self) -> str:
        h = self.habit
        what = (
            f"{self.seed:4d} {h.poses:3d} poses x{h.repeats} n{h.nests} r{h.rounds} "
            f"s{h.sides} .{h.decimals} j{h.joint * 1e6:2.0f} d{h.shift * 1e6:2.0f} "
            f"t{h.tracker * 1e6:2.0f}"
        )
        if self.full is None or self.plain is None:
            return f"{what}: {self.refused}"
        return (
            f"{what}: {self.full.mean:.4f} (max {self.full.worst:.3f}) plain "
            f"{self.plain.mean:.4f} best {self.best:.4f} covered "
            f"{self.full.covered:.3f} stated {self.full.stated:.4f} "
            f"{self.full.seconds:.1f} s {' '.join(self.full.names)}"
        )


def run(seed: int, low: int, high: int) -> Trial:
    """Draw, measure and judge one campaign."""
    cell = load_cell("programs/cell.toml")
    rng = np.random.default_rng([20261126, seed])
    arm, habit = random_arm(rng), draw_habit(rng, low, high)
    if seed % 2:
        arm.backlash[:, 1:] = 0.0  # gaps that are the same at every angle
    survey, checked = measure(arm, habit, rng), unseen(arm, rng)
    full = judge(survey, cell, None, checked)
    plain = judge(survey, cell, PLAIN, checked)
    best = best_possible(arm, habit, survey, checked)
    if isinstance(full, str) or isinstance(plain, str):
        return Trial(seed, habit, None, None, best, f"{full} {plain}")
    return Trial(seed, habit, full, plain, best)


KINDS: dict[str, Callable[[Habit], bool]] = {
    "all": lambda _: True,
    "several readings at a stop": lambda h: h.repeats > 1,
    "several nests": lambda h: h.nests > 1,
    "rounds": lambda h: h.rounds > 1,
    "both sides": lambda h: h.sides == 2,
    "one side": lambda h: h.sides == 1,
    "two decimals or fewer": lambda h: h.decimals <= 2,
    "three decimals or more": lambda h: h.decimals >= 3,
    "100 poses or fewer": lambda h: h.poses <= 100,
    "more than 100 poses": lambda h: h.poses > 100,
}


def summary(trials: Sequence[Trial]) -> list[str]:
    """Write the table of the page, a line a kind of campaign."""
    out = [
        "| campaigns | n | default / `geometry,backlash`, mean and max | "
        "default / best possible, median, 90 %, max | intervals hold | false names |",
        "|---|---|---|---|---|---|",
    ]
    for name, kind in KINDS.items():
        some = [t for t in trials if t.full and t.plain and kind(t.habit)]
        if not some:
            continue
        ratio = np.array([t.full.mean / t.plain.mean for t in some])  # type: ignore[union-attr]
        best = np.array([t.full.mean / t.best for t in some])  # type: ignore[union-attr]
        held = float(np.mean([t.full.covered for t in some]))  # type: ignore[union-attr]
        false = sum(bool(t.full.names) for t in some)  # type: ignore[union-attr]
        out.append(
            f"| {name} | {len(some)} | {ratio.mean():.3f}, {ratio.max():.3f} | "
            f"{np.median(best):.2f}, {np.quantile(best, 0.9):.2f}, {best.max():.2f} | "
            f"{held:.1%} | {false} |"
        )
    fitted = sorted(
        (t.full for t in trials if t.full is not None), key=lambda o: o.stated
    )
    held = [
        f"{np.mean([o.covered for o in some]):.1%}"
        for some in np.array_split(np.array(fitted, dtype=object), 4)
    ]
    refused = sum(t.full is None for t in trials)
    out.append("")
    out.append(f"Quartiles of the stated error: intervals hold {', '.join(held)}.")
    out.append(f"No model is written for {refused} of {len(trials)}.")
    return out


def main() -> None:
    """Run campaigns, print a line for each and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--poses", type=int, nargs=2, default=(20, 300))
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args()
    trials = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        seeds = range(asked.first, asked.first + asked.count)
        low, high = asked.poses
        for trial in pool.map(run, seeds, [low] * len(seeds), [high] * len(seeds)):
            print(trial, flush=True)
            trials.append(trial)
    print("\n".join(summary(trials)))


if __name__ == "__main__":
    main()
