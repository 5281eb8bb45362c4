"""Approach directions read off trajectories of toppra and ruckig."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from time import monotonic

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.robot.arm_file import ArmFile
from postproc.robot.trajectory import Motion
from postproc.verify.cycle import NO_WAY, NOT_DRAWN, compare_limits, compare_times
from postproc.verify.opinion import (
    COUNTED,
    DIRECTIONS,
    ArmFacts,
    Claim,
    OpinionRow,
    worst_of,
)
from postproc.verify.play_memory import PlayMemory
from postproc.verify.ruckig_move import move_in_time
from postproc.verify.toppra_run import TimedRun, run_in_time
from postproc.verify.ways import NO_TIME, SEVERAL, MadeWay, WayMaker, not_made

MOVES, BLOCK = 5_000, 250  # at most so many in time, drawn in blocks
END_RAD = 1e-4  # what a joint may be off at the end of a way
TO_SPEED, TO_PUSH = 0.4, 0.1  # [s], where the arm file has no acceleration, no jerk
BENT = 0.05  # [rad] between joint paths before and behind a fly point: passed at rest

FLY = "fly points: passed on a blend"
NEAR = "within two plays of a reversal"
UNKNOWN = "not known to the planner"


@dataclass(frozen=True)
class DriveTrain:
    """Limits, play and coupling of an arm's drives.

    Attributes:
        limits: Velocity, acceleration and jerk of the joints, (3, 6); empty where not
            known.
        play: On the drive side, (6,) [rad].
        coupling: Drive angles = coupling @ q, (6, 6).
    """

    limits: Floats
    play: Floats
    coupling: Floats

    @classmethod
    def of(cls, facts: ArmFacts) -> DriveTrain:
        """Take the numbers of the arm file."""
        coupling = np.array(facts.file.joints.drive_coupling or np.eye(6))
        return cls(_limits(facts.file), facts.play, coupling)

    def time_run(self, ways: Sequence[MadeWay], joint: bool) -> TimedRun | None:
        """Find the time law of a run; without limits it has none, but goes its way."""
        q = np.concatenate([ways[0].q[:1], *(way.q[1:] for way in ways)])
        if not len(self.limits):
            return TimedRun(q, np.nan)
        if joint:
            return move_in_time(q[0], q[-1], self.limits)
        steps = [np.full(len(w.q) - 1, w.least / (len(w.q) - 1)) for w in ways]
        least = np.append(0.0, np.cumsum(np.concatenate(steps)))  # [s]
        return run_in_time(q, self.limits[0], self.limits[1], least)


def _limits(file: ArmFile) -> Floats:
    """Return velocity, acceleration and jerk of the joints, (3, 6), or nothing."""
    joints = file.joints
    if joints.velocity_deg_s is None:
        return np.empty((0, 6))
    velocity = np.array(joints.velocity_deg_s)
    push = np.array(joints.acceleration_deg_s2 or velocity / TO_SPEED)
    return np.deg2rad([velocity, push, np.array(joints.jerk_deg_s3 or push / TO_PUSH)])


def judge_directions(
    claim: Claim, maker: WayMaker, facts: ArmFacts, until: float
) -> list[OpinionRow]:
    """Compare the lambda of every stop with that of trajectories in time.

    Args:
        claim: The program, and what it is corrected for.
        maker: Makes its ways.
        facts: The arm.
        until: When to stop, by the monotonic clock.
    """
    train = DriveTrain.of(facts)
    ways = make_ways(maker, draw(claim), until)
    runs = list(runs_of(claim, ways))
    timed = runs_in_time(claim, train, ways, runs, until)
    arrived = arrivals(claim, train, ways, runs, timed)
    skipped = Counter({NO_TIME: len(runs) - len(arrived)})
    what = f"{claim.label}: runs in time"
    return [
        _compare_ends(claim, maker, ways),
        compare_limits(claim, facts.file, ways, maker.confirmed),
        OpinionRow(what, COUNTED, len(arrived), 0, 0.0, 0.0, "", dict(+skipped)),
        *compare_times(claim, facts.file, ways, runs, timed),
        _compare_directions(claim, train, ways, arrived),
    ]


def draw(claim: Claim) -> Ints:
    """Draw the visits that are looked at, by the hash of the program's targets."""
    n = len(claim)
    if n <= MOVES:
        return np.arange(n)
    digest = hashlib.sha256(claim.visits.target.values.tobytes()).digest()
    blocks = np.random.default_rng(list(digest)).permutation(-(-n // BLOCK))
    first = np.sort(blocks[: MOVES // BLOCK]) * BLOCK
    rows = (first[:, None] + np.arange(BLOCK)).ravel()
    return np.asarray(rows[rows < n])


def make_ways(maker: WayMaker, rows: Ints, until: float) -> dict[int, MadeWay]:
    """Make the ways to visits, each from where the one before it ended."""
    ways: dict[int, MadeWay] = {}
    for i in rows.tolist():
        if monotonic() > until:
            break
        before = int(maker.visits.graph.before[i])
        if before < 0:
            ways[i] = not_made(SEVERAL)
            continue
        led = ways.get(before)
        begin = maker.confirmed[before] if led is None or led.why else led.q[-1]
        ways[i] = maker.make(i, begin)
    return ways


def runs_of(claim: Claim, ways: Mapping[int, MadeWay]) -> Iterator[list[int]]:
    """Join ways to what is run without a stop: the visits of each run."""
    run: list[int] = []
    for i, way in ways.items():
        if way.why:
            continue
        if run and not _goes_on(claim, ways, run[-1], i):
            yield run
            run = []
        run.append(i)
    if run:
        yield run


def _goes_on(claim: Claim, ways: Mapping[int, MadeWay], last: int, i: int) -> bool:
    """Tell whether the arm passes a visit on its way to the next one."""
    v = claim.visits
    passing = (
        bool(v.motion.fly[last] or v.motion.via[last]) and v.graph.before[i] == last
    )
    in_space = v.motion.kind[last] != Motion.JOINT and v.motion.kind[i] != Motion.JOINT
    smooth = bool(v.motion.via[last]) or _bend(ways[last].q, ways[i].q) < BENT
    return passing and bool(in_space) and smooth


def _bend(before: Floats, behind: Floats) -> float:
    """Return the angle between two joint paths where they meet [rad]."""
    a, b = before[-1] - before[-2], behind[1] - behind[0]
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return float(np.arccos(np.clip(a @ b / size, -1, 1))) if size else 0.0


def runs_in_time(
    claim: Claim,
    train: DriveTrain,
    ways: Mapping[int, MadeWay],
    runs: Sequence[list[int]],
    until: float,
) -> dict[int, TimedRun]:
    """Find the time laws of runs, by the visits that they begin with."""
    found: dict[int, TimedRun] = {}
    for run in runs:
        joint = bool(claim.visits.motion.kind[run[0]] == Motion.JOINT)
        late = monotonic() > until
        timed = None if late else train.time_run([ways[i] for i in run], joint)
        if timed is not None:
            found[run[0]] = timed
    return found


def arrivals(
    claim: Claim,
    train: DriveTrain,
    ways: Mapping[int, MadeWay],
    runs: Sequence[list[int]],
    timed: Mapping[int, TimedRun],
) -> dict[int, PlayMemory]:
    """Run the drives along trajectories in time: what they remember behind each run.

    A run without a time law is not there, and what follows knows nothing of before.
    """
    found: dict[int, PlayMemory] = {}
    for run in (run for run in runs if run[0] in timed):
        first, last = run[0], run[-1]
        q = np.vstack([timed[first].q, ways[last].q[-1:]])
        start = PlayMemory.at(ways[first].q[0] @ train.coupling.T)
        before = found.get(int(claim.visits.graph.before[first]), start)
        found[last] = before.pass_angles(q @ train.coupling.T, train.play)
    return found


def _compare_ends(
    claim: Claim, maker: WayMaker, ways: Mapping[int, MadeWay]
) -> OpinionRow:
    """Say how far from the planner's joint angles the ways end."""
    ends = [
        (float(np.abs(way.q[-1] - maker.confirmed[i]).max()), i)
        for i, way in ways.items()
        if not way.why
    ]
    skipped = Counter(way.why for way in ways.values() if way.why)
    skipped[NOT_DRAWN] = len(claim) - len(ways)
    what = f"{claim.label}: end of the way"
    return worst_of(what, "rad", END_RAD, claim, ends, +skipped)


def _compare_directions(
    claim: Claim,
    train: DriveTrain,
    ways: Mapping[int, MadeWay],
    arrived: Mapping[int, PlayMemory],
) -> OpinionRow:
    """Say how many directions differ, and where the first of them is."""
    differ: list[str] = []
    compared, skipped = 0, Counter[str]()
    passed = claim.visits.motion.fly | claim.visits.motion.via
    skipped[FLY] = 6 * int(passed.sum())
    for i in np.flatnonzero(~passed).tolist():
        if i not in arrived:
            skipped[NO_WAY if i in ways else NOT_DRAWN] += 6
            continue
        sure, told = arrived[i].sure(train.play), claim.direction[i] != 0
        skipped[NEAR] += int((~sure).sum())
        skipped[UNKNOWN] += int((sure & ~told).sum())
        compared += int((sure & told).sum())
        other = sure & told & (arrived[i].side != claim.direction[i])
        differ += [f"{claim.place(i)} axis {j + 1}" for j in np.flatnonzero(other)]
    return OpinionRow(
        f"{claim.label}: {DIRECTIONS}", "lambda", compared, len(differ),
        2.0 * bool(differ), 0.0, next(iter(differ), ""), dict(+skipped),
    )  # fmt: skip
