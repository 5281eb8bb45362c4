"""Campaigns as people measure: repeats, nests, rounds, walls, stations, lost clocks.

python -m tests.campaigns [--count 50] [--first 0] [--jobs 2] [--log FILE]

Every campaign is of an arm of its own, written as files and read by the product.
Printed are the true errors at poses that no fit has seen: of the default fit, of
`geometry,backlash`, of the default fit of files that say visits, times and mounting,
and of generalised least squares; and how many of the stated intervals hold them.
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from postproc.calibration.fit import Calibration, Frame, fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.calibration.stops import pool_readings
from postproc.exceptions import PostprocError
from postproc.model.kinematics import ArmStates
from postproc.model.model import READING, Model
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.state import States
from tests.calibration.simulator import Simulated, random_arm
from tests.campaign_files import Setup, as_filed, as_informed, draw_setup, placed
from tests.campaign_rows import (
    SOFT,
    Habit,
    Yielding,
    as_mounted,
    best_possible,
    draw_habit,
    measure,
    unseen,
)

PLAIN = ("geometry", "backlash")
GROUP = 0.9  # of what an effect does that others can do as well
ASKED = (
    "the rows are strong evidence that weight"  # begins the question about the mounting
)


@dataclass(frozen=True)
class Outcome:
    """What a fit leaves of the true errors.

    Attributes:
        mean, worst: Length of what is left [mm].
        covered: Share of coordinates within the stated 95 % intervals.
        stated: Mean stated standard error per axis [mm].
        ratio: Root of the mean squared ratio of errors to stated standard errors.
        names: Effects of the model that the arm has not.
        seconds: Time that the fit took.
        asked: Whether the direction of weight is asked about.
    """

    mean: float
    worst: float
    covered: float
    stated: float
    ratio: float
    names: tuple[str, ...]
    seconds: float
    asked: bool


KNOWN = {
    "geometry", "backlash", "backlash_profile", "probe", "registration",
    "station_shift",
}  # fmt: skip


def judge(
    survey: Measurements,
    cell: Cell,
    effects: tuple[str, ...] | None,
    checked: tuple[States, np.ndarray],
    frame: Frame = "base",
    arm: Simulated | None = None,
) -> Outcome | str:
    """Fit a survey and compare with the truth; words where it was refused.

    Args:
        survey: The rows.
        cell: The cell.
        effects: Names of effects, None for the default.
        checked: Poses that no fit has seen, with the true errors.
        frame: Frame of the rows.
        arm: The true arm, if its joints may yield.
    """
    begun = time.perf_counter()
    try:
        found: Calibration = fit_measurements(
            survey, cell, effects=effects, frame=frame, validate=effects is None
        )
    except PostprocError as refused:
        return str(refused)
    seconds = time.perf_counter() - begun
    if found.rejected:
        return "rejected: " + found.rejected
    off, std = errors(found.model, cell.arm, checked)
    size = 1e3 * np.linalg.norm(off, axis=1)
    return Outcome(
        float(size.mean()), float(size.max()),
        float((np.abs(off) < 1.96 * std).mean()), 1e3 * float(std.mean()),
        float(np.sqrt(((off / std) ** 2).mean())),
        false_names(found, cell.arm, arm), seconds,
        any(ASKED in w for w in found.report.warnings),
    )  # fmt: skip


def false_names(
    found: Calibration, arm: Arm, true: Simulated | None
) -> tuple[str, ...]:
    """List the effects of a model that the arm has not.

    What moves the tool as errors of geometry and joints that yield do, in the poses of
    the survey, is of their group: by `GROUP` of its square.
    """
    yields = isinstance(true, Yielding)
    states, c = found.survey.states, found.model.effects
    batch, named, own = ArmStates(arm, states), [], []
    if yields:
        load = true.torque(states.q)[:, None, list(SOFT)]  # type: ignore[union-attr]
        own.append(batch.jacobian[:, :, list(SOFT)] * load)
    own += [e.columns(batch) for e in c.effects if e.name == "geometry"]
    X = np.concatenate(own, axis=2).reshape(3 * len(states), -1)
    X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    for effect, part in zip(c.effects, c.slices, strict=True):
        if effect.name in KNOWN or (yields and effect.name == "compliance"):
            continue
        moved = (effect.columns(batch) @ found.model.values[part]).reshape(-1)
        rest = moved - X @ np.linalg.lstsq(X, moved, rcond=1e-9)[0]
        if rest @ rest > (1.0 - GROUP) * (moved @ moved):
            named.append(effect.name)
    return tuple(named)


def errors(
    model: Model, arm: Arm, checked: tuple[States, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what a model is off by, and its stated standard errors, (n, 3) [m] each.

    In the base frame the error of the arm is asked, in the tracker's frame what the
    tracker reads at its first station, without scatter.
    """
    states, true = checked
    registered = model.registration
    if registered is None:
        predicted = model.predict(arm, states)
        return predicted.error - true, predicted.std_model
    there = registered.on_probes(states)
    T = placed(0)
    read = (arm.tcp(states.q, states.tool) + true - T[:3, 3]) @ T[:3, :3]
    at = registered.to_base(read) - ArmStates(arm, there).walk.tcp
    still = replace(model.noise, tracker=0.0, joint=0.0, stop=0.0, rounding=0.0)
    sure = {k: v for k, v in model.statistics.items() if k != READING}
    predicted_read = replace(model, noise=still, statistics=sure).reading(arm, there)
    return predicted_read.error - at, predicted_read.std


