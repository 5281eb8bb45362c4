"""How the tool really goes between the targets when the virtual arm runs a program."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from postproc.arrays import Floats, Ints
from postproc.simulation.arm import VirtualArm
from postproc.simulation.controller import VirtualCell
from postproc.simulation.program import ProgramRun, gears_along
from postproc.simulation.state import make_arrivals

STEP = 1e-3  # [m] between places that are looked at
AROUND = 40  # pieces of the wanted path in which the nearest place is looked for


@dataclass(frozen=True)
class PathScores:
    """How far the TCP is from m wanted paths, s samples in all (structure of arrays).

    Attributes:
        visit: Index of the visit at the end of each LINEAR or CIRCULAR move, (m,).
        first: Its samples are first[k] .. first[k + 1] - 1, (m + 1,).
        way: Length of the wanted path up to every sample, (s,) [m].
        across: Distance from the wanted path, (s,) [m].
        along: How far the TCP is ahead of the same share of the way, (s,) [m].
    """

    visit: Ints
    first: Ints
    way: Floats
    across: Floats
    along: Floats

    @property
    def largest(self) -> Floats:
        """Path accuracy AT_p of every move, its systematic part, (m,) [m]."""
        if not len(self.visit):
            return np.empty(0)
        return np.asarray(np.maximum.reduceat(self.across, self.first[:-1]))


@dataclass(frozen=True)
class _Track:
    """One move as it is run: the nominal TCP and the real one, (k, 3) [m] each."""

    nominal: Floats
    real: Floats


def score_paths(
    arm: VirtualArm,
    setup: VirtualCell,
    asked: ProgramRun,
    done: ProgramRun,
    own: Ints | None = None,
    skipped: Ints | None = None,
) -> PathScores:
    """Compare the paths of a program that was run with those of the original.

    Args:
        arm: The arm that ran them.
        setup: Its cell.
        asked: The program as it came from the drawing.
        done: The program that is judged; the same one where it is itself.
        own: Its visits that the original makes, (n,), where points were put on ways:
            the pieces of a move are compared with its whole path.
        skipped: Visits of the original whose ways are others now, and not compared.
    """
    wanted = dict(_tracks(arm, setup, asked))
    made, others = wanted, set[int]()
    if done is not asked:
        made = dict(_tracks(arm, setup, done))
        made = made if own is None else _whole(made, own)
        others = set() if skipped is None else set(skipped.tolist())
    visit, parts = [], []
    for i in sorted((wanted.keys() & made.keys()) - others):
        visit.append(i)
        parts.append(_apart(made[i], wanted[i].nominal))
    count = [len(way) for way, _, _ in parts]
    columns = [np.concatenate([*c, np.empty(0)]) for c in zip(*parts, strict=True)]
    first = np.append(0, np.cumsum(count)).astype(np.int64)
    return PathScores(
        np.array(visit, dtype=np.int64), first, *(columns or [np.empty(0)] * 3)
    )


def _whole(tracks: dict[int, _Track], own: Ints) -> dict[int, _Track]:
    """Join the pieces of moves, by the visit of the original that they lead to."""
    pieces: dict[int, list[_Track]] = {}
    for visit in sorted(tracks):
        at = int(np.searchsorted(own, visit))
        pieces.setdefault(at, []).append(tracks[visit])
    return {
        at: _Track(*(np.concatenate([getattr(t, name) for t in some])
                     for name in ("nominal", "real")))
        for at, some in pieces.items()
    }  # fmt: skip


def _tracks(
    arm: VirtualArm, setup: VirtualCell, program: ProgramRun
) -> Iterator[tuple[int, _Track]]:
    """Follow every Cartesian move, with the gears at every sample."""
    for run in program.moves:
        if run.why or not run.cartesian:
            continue
        q = _finer(run.path, arm.nominal.flange(run.path)[:, :3, 3])
        gears = gears_along(arm, run, q)
        part = np.linspace(0.0, 1.0, len(q))
        arrivals = make_arrivals(
            q,
            tool=run.tool,
            **gears,
            speed=run.speed,
            time=run.begins + part * run.lasted,
            temperature=arm.temperature(
                run.begins + part * run.lasted, setup.temperature
            ),
            payload=setup.payload,
            payload_com=setup.payload_com,
        )
        yield run.visit, _Track(arm.nominal_tcp(arrivals), arm.tcp(arrivals))


def _finer(path: Floats, flange: Floats) -> Floats:
    """Sample a joint path (m, 6) every millimetre of its flange (m, 3)."""
    moved = np.any(np.diff(path, axis=0) != 0.0, axis=1)
    path = path[np.append(True, moved)]
    if len(path) < 2:
        return path
    length = float(np.linalg.norm(np.diff(flange, axis=0), axis=1).sum())
    joints = np.linalg.norm(np.diff(path, axis=0), axis=1)
    marks = np.append(0.0, np.cumsum(joints))
    count = max(int(np.ceil(length / STEP)), len(path)) + 1
    return np.asarray(CubicSpline(marks, path)(np.linspace(0.0, marks[-1], count)))


def _apart(done: _Track, wanted: Floats) -> tuple[Floats, Floats, Floats]:
    """Compare a move with its wanted path, (n, 3).

    The ends of the wanted path go on straight: what is only late or early there is no
    distance from it.

    Returns:
        Length of the wanted path, distance from it, and how far the TCP is ahead,
        (k,) [m] each.
    """
    step = np.diff(wanted, axis=0)
    size = np.linalg.norm(step, axis=1)
    keep = size > 1e-9
    begin, step, size = wanted[:-1][keep], step[keep], size[keep]
    if not len(size):
        off = np.linalg.norm(done.real - wanted[-1], axis=1)
        return np.zeros(len(off)), off, np.zeros(len(off))
    way = np.append(0.0, np.cumsum(size))
    moved = np.linalg.norm(np.diff(done.nominal, axis=0), axis=1)
    run = np.append(0.0, np.cumsum(moved))
    there = way[-1] * run / max(run[-1], 1e-12)
    where, across = _project(done.real, begin, step, size, way, there)
    return where, across, where - there


def _project(
    points: Floats,
    begin: Floats,
    step: Floats,
    size: Floats,
    way: Floats,
    there: Floats,
) -> tuple[Floats, Floats]:
    """Find the nearest places on a path: its length up to there, and the distance.

    Args:
        points: Places to find, (k, 3).
        begin: Where the pieces of the path begin, (n, 3).
        step: Where they lead, (n, 3).
        size: Their lengths, (n,).
        way: Length of the path where they begin, and of all of it, (n + 1,).
        there: About where on the path the places are, (k,).
    """
    n, k = len(size), len(points)
    middle = np.searchsorted(way, there, side="right") - 1
    near = middle[:, None] + np.arange(-AROUND, AROUND + 1)
    near = np.clip(near, 0, n - 1)
    off = points[:, None] - begin[near]
    t = np.einsum("kni,kni->kn", off, step[near]) / size[near] ** 2
    t = np.clip(
        t, np.where(near == 0, -np.inf, 0.0), np.where(near == n - 1, np.inf, 1)
    )
    distance = np.linalg.norm(off - t[..., None] * step[near], axis=2)
    best = distance.argmin(axis=1)
    rows = np.arange(k)
    at = near[rows, best]
    return way[at] + t[rows, best] * size[at], distance[rows, best]
