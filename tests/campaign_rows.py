"""Campaigns as people measure: what an arm, its tracker and somebody's habits read."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.calibration.measurements import Measurements
from postproc.robot.state import States, make_states
from tests.calibration.simulator import HIGH, LOW, PLATE, Simulated, survey_of
from tests.campaign_files import Setup, placed
from tests.reference import generalised_least_squares as gls
from tests.reference.weight import torque

CHECKED = 400  # poses that no fit has seen
MOST_ROWS = 1800
SOFT = (1, 2, 4)  # axes, from 0, that yield to the weight
SOFTEST = 5e-4  # [rad] that a joint is expected to yield to its largest torque
FAR, REACH = 0.1, 0.3  # [m], [rad] priors of trackers and nests that nobody knows


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


@dataclass
class Yielding(Simulated):
    """An arm with errors, whose joints yield to the weight.

    Attributes:
        soft: Softness of every joint, (6,) [rad/(N m)].
        mass: Of the links, (6,) [kg].
        pull: Direction in which weight pulls, (3,).
    """

    soft: np.ndarray | None = None
    mass: np.ndarray | None = None
    pull: np.ndarray | None = None

    def torque(self, q: np.ndarray) -> np.ndarray:
        """Torque of the weight about every joint, (n, 6) [N m]."""
        assert self.mass is not None and self.pull is not None
        return torque(self.arm, q, self.mass, self.pull)

    def joint_error(self, q: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Add what the joints yield by."""
        return super().joint_error(q, side) + self.soft * self.torque(q)


def as_mounted(arm: Simulated, setup: Setup, rng: np.random.Generator) -> Simulated:
    """Let an arm's joints yield; its links weigh a little else than nominal."""
    if not setup.yields:
        return arm
    links = arm.arm.file.links
    assert links is not None
    soft = np.zeros(6)
    soft[list(SOFT)] = setup.soft
    mass = np.array(links.mass_kg) * (1.0 + 0.05 * rng.standard_normal(6))
    pull = np.array(setup.weight) / np.linalg.norm(setup.weight)
    return Yielding(
        **{name: getattr(arm, name) for name in arm.__dataclass_fields__},
        soft=soft, mass=mass, pull=pull,
    )  # fmt: skip


AS_USUAL = Setup()


def measure(
    arm: Simulated, habit: Habit, rng: np.random.Generator, setup: Setup = AS_USUAL
) -> Measurements:
    """Measure an arm; the angles in the file are rounded, those of the arm are not.

    Returns:
        Rows in the order of visits, positions in the base frame.
    """
    q = rng.uniform(LOW, HIGH, (habit.poses, 6))
    one_side = rng.choice([-1.0, 1.0], (habit.poses, 6))
    rows: list[tuple[np.ndarray, np.ndarray, int, float, int, int]] = []
    position, clock, stop, last = [], 0.0, 0, np.zeros(6)
    for _ in range(habit.rounds):
        for k in range(habit.poses):
            for side in range(habit.sides):
                came = one_side[k] if side == 0 else -one_side[k]
                if not setup.directions and stop > 0:
                    came = np.where(q[k] > last, 1.0, -1.0)
                shaken = q[k] + habit.joint * rng.standard_normal(6)
                shift = habit.shift * rng.standard_normal(3)
                clock += rng.uniform(8.0, 12.0)
                station = 0
                if setup.stations > 1:  # the tracker is moved once
                    half = habit.rounds * habit.poses * habit.sides // 2
                    station = int(stop >= half)
                for nest in range(habit.nests):
                    at = arm.tcp(shaken[None], came[None], PLATE[nest][None])[0] + shift
                    size = tracker_std(habit, setup, at, station)
                    for _ in range(habit.repeats):
                        clock += 0.5
                        rows.append((q[k], came, nest, clock, stop, station))
                        position.append(at + size * rng.standard_normal(3))
                stop, last = stop + 1, q[k]
    angles = np.round(np.rad2deg([r[0] for r in rows]), habit.decimals)
    nests = np.array([r[2] for r in rows])
    states = make_states(
        np.deg2rad(angles), np.array([r[1] for r in rows]), PLATE[nests], tool_id=nests,
        station=np.array([r[5] for r in rows]),
    )  # fmt: skip
    if habit.clock or setup is not AS_USUAL:
        states = states.with_(time=np.array([r[3] for r in rows]))
    found = survey_of(states, np.array(position))
    if setup is AS_USUAL:
        return found
    return replace(found, visit=np.array([r[4] for r in rows]))


def tracker_std(habit: Habit, setup: Setup, at: np.ndarray, station: int) -> float:
    """Scatter of a reading per axis [m]: with the range, where a tracker is known."""
    if not setup.stations:
        return habit.tracker
    reach = float(np.linalg.norm(at - placed(station)[:3, 3]))
    return habit.tracker * (1.0 + 0.5 * reach) / 3.0


def unseen(arm: Simulated, rng: np.random.Generator) -> tuple[States, np.ndarray]:
    """Draw poses that no fit has seen, with the true error of the arm, (n, 3) [m]."""
    q = rng.uniform(LOW, HIGH, (CHECKED, 6))
    side = rng.choice([-1.0, 1.0], (CHECKED, 6))
    states = make_states(q, side, PLATE[:1].repeat(CHECKED, axis=0))
    true = arm.tcp(q, side, states.tool)
    return states, true - arm.arm.tcp(q, states.tool)


def best_possible(
    arm: Simulated,
    habit: Habit,
    survey: Measurements,
    checked: tuple[States, np.ndarray],
    setup: Setup = AS_USUAL,
) -> float:
    """Return what generalised least squares with all that is true leaves [mm]."""
    n = len(survey)
    stop = np.arange(n) // (habit.repeats * habit.nests)
    step = np.deg2rad(10.0**-habit.decimals)
    where = zip(survey.position, survey.states.station, strict=True)
    scatter = gls.Scatter(
        habit.joint, habit.shift,
        np.array([tracker_std(habit, setup, at, int(s)) for at, s in where]),
        float(step / np.sqrt(12.0)),
    )  # fmt: skip
    states, true = checked
    asked, told = (_true_columns(arm, s, habit, setup) for s in (states, survey.states))
    p = gls.solve(arm.arm, survey.states, survey.position, stop, scatter, told)
    at, size = (states.q, states.direction, states.tool), len(gls.PRIOR)
    nominal = gls.place(arm.arm, *at, np.zeros(size))
    off = gls.place(arm.arm, *at, p[:size]) - nominal - true + asked.of @ p[size:]
    return 1e3 * float(np.linalg.norm(off, axis=1).mean())


def _true_columns(
    arm: Simulated, states: States, habit: Habit, setup: Setup
) -> gls.Columns:
    """Return the columns of what a campaign has besides geometry and backlash."""
    out = gls.no_columns(states)
    if isinstance(arm, Yielding):
        load = np.zeros((len(states), 6))
        load[:, SOFT] = arm.torque(states.q)[:, SOFT]
        out = out.beside(gls.yielding(arm.arm, states, load, SOFTEST))
    if setup.stations:
        out = out.beside(
            gls.set_up(arm.arm, states, setup.stations, habit.nests, FAR, REACH)
        )
    return out