@dataclass(frozen=True)
class Trial:
    """One campaign and what came of it.

    Attributes:
        seed: Of the draw.
        habit, setup: How it was measured, and how the arm stood.
        full, plain: Of the default fit, and of `geometry,backlash`.
        informed: Of the default fit of files that say all.
        best: What is possible at best [mm].
        refused: Why there is no model; "" where there is one.
    """

    seed: int
    habit: Habit
    setup: Setup
    full: Outcome | None
    plain: Outcome | None
    informed: Outcome | None
    best: float
    refused: str = ""

    @property
    def loss(self) -> float:
        """How much more is left than by a fit of files that say all."""
        if self.full is None or self.informed is None:
            return np.nan
        return self.full.mean / self.informed.mean

    def __str__(self) -> str:
        h = self.habit
        what = (
            f"{self.seed:4d} {h.poses:3d} poses x{h.repeats} n{h.nests} r{h.rounds} "
            f"s{h.sides} .{h.decimals} j{h.joint * 1e6:2.0f} d{h.shift * 1e6:2.0f} "
            f"t{h.tracker * 1e6:2.0f}{' clock' if h.clock else ''} {self.setup}"
        )
        if self.full is None or self.plain is None:
            return f"{what}: {self.refused}"
        asked = " asked" if self.full.asked else ""
        return (
            f"{what}: {self.full.mean:.4f} (max {self.full.worst:.3f}) plain "
            f"{self.plain.mean:.4f} informed {self.loss:.3f} best {self.best:.4f} "
            f"covered {self.full.covered:.3f} z {self.full.ratio:.2f} stated "
            f"{self.full.stated:.4f} {self.full.seconds:.1f} s"
            f"{asked} {' '.join(self.full.names)}"
        )


def run(seed: int, low: int, high: int) -> Trial:
    """Draw, measure and judge one campaign."""
    rng = np.random.default_rng([20261126, seed])
    stand = np.random.default_rng([20261126, seed, 1])
    arm, habit = random_arm(rng), draw_habit(rng, low, high)
    setup = draw_setup(stand, habit.poses, habit.sides, habit.clock)
    if seed % 2:
        arm.backlash[:, 1:] = 0.0  # gaps that are the same at every angle
    arm = as_mounted(arm, setup, stand)
    survey, checked = measure(arm, habit, rng, setup), unseen(arm, rng)
    best = best_possible(arm, habit, survey, checked, setup)
    with tempfile.TemporaryDirectory() as folder:
        rows, cell = as_filed(Path(folder), survey, setup, habit.clock)
        told, other = as_informed(Path(folder), survey, setup)
    usual = (checked, setup.frame, arm)
    full = judge(rows, cell, None, *usual)
    plain = judge(rows, cell, PLAIN, *usual)
    informed = full
    if not alike(rows, told, cell, other):
        informed = judge(told, other, None, *usual)
    if isinstance(full, str) or isinstance(plain, str):
        return Trial(
            seed, habit, setup, None, None, None, best, f"{full} {plain} {informed}"
        )
    said = informed if isinstance(informed, Outcome) else None
    return Trial(seed, habit, setup, full, plain, said, best)


def alike(a: Measurements, b: Measurements, cell: Cell, other: Cell) -> bool:
    """Return True if two files of a campaign say the same to a fit."""
    if not np.array_equal(cell.arm.weight, other.arm.weight):
        return False
    a, b = pool_readings(a), pool_readings(b)
    if len(a) != len(b) or not np.allclose(a.position, b.position, atol=1e-9):
        return False
    same = np.array_equal(np.diff(a.states.order) == 0, np.diff(b.states.order) == 0)
    sides = np.array_equal(a.states.direction, b.states.direction)
    clock = np.array_equal(np.isnan(a.states.time), np.isnan(b.states.time))
    return same and sides and clock


