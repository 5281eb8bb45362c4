"""The page of a plant: a row for each robot, with its control chart."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import datetime

from postproc.record.database import Record
from postproc.record.life import Life
from postproc.record.rows import ProgramRow, RobotRow, VerdictRow
from postproc.record.schedule import next_check
from postproc.record.stale import STALE_MM, list_stale, newest
from postproc.report.html.page import render
from postproc.report.record import state_of

WIDE, HIGH = 420.0, 64.0  # of a chart [px]
MOST = 2.0  # times the limit that a chart shows
TOLERANCE_MM = 0.1  # of the mean error, until which no check is due


@dataclass(frozen=True)
class ChartMark:
    """A point or a line of a chart: its place, what it is, and what a pointer tells."""

    x: float
    y: float
    kind: str
    told: str


@dataclass(frozen=True)
class PlantRow:
    """A robot as the page shows it.

    Attributes:
        robot: The robot.
        state: How it is: in control, act, not checked, replaced.
        style: Of its row.
        last: Date of its last check, "" without.
        mean, within: Error of that check [mm].
        model: Its model and since when.
        stale: Programs that would move by more than the limit.
        programs: Programs that were released for it.
        due: When it is to be checked again.
        checks, events: Of its chart.
        moved: What its last check said.
    """

    robot: RobotRow
    state: str
    style: str
    last: str
    mean: float | None
    within: float | None
    model: str
    stale: int
    programs: int
    due: str
    checks: tuple[ChartMark, ...]
    events: tuple[ChartMark, ...]
    moved: str


STYLES = {"in control": "corrected", "act": "conflict"}


def plant_page(record: Record) -> str:
    """Make the page of all robots of a record, those to act on first."""
    stale = Counter(row.serial for row in list_stale(record))
    robots = record.rows(RobotRow)
    rows = [_row(record, robot, stale[robot.serial]) for robot in robots]
    rows.sort(key=lambda row: (row.state != "act", row.robot.serial))
    count = {state: sum(r.state == state for r in rows) for state in STYLES}
    return render(
        "plant.html.j2", "Robots", {}, ("page.js", "sheets.js"), rows=rows, count=count,
        stale=sum(r.stale for r in rows), wide=WIDE, high=HIGH, limit=HIGH / MOST,
        stale_mm=STALE_MM,
    )  # fmt: skip


def _row(record: Record, robot: RobotRow, stale: int) -> PlantRow:
    life = Life.of(record, robot.serial)
    verdicts, events = life.verdicts, life.events
    state = state_of(life)
    last = verdicts[-1] if verdicts else None
    programs = newest(record.rows(ProgramRow, robot.serial))
    current = life.models[-1] if life.models else None
    since = [v for v in verdicts if not events or v.date >= events[-1].date]
    due = next_check(since, TOLERANCE_MM)
    checks, marks = _chart(life)
    return PlantRow(
        robot, state, STYLES.get(state, "unchanged"),
        last.date[:10] if last else "", last.mean_mm if last else None,
        last.within_mm if last else None,
        f"{current.id} since {current.date[:10]}" if current else "none",
        stale, len(programs),
        "not known" if due is None else due.isoformat(), checks, marks,
        last.moved if last else "",
    )  # fmt: skip


def _chart(life: Life) -> tuple[tuple[ChartMark, ...], tuple[ChartMark, ...]]:
    """Place checks by time, and by how near they are to their limit; and events."""
    dates = [v.date for v in life.verdicts] + [e.date for e in life.events]
    if not dates:
        return (), ()
    times = [datetime.fromisoformat(d).timestamp() for d in dates]
    begin, span = min(times), max(max(times) - min(times), 1.0)

    def place(moment: str) -> float:
        at = datetime.fromisoformat(moment).timestamp()
        return round(6.0 + (WIDE - 12.0) * (at - begin) / span, 1)

    checks = tuple(
        ChartMark(place(v.date), _height(v), "in" if v.in_control else "out", _tell(v))
        for v in life.verdicts
    )
    events = tuple(
        ChartMark(place(e.date), 0.0, "event", f"{e.date[:10]} {e.kind} {e.joints}")
        for e in life.events
    )
    return checks, events


def _height(row: VerdictRow) -> float:
    """Return where a check stands in its chart: the limit is half of the height."""
    ratio = max(row.statistic / row.statistic_limit, row.drift / row.drift_limit)
    return round(HIGH * (1.0 - min(ratio, MOST) / MOST), 1)


def _tell(row: VerdictRow) -> str:
    said = "in control" if row.in_control else row.moved
    return f"{row.date[:10]}: {said}; mean {row.mean_mm:.3f} mm"
