"""Run a program on the virtual arm, and see where the tool lands."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.exceptions import PostprocError
from postproc.language.visits import ELSEWHERE, Visits
from postproc.robot.trajectory import Motion
from postproc.simulation.arm import (
    BRAKES,
    GearState,
    VirtualArm,
    at_start,
    follow,
    move,
)
from postproc.simulation.controller import Drive, VirtualCell, Way, plan_drives
from postproc.simulation.draw import stream
from postproc.simulation.state import USUAL_SPEED, VirtualArrivals, make_arrivals

# Run a program on the virtual arm.

SETTLE = 0.3  # [s] to start and stop a move
# Where the arm stands when the cell names no home: upright, wrist bent, as far as its
# joints turn.
UPRIGHT = np.radians([0.0, 0.0, -90.0, 0.0, 90.0, 0.0])


@dataclass(frozen=True)
class ProgramRun:
    """What happened when a program ran.

    Attributes:
        visit: Index of every reached visit, (k,), in the order of the program.
        arrivals: How the arm got there, k of them.
        tool_id: Number of the tool, (k,) from 0: that of the cell's probe points where
            all tools are probe points, else their order in the program.
        why: For each visit of the program, why it was not reached, or "".
        left: Indices of fly points from which the program goes on, but not this run:
            how the tool passes them is not known.
        moves: How the arm went to each visit of the program.
    """

    visit: Ints
    arrivals: VirtualArrivals
    tool_id: Ints
    why: tuple[str, ...]
    left: Ints
    moves: tuple[DrivenMove, ...]


@dataclass(frozen=True)
class _ProgramPlace:
    """The arm after one visit; `why` says why it was not reached."""

    joints: Floats
    gears: GearState
    speed: float = USUAL_SPEED
    lasted: float = 0.0
    why: str = ""
    rate: Floats = field(default_factory=lambda: np.zeros(6))


def run_program(arm: VirtualArm, setup: VirtualCell, visits: Visits) -> ProgramRun:
    """Run every visit of a program once.

    Where a visit has several possible predecessors, the arm comes from the first of
    them that was run: one of the histories that really happen. Where it comes from an
    unknown place, it starts at home with its gears as the seed drew them. Fly points
    are rounded; the arrival there is where the TCP passes closest.

    Args:
        arm: Whose gears and clock.
        setup: Its cell.
        visits: The program.
    """
    poses = _poses(visits)
    steps = [*_places(arm, setup, visits, poses)]
    begun = {drive.came_from for drive, _, place in steps if not place.why}
    moves, left = _list_moves(visits, poses, steps), _not_passed(visits, begun)
    places = [place for _, _, place in steps]
    return _collect(arm, setup, visits, poses, places, left, moves)


def _not_passed(visits: Visits, begun: Collection[int]) -> Ints:
    """Find fly points that the program goes on from, but no move of a run."""
    goes_on = np.zeros(len(visits) + 1, dtype=bool)
    goes_on[visits.graph.pred[visits.graph.pred >= 0]] = True
    for i in range(1, len(visits)):  # before what is not followed
        goes_on[i - 1] |= ELSEWHERE in visits.graph.predecessors(i)
    goes_on[[i for i in begun if i >= 0]] = False
    return np.flatnonzero(goes_on[:-1] & visits.motion.fly & ~visits.motion.via)


def _poses(visits: Visits) -> Floats:
    """Return the frames of a program, (k, 4, 4)."""
    return visits.frame.poses if len(visits.frame.poses) else np.eye(4)[None]


def _places(
    arm: VirtualArm, setup: VirtualCell, visits: Visits, poses: Floats
) -> Iterator[tuple[Drive, _ProgramPlace, _ProgramPlace]]:
    """Run move after move: yield the way, and the arm before and behind it."""
    start = _start(arm, setup)
    drives = plan_drives(setup, visits, poses, start.joints)
    places: list[_ProgramPlace] = []
    for i, drive in enumerate(drives):
        place = start if drive.came_from < 0 else places[drive.came_from]
        if drive.stands_there:
            gears = at_start(arm.gears, drive.begin, start.gears.side)
            place = _ProgramPlace(drive.begin, gears)
        places.append(_go(arm, setup, visits, i, drive, place))
        yield drive, place, places[-1]


@dataclass(frozen=True)
class DrivenMove:
    """One move as it is run.

    Attributes:
        visit: Index of the visit.
        path: Joints on the way, from where the arm stands, (m, 6) [rad].
        gears: Where the gears are before.
        tool: Flange to TCP, (4, 4) [m].
        speed: Of the TCP [m/s].
        begins, lasted: When it begins, and how long it takes [s].
        rate: Joint speeds from which it brakes, (6,) [rad/s]; 0 where it goes on.
        why: Why the visit was not reached, or "".
        cartesian: The TCP follows a path.
        flies: The arm goes on without a stop.
    """

    visit: int
    path: Floats
    gears: GearState
    tool: Floats
    speed: float
    begins: float
    lasted: float
    rate: Floats
    why: str
    cartesian: bool
    flies: bool


def gears_along(arm: VirtualArm, run: DrivenMove, q: Floats) -> dict[str, Floats]:
    """Follow the gears along a move, as columns of `VirtualArrivals`.

    Args:
        arm: Whose gears.
        run: The move.
        q: Joints, evenly along it, from where the arm stands, (k, 6) [rad].
    """
    states = follow(arm.gears, run.gears, q[1:])
    brakes = np.linspace(0.0, run.lasted, len(q)) > run.lasted - BRAKES
    flank = arm.gears.brake(states, run.rate).flank
    return {
        "side": states.side,
        "flank": np.where(brakes[:, None], flank, states.flank),
        "travel": states.travel,
        "loop": states.loop,
    }


def _list_moves(
    visits: Visits,
    poses: Floats,
    steps: Sequence[tuple[Drive, _ProgramPlace, _ProgramPlace]],
) -> tuple[DrivenMove, ...]:
    """Tell of every move as it was run, one after the other."""
    moves, time = list[DrivenMove](), 0.0
    for i, (drive, before, after) in enumerate(steps):
        one = DrivenMove(
            visit=i,
            path=np.vstack([before.joints, drive.path]),
            gears=before.gears,
            tool=poses[visits.frame.tool[i]],
            speed=after.speed,
            begins=time,
            lasted=after.lasted - SETTLE,
            rate=after.rate,
            why=after.why,
            cartesian=bool(visits.motion.kind[i] != Motion.JOINT),
            flies=bool(visits.motion.fly[i]),
        )
        moves.append(one)
        time += after.lasted
    return tuple(moves)


def _start(arm: VirtualArm, setup: VirtualCell) -> _ProgramPlace:
    upright = np.clip(UPRIGHT, setup.chain.lower, setup.chain.upper)
    joints = upright if setup.home is None else setup.home
    side = stream(arm.seed, "start").choice([-1.0, 1.0], 6)
    return _ProgramPlace(joints, at_start(arm.gears, joints, side))


def _go(
    arm: VirtualArm,
    setup: VirtualCell,
    visits: Visits,
    i: int,
    drive: Drive,
    place: _ProgramPlace,
) -> _ProgramPlace:
    """Run one move; an arm that cannot go stays where it is."""
    if drive.why:
        return replace(place, why=drive.why, lasted=0.0)
    lasted = _duration(setup, visits, i, drive.way)
    rate = (
        np.zeros(6) if visits.motion.fly[i] else _last_rate(place.joints, drive, lasted)
    )
    gears = move(arm.gears, place.gears, drive.path)
    return _ProgramPlace(
        joints=drive.path[-1],
        gears=arm.gears.brake(gears, rate),
        speed=max(drive.way.length / lasted, 1e-6),
        lasted=lasted + SETTLE,
        rate=rate,
    )


def _last_rate(begin: Floats, drive: Drive, lasted: float) -> Floats:
    """Return the joint speeds from which a move brakes, (6,) [rad/s]."""
    path = np.vstack([begin, drive.path])
    step = np.diff(path, axis=0)
    size = np.linalg.norm(step, axis=1)
    moved = np.flatnonzero(size > 1e-9)
    if len(moved) == 0:
        return np.zeros(6)
    last = moved[-1]
    return np.asarray(step[last] / size[last] * size.sum() / lasted)


def _duration(setup: VirtualCell, visits: Visits, i: int, way: Way) -> float:
    """Return how long a move takes, without ramps [s]."""
    override = float(np.nan_to_num(visits.speed.override[i], nan=1.0)) or 1.0
    speed = setup.chain.speed * override
    most = np.abs(np.diff(way.joints, axis=0)).sum(axis=0) / speed
    lasted = float(most.max())
    if visits.motion.kind[i] != Motion.JOINT:
        programmed = float(np.nan_to_num(visits.speed.linear[i], nan=USUAL_SPEED))
        lasted = max(lasted, way.length / max(programmed * override, 1e-6))
    return max(lasted, 1e-3)


def _collect(
    arm: VirtualArm,
    setup: VirtualCell,
    visits: Visits,
    poses: Floats,
    places: list[_ProgramPlace],
    left: Ints,
    moves: tuple[DrivenMove, ...],
) -> ProgramRun:
    """Gather the reached visits."""
    reached = [i for i, p in enumerate(places) if not p.why]
    visit = np.array(reached, dtype=np.int64)
    kept = [places[i] for i in reached]
    time = np.cumsum([p.lasted for p in places])[visit] if reached else np.zeros(0)
    tools = visits.frame.tool[visit].tolist()
    frames = list(dict.fromkeys(tools))
    probes = [setup.number_of(poses[frame]) for frame in frames]
    if min(probes, default=-1) < 0:
        probes = list(range(len(frames)))
    number = dict(zip(frames, probes, strict=True))
    tool_id = np.array([number[tool] for tool in tools], dtype=np.int64)
    arrivals = make_arrivals(
        np.array([p.joints for p in kept]).reshape(-1, 6),
        np.array([p.gears.side for p in kept]).reshape(-1, 6),
        poses[visits.frame.tool[visit]],
        travel=np.array([p.gears.travel for p in kept]).reshape(-1, 6),
        loop=np.array([p.gears.loop for p in kept]).reshape(-1, 6),
        flank=np.array([p.gears.flank for p in kept]).reshape(-1, 6),
        speed=np.array([p.speed for p in kept]),
        time=time,
        temperature=arm.temperature(time, setup.temperature),
        payload=setup.payload,
        payload_com=setup.payload_com,
    )
    why = tuple(p.why for p in places)
    return ProgramRun(visit, arrivals, tool_id, why, left, moves)


# Where the tool really lands when a program runs, against what was wanted.


@dataclass(frozen=True)
class Landing:
    """The landing of an executed program at the visits that both programs reach.

    Attributes:
        visit: Index of the visit, (k,).
        wanted: TCP that the original program asks for, (k, 3) [m] in the arm base.
        landed: TCP where the executed program really lands, (k, 3), without noise.
        left_out: How many fly points are left out: a run does not go on from them, so
            that it does not show how the tool passes them.
    """

    visit: Ints
    wanted: Floats
    landed: Floats
    left_out: int = 0

    @property
    def error(self) -> Floats:
        """Landed minus wanted, (k, 3) [m]."""
        return np.asarray(self.landed - self.wanted)


def land(
    arm: VirtualArm,
    setup: VirtualCell,
    original: Visits,
    executed: Visits | None = None,
    own: Ints | None = None,
) -> Landing:
    """Run a program and compare it with what the original asks for, visit by visit.

    A point that the program flies past is left out where a run does not go on from it:
    one history of several is run, and the arm of that one stops there.

    Args:
        arm: The arm that runs it.
        setup: Its cell.
        original: The program as it came from the drawing.
        executed: The compensated program; default the original itself.
        own: Its visits that the original makes, (n,), where points were put on ways.

    Raises:
        PostprocError: The two programs do not have the same visits.
    """
    asked = run_program(arm, setup, original)
    if executed is None or executed is original:
        return land_runs(arm, asked, asked)
    return land_runs(arm, asked, run_program(arm, setup, executed), own)


def land_runs(
    arm: VirtualArm, asked: ProgramRun, done: ProgramRun, own: Ints | None = None
) -> Landing:
    """Compare two programs that were run, see `land`.

    Args:
        arm: The arm that ran them.
        asked: The program as it came from the drawing.
        done: The program that is judged; the same one where it is itself.
        own: Its visits that the first one makes, (n,), where points were put on ways.

    Raises:
        PostprocError: The two programs do not have the same visits.
    """
    if done is not asked:
        rows = len(done.why) if own is None else len(own)
        if rows != len(asked.why):
            raise PostprocError(
                f"the executed program makes {len(done.why)} visits, the original "
                f"{len(asked.why)}: they are not two versions of one program"
            )
    reached, left = done.visit, done.left
    if own is not None and done is not asked:
        reached, left = _among(own, reached), _among(own, left)
    visit, here, there = np.intersect1d(asked.visit, reached, return_indices=True)
    passed = ~np.isin(visit, np.union1d(asked.left, left))
    wanted = arm.nominal_tcp(asked.arrivals)[here[passed]]
    landed = arm.tcp(done.arrivals)[there[passed]]
    return Landing(visit[passed], wanted, landed, int((~passed).sum()))


def _among(own: Ints, visits: Ints) -> Ints:
    """Number visits of an executed program as the original does, -1 for others."""
    at = np.searchsorted(own, visits)
    return np.where(own[np.minimum(at, len(own) - 1)] == visits, at, -1)
