"""What the laser tracker writes down: simulated campaigns as measurement files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.language.visits import Visits
from postproc.virtual.arm import VirtualArm
from postproc.virtual.arrivals import Arrivals
from postproc.virtual.drawing import stream
from postproc.virtual.program import run_program
from postproc.virtual.rotation import exponential
from postproc.virtual.rows import Rows
from postproc.virtual.setup import Setup
from postproc.virtual.survey import USUAL_APPROACH, follow_rows


@dataclass(frozen=True)
class Campaign:
    """n measured arrivals.

    Attributes:
        ids: Name of every row.
        arrivals: How the arm got there.
        tool_id: (n,) from 0.
        measured: Tracker readings, (n, 3) [m].
        true: TCP without noise, (n, 3) [m] in the arm base.
    """

    ids: tuple[str, ...]
    arrivals: Arrivals
    tool_id: Ints
    measured: Floats
    true: Floats

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.ids)


def campaign_length(visits: Visits) -> int:
    """Return how many visits of a program a tracker measures."""
    return sum(map(bool, visits.measure_id)) or len(visits)


def measure_program(arm: VirtualArm, setup: Setup, visits: Visits) -> Campaign:
    """Run a program and measure it.

    The visits with a MEASURE comment are measured, under its id; without any such
    comment all visits are, under their numbers from 1.
    """
    run = run_program(arm, setup, visits)
    marked = np.array([bool(visits.measure_id[i]) for i in run.visit], dtype=bool)
    if marked.any():
        ids = [visits.measure_id[i] for i in run.visit[marked]]
    else:
        marked = np.ones(len(run.visit), dtype=bool)
        ids = [str(i + 1) for i in run.visit]
    arrivals = run.arrivals[marked]
    arrivals = replace(arrivals, order=np.arange(len(arrivals), dtype=float))
    return _read(arm, setup, _distinct(ids), arrivals, run.tool_id[marked])


def measure_rows(arm: VirtualArm, setup: Setup, rows: Rows) -> Campaign:
    """Visit joint targets in order and measure each.

    Where the rows state the arrival directions, the arm approaches every row from
    those sides; else it drives straight from row to row.
    """
    time = rows.time
    if np.isnan(time).any():
        time = _usual_times(setup, rows.q)
    known = ~np.isnan(rows.temperature)
    warm = arm.temperature(time, setup.temperature)
    way = np.where(np.isnan(rows.travel), USUAL_APPROACH, rows.travel)
    arrivals = follow_rows(
        arm,
        rows.q,
        rows.side,
        way,
        travel=rows.travel,
        tool=_tools(setup, rows),
        speed=rows.speed,
        time=time,
        temperature=np.where(known, rows.temperature, warm),
        payload=np.where(np.isnan(rows.payload), setup.payload, rows.payload),
        payload_com=setup.payload_com,
    )
    return _read(arm, setup, rows.ids, arrivals, rows.tool_id)


def _tools(setup: Setup, rows: Rows) -> Floats:
    """Return the rows' own tools (n, 3), or those of the cell (n, 4, 4)."""
    if np.isnan(rows.tool).any():
        return setup.tool_of(rows.tool_id)
    return rows.tool


def in_tracker_frame(campaign: Campaign, arm: VirtualArm, setup: Setup) -> Campaign:
    """Express the readings in the frame of a tracker that stands as it was put down."""
    rng = stream(arm.seed, "tracker frame")
    turn = exponential(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    turn = turn @ exponential(rng.normal(size=3) * 0.01)
    return replace(campaign, measured=(campaign.measured - setup.tracker) @ turn)


def _read(
    arm: VirtualArm,
    setup: Setup,
    ids: Sequence[str],
    arrivals: Arrivals,
    tool_id: Ints,
) -> Campaign:
    rng = stream(arm.seed, "readings")
    measured = arm.measure(arrivals, setup.tracker, rng)
    return Campaign(tuple(ids), arrivals, tool_id, measured, arm.tcp(arrivals))


def _usual_times(setup: Setup, q: Floats) -> Floats:
    """Return when each row is measured: the slowest joint's way, then ten seconds."""
    ways = np.abs(np.diff(q, axis=0, prepend=q[:1])) / setup.chain.speed
    return np.asarray(np.cumsum(ways.max(axis=1) + 10.0))


def _distinct(ids: Sequence[str]) -> tuple[str, ...]:
    """Number repeated ids: A, A#2, A#3."""
    seen: dict[str, int] = {}
    out = []
    for name in ids:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return tuple(out)
