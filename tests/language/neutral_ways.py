"""Lines and arcs that leave their paths: a job in no language, to put points into."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.robot.cell import Cell
from postproc.robot.trajectory import Motion
from tests.language.neutral_job import NeutralJob, NeutralMove, drawn

MIDDLE = np.deg2rad([20.0, -25.0, -110.0, 30.0, 50.0, 20.0])


def ways(cell: Cell, seed: int, lines: int, arcs: int) -> NeutralJob:
    """Draw joint moves to places, and a line of 150 to 400 mm or an arc from each."""
    rng, job = np.random.default_rng(seed), drawn(cell, seed, 0)
    moves = list(job.moves[:1])
    for k in range(lines + arcs):
        moves += next(filter(None, _drawn(rng, cell, k >= lines)))
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
