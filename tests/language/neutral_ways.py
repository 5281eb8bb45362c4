"""Lines, arcs and chains that leave their paths: a job to put points into."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.robot.cell import Cell
from postproc.robot.trajectory import Motion
from tests.language.neutral_job import NeutralJob, NeutralMove, drawn

CHAIN = 5  # lines of a chain
ZONE = 5.0  # [mm] of its corners
MIDDLE = np.deg2rad([20.0, -25.0, -110.0, 30.0, 50.0, 20.0])


def ways(cell: Cell, seed: int, lines: int, arcs: int, chains: int = 0) -> NeutralJob:
    """Draw joint moves to places, and a line of 150 to 400 mm or an arc from each.

    Behind them come chains: lines of 120 to 300 mm in a plane that turn by up to 60
    degrees at fly points.
    """
    rng, job = np.random.default_rng(seed), drawn(cell, seed, 0)
    moves = list(job.moves[:1])
    for k in range(lines + arcs):
        moves += next(filter(None, _drawn(rng, cell, k >= lines)))
    for _ in range(chains):
        moves += next(filter(None, _chain(rng, cell)))
    return NeutralJob(cell, job.tool, job.uframe, tuple(moves), speed=0.05)


def _drawn(
    rng: np.random.Generator, cell: Cell, arc: bool
) -> Iterator[list[NeutralMove]]:
    """Draw ways; yield nothing for those that the arm cannot reach."""
    while True:
        begin = MIDDLE + np.deg2rad(rng.uniform(-9.0, 9.0, 6))
        way = rng.normal(size=3)
        way *= rng.uniform(0.15, 0.4) / np.linalg.norm(way)
        aside = np.cross(way, rng.normal(size=3)) / 3
        flange = cell.arm.flange(begin[None])[0]
        found = []
        for shift in (way / 2 + aside, way):
            there = flange.copy()
            there[:3, 3] += shift
            found.append(cell.arm.nearest(there[None], begin[None])[0])
        if not np.isfinite(found).all() or np.abs(found - begin).max() > 1.0:
            yield []
            continue
        via, end = found
        move = NeutralMove(Motion.LINEAR, end)
        if arc:
            move = NeutralMove(Motion.CIRCULAR, end, via=via)
        yield [NeutralMove(Motion.JOINT, begin), move]


def _chain(rng: np.random.Generator, cell: Cell) -> Iterator[list[NeutralMove]]:
    """Draw chains; yield nothing for those that the arm cannot reach."""
    while True:
        begin = MIDDLE + np.deg2rad(rng.uniform(-9.0, 9.0, 6))
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        flange, angle = cell.arm.flange(begin[None])[0], rng.uniform(0.0, 2 * np.pi)
        moves, q = [NeutralMove(Motion.JOINT, begin)], begin
        for k in range(CHAIN):
            way = np.cos(angle) * axes[0] + np.sin(angle) * axes[1]
            flange[:3, 3] += rng.uniform(0.12, 0.3) * way
            angle += np.deg2rad(rng.uniform(-60.0, 60.0))
            q = cell.arm.nearest(flange[None], q[None])[0]
            zone = ZONE if k < CHAIN - 1 else 0.0
            moves.append(NeutralMove(Motion.LINEAR, q, zone_mm=zone))
        found = np.array([move.q for move in moves])
        fits = np.isfinite(found).all() and np.abs(found - begin).max() <= 1.0
        yield moves if fits else []