Kind = Callable[[Habit, Setup], bool]
KINDS: dict[str, Kind] = {
    "all": lambda h, s: True,
    "several readings at a stop": lambda h, s: h.repeats > 1,
    "several nests": lambda h, s: h.nests > 1,
    "rounds": lambda h, s: h.rounds > 1,
    "one round": lambda h, s: h.rounds == 1,
    "both sides": lambda h, s: h.sides == 2,
    "one side": lambda h, s: h.sides == 1,
    "two decimals or fewer": lambda h, s: h.decimals <= 2,
    "three decimals or more": lambda h, s: h.decimals >= 3,
    "100 poses or fewer": lambda h, s: h.poses <= 100,
    "more than 100 poses": lambda h, s: h.poses > 100,
    "no clock": lambda h, s: not h.clock,
    "rows newest first, or shuffled": lambda h, s: s.rows != "as measured",
    "directions by the order of visits": lambda h, s: not s.directions,
    "joints yield, on a floor": lambda h, s: s.yields and not s.tilted,
    "wall, ceiling, incline, stated": lambda h, s: s.tilted and s.said != "",
    "wall, ceiling, incline, not stated": lambda h, s: s.tilted and s.said == "",
    "frame of one tracker": lambda h, s: s.stations == 1,
    "two stations": lambda h, s: s.stations == 2,
}


def summary(trials: Sequence[Trial]) -> list[str]:
    """Write the table of the page, a line a kind of campaign."""
    out = [
        "| campaigns | n | default / `geometry,backlash`, mean and max | "
        "default / complete files, 95 % and max | "
        "default / best possible, median, 90 %, max | intervals hold | false names |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, kind in KINDS.items():
        some = [t for t in trials if t.full and kind(t.habit, t.setup)]
        if some:
            out.append(f"| {name} | {_row(some)} |")
    fitted = sorted(
        (t.full for t in trials if t.full is not None), key=lambda o: o.stated
    )
    held = [
        f"{np.mean([o.covered for o in some]):.1%}"
        for some in np.array_split(np.array(fitted, dtype=object), 4)
    ]
    refused = sum(t.full is None for t in trials)
    loss = np.array([t.loss for t in trials if t.informed])
    out.append("")
    out.append(f"Quartiles of the stated error: intervals hold {', '.join(held)}.")
    out.append(
        f"At most 1.15 times the error of a fit of complete files: "
        f"{(loss <= 1.15).mean():.1%} of {len(loss)}."
    )
    large = [t.full.mean / t.best for t in trials if t.full and t.habit.poses >= 60]
    asked = sum(ASKED in t.refused or bool(t.full and t.full.asked) for t in trials)
    untold = sum(t.setup.tilted and t.setup.said == "" for t in trials)
    out.append(
        f"The direction of weight is asked about in {asked}; it differs and is not "
        f"told in {untold}."
    )
    out.append(
        f"At most 1.5 times the best possible, 60 poses or more: "
        f"{np.mean(np.array(large) <= 1.5):.1%} of {len(large)}."
    )
    out.append(f"No model is written for {refused} of {len(trials)}.")
    return out


def _row(some: Sequence[Trial]) -> str:
    """Write the cells of a kind of campaign."""
    pairs = [(t, t.full, t.plain) for t in some if t.full and t.plain]
    ratio = np.array([full.mean / plain.mean for _, full, plain in pairs])
    best = np.array([full.mean / t.best for t, full, _ in pairs])
    loss = np.array([t.loss for t in some if t.informed])
    held = float(np.mean([full.covered for _, full, _ in pairs]))
    false = sum(bool(full.names) for _, full, _ in pairs)
    return (
        f"{len(some)} | {ratio.mean():.3f}, {ratio.max():.3f} | "
        f"{np.quantile(loss, 0.95):.2f}, {loss.max():.2f} | "
        f"{np.median(best):.2f}, {np.quantile(best, 0.9):.2f}, {best.max():.2f} | "
        f"{held:.1%} | {false}"
    )


def logged(log: Path) -> Iterator[Trial]:
    """Yield the trials of a log."""
    if not log.exists():
        return
    with log.open("rb") as file:
        while True:
            try:
                yield pickle.load(file)
            except EOFError:
                return


def main() -> None:
    """Run what the log does not hold yet; print a line for each and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--poses", type=int, nargs=2, default=(20, 300))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--log", type=Path, default=Path("build/campaigns.pickles"))
    asked = parser.parse_args()
    asked.log.parent.mkdir(parents=True, exist_ok=True)
    known = {trial.seed: trial for trial in logged(asked.log)}
    seeds = range(asked.first, asked.first + asked.count)
    todo, (low, high) = [s for s in seeds if s not in known], asked.poses
    with ProcessPoolExecutor(asked.jobs) as pool, asked.log.open("ab") as out:
        for trial in pool.map(run, todo, [low] * len(todo), [high] * len(todo)):
            print(trial, flush=True)
            pickle.dump(trial, out)
            out.flush()
            known[trial.seed] = trial
    print("\n".join(summary([known[seed] for seed in seeds])))


if __name__ == "__main__":
    main()
