"""Times between stops and joint limits on the way, against the planner's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.language.visits import Visits
from postproc.robot.arm_file import ArmFile
from postproc.robot.trajectory import Motion
from postproc.verify.opinion import Claim, OpinionRow, worst_of
from postproc.verify.toppra_run import TimedRun
from postproc.verify.ways import MadeWay

MOVE_S = 1e-5  # a JOINT move by ruckig, twice
LINE_PERCENT = 2.0  # two time-optimal laws on grids of their own
ARC_PERCENT = 20.0  # the largest found is 9, of 1,252 arcs
SHORTEST_S = 0.1  # shares are of this at least: fewer gridpoints than a controller has
FLY_PERCENT = 20.0  # by which a passage may be slower than a stop at every point
LIMIT_RAD = 1e-3  # a joint may turn between the samples of a way

NO_LAW = "a way or a time law is not there"
UNSAID = "the planner has no time law"
NOT_TOLD = "not known to the planner"
NO_WAY = "the way there was not made"
NOT_DRAWN = "not drawn, or the time was up"


@dataclass(frozen=True)
class Passage:
    """What is driven from one stop to the next.

    Attributes:
        runs: Its runs, one after the other.
        ours: What the planner says that it takes [s].
        theirs: What its runs take, each from rest to rest [s].
        least: What the joints need at full speed, from stop to stop [s].
    """

    runs: tuple[list[int], ...]
    ours: float
    theirs: float
    least: float

    @property
    def last(self) -> int:
        """The visit that it ends at."""
        return self.runs[-1][-1]

    @property
    def apart(self) -> float:
        """By how much the two times differ [%]."""
        return 100 * abs(self.ours - self.theirs) / max(self.theirs, SHORTEST_S)

    @property
    def outside(self) -> float:
        """By how much it is slower than with stops, or faster than its joints [%]."""
        slow = (self.ours - self.theirs) / max(self.theirs, SHORTEST_S)
        fast = (self.least - self.ours) / max(self.least, SHORTEST_S)
        return 100 * max(slow, fast, 0.0)


def compare_times(
    claim: Claim,
    file: ArmFile,
    ways: Mapping[int, MadeWay],
    runs: Sequence[list[int]],
    timed: Mapping[int, TimedRun],
) -> list[OpinionRow]:
    """Compare the times from stop to stop.

    Args:
        claim: The program, and the planner's times.
        file: The arm file.
        ways: The ways of its visits.
        runs: Which of them are run without a stop.
        timed: The time laws of runs, by the visits that they begin with.
    """
    if file.joints.velocity_deg_s is None:
        return []
    speed = np.deg2rad(file.joints.velocity_deg_s)
    found = list(passages(claim, speed, ways, runs, timed))
    kinds: dict[str, list[Passage]] = {"joint": [], "line": [], "arc": [], "fly": []}
    for p in found:
        kinds[_kind(claim.visits, p)].append(p)
    moves = [(abs(p.ours - p.theirs), p.last) for p in kinds["joint"]]
    lines = [(p.apart, p.last) for p in kinds["line"]]
    arcs = [(p.apart, p.last) for p in kinds["arc"]]
    outside = [(p.outside, p.last) for p in kinds["fly"]]
    lost = _count_lost(claim, ways, found)
    named = claim.label
    return [
        worst_of(f"{named}: time of JOINT moves", "s", MOVE_S, claim, moves, {}),
        worst_of(f"{named}: time of lines", "%", LINE_PERCENT, claim, lines, {}),
        worst_of(f"{named}: time of arcs", "%", ARC_PERCENT, claim, arcs, {}),
        worst_of(
            f"{named}: time over fly points", "%", FLY_PERCENT, claim, outside, lost
        ),
    ]


def _kind(v: Visits, passage: Passage) -> str:
    """Name what a passage is: a JOINT move, a line, an arc, or more of them.

    Readers mark the point on the way of an arc as passed: that is no fly point.
    """
    passed = np.array([i for run in passage.runs for i in run])
    if (v.motion.fly & ~v.motion.via)[passed].any():
        return "fly"
    if v.motion.kind[passage.last] == Motion.JOINT:
        return "joint"
    return "arc" if v.motion.via[passed].any() else "line"


def passages(
    claim: Claim,
    speed: Floats,
    ways: Mapping[int, MadeWay],
    runs: Sequence[list[int]],
    timed: Mapping[int, TimedRun],
) -> Iterator[Passage]:
    """Join runs to passages from stop to stop of which both sides know the time."""
    v = claim.visits
    passed = v.motion.fly | v.motion.via
    chain: list[list[int]] = []
    for run in runs:
        before = int(v.graph.before[run[0]])
        on = bool(chain) and chain[-1][-1] == before
        begins = before >= 0 and not passed[before]
        chain = [*chain, run] if on else [run] if begins else []
        if run[0] not in timed:
            chain = []
        if chain and not passed[run[-1]]:
            if (passage := _passage(claim, speed, ways, chain, timed)) is not None:
                yield passage
            chain = []


def _passage(
    claim: Claim,
    speed: Floats,
    ways: Mapping[int, MadeWay],
    chain: Sequence[list[int]],
    timed: Mapping[int, TimedRun],
) -> Passage | None:
    """Say how long a passage takes; None where the planner does not know."""
    v, visits = claim.visits, [i for run in chain for i in run]
    ours = claim.time[visits[-1]] - claim.time[v.graph.before[visits[0]]]
    if np.isnan(claim.time[visits]).any() or np.isnan(ours):
        return None
    slow = float(v.speed.override[visits].min())  # a run goes by its lowest override
    theirs = sum(timed[run[0]].seconds for run in chain) / slow
    turned = np.abs(ways[visits[-1]].q[-1] - ways[visits[0]].q[0])
    least = float((turned / speed).max()) / float(v.speed.override[visits].max())
    return Passage(tuple(chain), float(ours), theirs, least)


def _count_lost(
    claim: Claim, ways: Mapping[int, MadeWay], found: Sequence[Passage]
) -> dict[str, int]:
    """Count stops whose passage is not compared, and why."""
    v = claim.visits
    stops = set(np.flatnonzero(~(v.motion.fly | v.motion.via)).tolist()) - {
        p.last for p in found
    }
    return dict(Counter(
        UNSAID if np.isnan(claim.time[i]) else NO_LAW if i in ways else NOT_DRAWN
        for i in sorted(stops)
    ))  # fmt: skip


def compare_limits(
    claim: Claim, file: ArmFile, ways: Mapping[int, MadeWay], confirmed: Floats
) -> OpinionRow:
    """Compare what the planner says of joint limits with the angles on the ways.

    Where it says that a joint stays within, by how much one is beyond; where it says
    that one is beyond, how far all of them are within.
    """
    low, high = np.deg2rad(file.joints.lower_deg), np.deg2rad(file.joints.upper_deg)
    sizes, skipped = [], Counter[str]()
    for i in range(len(claim)):
        before, none = int(claim.visits.graph.before[i]), np.empty((0, 6))
        whole = [before, i] if before >= 0 and claim.visits.motion.via[before] else [i]
        made = [ways[k].q[1:] for k in whole if k in ways and not ways[k].why]
        q = np.concatenate(made) if len(made) == len(whole) else none
        if not len(q) and claim.within[i] > 0:
            q = confirmed[i][None]
        if claim.within[i] == 0 or not len(q) or np.isnan(q).any():
            skipped[NOT_TOLD if claim.within[i] == 0 else NO_WAY] += 1
            continue
        beyond = float(np.maximum(low - q, q - high).max())
        sizes.append((max(0.0, beyond * float(claim.within[i])), i))
    what = f"{claim.label}: joint limits"
    return worst_of(what, "rad", LIMIT_RAD, claim, sizes, skipped)
