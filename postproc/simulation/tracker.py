"""Simulated campaigns as measurement files: what the laser tracker writes down."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.exceptions import MeasurementError
from postproc.files import spreadsheet_text, write_all
from postproc.language.visits import Visits
from postproc.simulation.arm import VirtualArm, at_start, move
from postproc.simulation.controller import VirtualCell
from postproc.simulation.draw import stream
from postproc.simulation.kinematics import exponential
from postproc.simulation.program import ProgramRun, run_program
from postproc.simulation.reference import (
    APPROACH,
    MEASURED_EVERY,
    PAYLOAD_COM,
    SPEEDS,
    WORKING_RANGE,
    log_uniform,
    working_angles,
)
from postproc.simulation.state import VirtualArrivals, make_arrivals

# Read the joint targets of a campaign from a CSV file.

TOOL = ("tool_x_mm", "tool_y_mm", "tool_z_mm")


@dataclass(frozen=True)
class JointTargets:
    """n joint targets in visit order, SI units, NaN where a column is missing.

    Attributes:
        ids: Name of every row.
        q: (n, 6) [rad].
        side: Arrival directions -1, 0, 1, (n, 6), or None where the file has none.
        travel: Since the last reversal, (n, 6) [rad].
        time: (n,) [s].
        temperature: (n,) [deg C].
        payload: (n,) [kg].
        speed: (n,) [m/s].
        tool_id: (n,) from 0.
        tool: TCP in the flange frame, (n, 3) [m], where the file has it itself.
    """

    ids: tuple[str, ...]
    q: Floats
    side: Floats | None
    travel: Floats
    time: Floats
    temperature: Floats
    payload: Floats
    speed: Floats
    tool_id: Ints
    tool: Floats


def read_rows(path: str | Path) -> JointTargets:
    """Read a file with `q1_deg` .. `q6_deg` and any further measurement columns.

    Raises:
        MeasurementError: No such file, no joint columns, or a cell that is no number.
    """
    table = _Table.read(Path(path))
    joints = range(1, 7)
    missing = [f"q{j}_deg" for j in joints if f"q{j}_deg" not in table.header]
    if missing:
        raise MeasurementError(
            path, f"no column {', '.join(missing)}", "Name them in the first line"
        )
    q = table.block([f"q{j}_deg" for j in joints])
    if np.isnan(q).any():
        row = int(np.flatnonzero(np.isnan(q).any(axis=1))[0])
        raise MeasurementError(path, "a joint angle is missing", line=row + 2)
    has_side = all(f"lambda{j}" in table.header for j in joints)
    sides = table.block([f"lambda{j}" for j in joints])
    numbers = [str(k + 1) for k in range(len(table.cells))]
    return JointTargets(
        ids=tuple(table.texts("id") or numbers),
        q=np.radians(q),
        side=np.nan_to_num(sides) if has_side else None,
        travel=np.radians(table.block([f"travel{j}_deg" for j in joints])),
        time=table.block(["time_s"])[:, 0],
        temperature=table.block(["temperature_c"])[:, 0],
        payload=table.block(["payload_kg"])[:, 0],
        speed=table.block(["speed_mm_s"])[:, 0] * 1e-3,
        tool_id=np.nan_to_num(table.block(["tool_id"])[:, 0]).astype(np.int64),
        tool=table.block(list(TOOL)) * 1e-3,
    )


@dataclass(frozen=True)
class _Table:
    path: Path
    header: dict[str, int]
    cells: list[list[str]]
    comma: bool  # decimal comma

    @classmethod
    def read(cls, path: Path) -> _Table:
        try:
            text = path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise MeasurementError(path, f"cannot be read: {error}") from error
        lines = [line for line in text.splitlines() if line.strip()]
        if len(lines) < 2:
            raise MeasurementError(path, "no rows", "Give a header and at least one")
        delimiter = ";" if ";" in lines[0] else ","
        cells = list(csv.reader(lines, delimiter=delimiter))
        header = {name.strip().lower(): k for k, name in enumerate(cells[0])}
        return cls(path, header, cells[1:], delimiter == ";")

    def texts(self, name: str) -> list[str]:
        """Return a column as text; empty where the file has none."""
        if name not in self.header:
            return []
        return [row[self.header[name]].strip() for row in self.cells]

    def block(self, names: list[str]) -> Floats:
        """Return columns as numbers, (n, len(names)); NaN where there is none."""
        out = np.full((len(self.cells), len(names)), np.nan)
        for k, name in enumerate(names):
            for i, text in enumerate(self.texts(name)):
                out[i, k] = self._number(text, i, name)
        return out

    def _number(self, text: str, row: int, name: str) -> float:
        if not text:
            return float("nan")
        try:
            return float(text.replace(",", ".") if self.comma else text)
        except ValueError as error:
            problem = f"'{text}' in column {name} is no number"
            raise MeasurementError(self.path, problem, line=row + 2) from error


# Campaigns of joint targets for tests: who goes where, from which side.

START_TEMPERATURE = 22.0  # [deg C]
USUAL_APPROACH = np.radians(2.0)  # where a row says from which side, not from how far


def sample_survey(
    arm: VirtualArm,
    n: int,
    *,
    seed: int = 0,
    tool: Floats | None = None,
    payload: Floats | float = 0.0,
    payload_com: Floats | None = None,
    within: Floats = WORKING_RANGE,
) -> VirtualArrivals:
    """Send an arm to n joint sets, each from a drawn side and distance.

    Args:
        arm: Who goes there; it warms up on the way.
        n: Number of rows.
        seed: Of the campaign, not of the arm.
        tool: TCP (3,), (n, 3) or poses [m]; default a probe off the flange axis.
        payload: [kg], one value or (n,).
        payload_com: (3,) or (n, 3) in the flange frame [m].
        within: Ends of every joint's range, (6, 2) [rad].
    """
    rng = stream(seed, "survey")
    q = working_angles(rng, n, within)
    side = rng.choice([-1.0, 1.0], (n, 6))
    way = log_uniform(rng, APPROACH, (n, 6))
    time = MEASURED_EVERY * np.arange(n) + rng.uniform(0.0, 2.0, n)
    return follow_rows(
        arm,
        q,
        side,
        way,
        tool=np.array([0.08, -0.04, 0.15]) if tool is None else tool,
        speed=rng.choice(SPEEDS, n),
        time=time,
        temperature=arm.temperature(time, START_TEMPERATURE),
        payload=payload,
        payload_com=PAYLOAD_COM if payload_com is None else payload_com,
    )


def follow_rows(
    arm: VirtualArm,
    q: Floats,
    side: Floats | None = None,
    way: Floats | float = USUAL_APPROACH,
    *,
    travel: Floats | None = None,
    tool: Floats | None = None,
    **covariates: Floats | float,
) -> VirtualArrivals:
    """Visit joint targets one after the other with JOINT moves, slowly.

    Args:
        arm: Its gears tell the direction.
        q: Targets in visit order, (n, 6) [rad].
        side: From where each joint comes, (n, 6) in -1, 0, 1: the arm first drives to
            the approach pose q - side * way. None: straight from row to row. 0: the
            gear is left in the middle of its gap.
        way: Length of the approach, (n, 6) or one value [rad].
        travel: Recorded ways since the last reversal (n, 6) [rad], NaN where unknown;
            they replace the ways that follow from the motion.
        tool: As in `make_arrivals`.
        covariates: As in `make_arrivals`.
    """
    q = np.asarray(q, dtype=float)
    approach = q if side is None else q - side * way
    first = stream(arm.seed, "start").choice([-1.0, 1.0], 6)
    state = at_start(arm.gears, approach[0], first)
    states = []
    for stop in zip(approach, q, strict=True):
        state = move(arm.gears, state, np.array(stop))
        states.append(state)
    reached = np.array([s.side for s in states])
    flank = np.array([s.flank for s in states])
    ways = np.array([s.travel for s in states])
    if side is not None:
        reached = np.where(side == 0, 0.0, reached)
        flank = np.where(side == 0, 0.0, flank)
    if travel is not None:
        ways = np.where(np.isnan(travel), ways, travel)
    loop = np.array([s.loop for s in states])
    gears = {"travel": ways, "loop": loop, "flank": flank}
    return make_arrivals(q, reached, tool, **gears, **covariates)


# What the laser tracker writes down: simulated campaigns as measurement files.


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
    arrivals: VirtualArrivals
    tool_id: Ints
    measured: Floats
    true: Floats

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.ids)


def campaign_length(visits: Visits) -> int:
    """Return how many visits of a program a tracker measures."""
    return sum(map(bool, visits.place.measure_id)) or len(visits)


def measure_program(arm: VirtualArm, setup: VirtualCell, visits: Visits) -> Campaign:
    """Run a program and measure it.

    The visits with a MEASURE comment are measured, under its id; without any such
    comment all visits are, under their numbers from 1.
    """
    return measure_run(arm, setup, run_program(arm, setup, visits), visits)


def measure_run(
    arm: VirtualArm, setup: VirtualCell, run: ProgramRun, visits: Visits
) -> Campaign:
    """Measure a program that was run, see `measure_program`."""
    marked = np.array([bool(visits.place.measure_id[i]) for i in run.visit], dtype=bool)
    if marked.any():
        ids = [visits.place.measure_id[i] for i in run.visit[marked]]
    else:
        marked = np.ones(len(run.visit), dtype=bool)
        ids = [str(i + 1) for i in run.visit]
    arrivals = run.arrivals[marked]
    arrivals = replace(arrivals, order=np.arange(len(arrivals), dtype=float))
    return _read(arm, setup, _distinct(ids), arrivals, run.tool_id[marked])


def measure_rows(arm: VirtualArm, setup: VirtualCell, rows: JointTargets) -> Campaign:
    """Visit joint targets in order and measure each.

    Where the rows state the arrival directions, the arm approaches every row from
    those sides; else it drives straight from row to row.
    """
    time = rows.time
    if np.isnan(time).any():
        # The way of the slowest joint, then ten seconds.
        ways = np.abs(np.diff(rows.q, axis=0, prepend=rows.q[:1])) / setup.chain.speed
        time = np.asarray(np.cumsum(ways.max(axis=1) + 10.0))
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


def _tools(setup: VirtualCell, rows: JointTargets) -> Floats:
    """Return the rows' own tools (n, 3), or those of the cell (n, 4, 4)."""
    if np.isnan(rows.tool).any():
        return setup.tool_of(rows.tool_id)
    return rows.tool


def in_tracker_frame(
    campaign: Campaign, arm: VirtualArm, setup: VirtualCell
) -> Campaign:
    """Express the readings in the frame of a tracker that stands as it was put down."""
    rng = stream(arm.seed, "tracker frame")
    turn = exponential(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    turn = turn @ exponential(rng.normal(size=3) * 0.01)
    return replace(campaign, measured=(campaign.measured - setup.tracker) @ turn)


def _read(
    arm: VirtualArm,
    setup: VirtualCell,
    ids: Sequence[str],
    arrivals: VirtualArrivals,
    tool_id: Ints,
) -> Campaign:
    rng = stream(arm.seed, "readings")
    measured = arm.measure(arrivals, setup.tracker, rng)
    return Campaign(tuple(ids), arrivals, tool_id, measured, arm.tcp(arrivals))


def _distinct(ids: Sequence[str]) -> tuple[str, ...]:
    """Number repeated ids: A, A#2, A#3."""
    seen: dict[str, int] = {}
    out = []
    for name in ids:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return tuple(out)


# Write a simulated campaign as a measurement file.


def write_measurements(
    campaign: Campaign, path: str | Path, *, direction: bool = True
) -> None:
    """Write a measurement file, whole or not at all.

    Args:
        campaign: What was measured.
        path: The CSV file.
        direction: Whether the arrival directions and travels are written too.

    Raises:
        OutputError: The file cannot be written.
    """
    header, table = _table(campaign, direction)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(table)
    write_all({Path(path): text.getvalue().encode()})


def _table(campaign: Campaign, direction: bool) -> tuple[list[str], list[list[str]]]:
    """Return the header and the rows as text."""
    a, joints = campaign.arrivals, range(1, 7)
    columns: list[tuple[str, Sequence[object]]] = [
        ("id", [spreadsheet_text(str(one)) for one in campaign.ids])
    ]
    columns += _columns([f"q{j}_deg" for j in joints], np.degrees(a.q), 5)
    if direction:
        columns += _columns([f"lambda{j}" for j in joints], _signs(a.side), 0)
    columns += _columns(["x_mm", "y_mm", "z_mm"], campaign.measured * 1e3, 4)
    columns += _columns(["time_s"], a.time[:, None], 1)
    columns += _columns(["temperature_c"], a.temperature[:, None], 2)
    columns += _columns(["payload_kg"], a.payload[:, None], 1)
    columns += _columns(["speed_mm_s"], a.speed[:, None] * 1e3, 1)
    columns.append(("tool_id", [str(t) for t in campaign.tool_id]))
    tcp = ["tool_x_mm", "tool_y_mm", "tool_z_mm"]
    columns += _columns(tcp, a.tool[:, :3, 3] * 1e3, 4)
    if direction:
        names = [f"travel{j}_deg" for j in joints]
        columns += _columns(names, np.degrees(a.travel), 3)
    header = [name for name, _ in columns]
    table = [
        [str(cell) for cell in row]
        for row in zip(*(c for _, c in columns), strict=True)
    ]
    return header, table


def _columns(
    names: Sequence[str], values: Floats, digits: int
) -> list[tuple[str, Sequence[object]]]:
    texts = [[f"{v:.{digits}f}" for v in column] for column in values.T]
    return list(zip(names, texts, strict=True))


def _signs(side: Floats) -> Floats:
    """Return the directions that sides in the gap amount to: 0 in its middle half."""
    return np.asarray(np.where(np.abs(side) > 0.5, np.sign(side), 0.0)) + 0.0
