"""What a terminal shows of the record of robots: lists, verdicts, refreshes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from postproc.calibration.evidence import name_evidence
from postproc.files import schema
from postproc.record.causes import BASE, TOOL, ZERO, Power
from postproc.record.control import CheckVerdict
from postproc.record.database import Record
from postproc.record.life import Life
from postproc.record.replacement import ReplacedProgram
from postproc.record.robots import UNTOLD, Refreshed
from postproc.record.rows import ModelRow, RobotRow, VerdictRow
from postproc.record.stale import STALE_MM, StaleProgram, list_stale
from postproc.report.terminal import Column, table_text

LISTED = (
    Column("robot", "left"), Column("arm", "left"), Column("line", "left"),
    Column("state", "left"), Column("checks"), Column("last check", "left"),
    Column("stale"),
)  # fmt: skip
ROOT = float(np.sqrt(2.0))


def list_robots(record: Record) -> str:
    """Write a row for each robot."""
    stale = [row.serial for row in list_stale(record)]
    rows = []
    for robot in record.rows(RobotRow):
        life = Life.of(record, robot.serial)
        last = life.verdicts[-1].date[:10] if life.verdicts else ""
        rows.append(
            (robot.serial, robot.arm, robot.line, state_of(life),
             str(len(life.verdicts)), last, str(stale.count(robot.serial)))
        )  # fmt: skip
    return table_text(LISTED, rows)


def state_of(life: Life) -> str:
    """Say how a robot is, by its last check and what has come since."""
    if life.robot.state != "in use":
        return life.robot.state
    if not life.verdicts:
        return "not checked"
    last = life.verdicts[-1]
    if any(m.date > last.date for m in life.models):
        return "not checked since its model is new"
    if any(e.date > last.date for e in life.events):
        return "not checked since its last event"
    return "in control" if last.in_control else "act"


def show_robot(life: Life) -> str:
    """Write what the record has of a robot, oldest first, and its model."""
    robot = life.robot
    line = f", {robot.line}" if robot.line else ""
    since = f"cell {robot.cell}, since {robot.added[:10]}"
    lines = [f"{robot.serial}: {robot.arm}{line}, {since}"]
    told = [(m.date, _model(m)) for m in life.models]
    told += [(e.date, f"{e.kind} {e.joints} {e.note}".rstrip()) for e in life.events]
    told += [(v.date, _check(v)) for v in life.verdicts]
    lines += [f"  {date[:10]}  {text}" for date, text in sorted(told)]
    return "\n".join(lines)


def _model(row: ModelRow) -> str:
    left = "" if row.left_mm is None else f", leaves {row.left_mm:.3f} mm"
    return f"model {row.id} {row.origin} ({row.file}{left}), {row.state}"


def _check(row: VerdictRow) -> str:
    size = f"mean {row.mean_mm:.3f} mm, 95 % {row.within_mm:.3f} ({row.n} readings)"
    return f"check: {'in control' if row.in_control else row.moved}; {size}"


def tell_check(serial: str, verdict: CheckVerdict, known: bool) -> str:
    """Write a verdict on one screen."""
    lines = [
        _headline(serial, verdict),
        f"error of {len(verdict.errors)} readings: mean {verdict.mean_mm:.3f} mm, "
        f"95 % {verdict.within_mm:.3f}, max {verdict.worst_mm:.3f}",
        f"T2 {verdict.statistic:.1f} (limit {verdict.limit:.1f}), moving average "
        f"{verdict.drift:.1f} (limit {verdict.drift_limit:.1f})",
        *_power(verdict.power),
    ]
    if known:
        lines.append("the record had these readings: nothing was added")
    if not verdict.in_control:
        lines.append(_next_step(serial, verdict))
    return "\n".join(lines)


def _headline(serial: str, verdict: CheckVerdict) -> str:
    if verdict.in_control:
        but = (
            f", but for {', '.join(verdict.power.blind)}" if verdict.power.blind else ""
        )
        return f"{serial}: in control{but}"
    best, *others = verdict.likely
    if best.nats < 0.0:
        return f"{serial}: moved, and no cause explains it alone"
    text = f"{serial}: moved: {best.describe()}"
    if others:
        text += f" (or just as well {others[0].cause.name})"
    return f"{text}; evidence {name_evidence(best.nats)}"


def tell_foreseen(foreseen: Power) -> str:
    """Say what a check will tell, on lines of its own."""
    return "".join(f"\n{line}" for line in _power(foreseen))


def _power(check: Power) -> list[str]:
    """Say what a check finds, what it cannot see, and what it hardly tells apart."""
    lines = [f"found in 95 %: {_least(check.found)}"]
    if check.blind:
        lines.append(f"this check cannot see: {', '.join(check.blind)}")
    if pairs := [" from ".join(pair) for pair in check.alike]:
        lines.append(f"this check can hardly tell {', '.join(pairs)}")
    return lines


def _least(found: Mapping[str, float]) -> str:
    """Write the least change of each single cause that is found."""
    told = []
    for name, size in found.items():
        if not np.isfinite(size):
            continue
        if name.startswith(ZERO):
            told.append(f"{name} {ROOT * size:.2f} mrad")
        elif name in (TOOL, BASE):
            told.append(f"{name} {ROOT * size:.2f} mm")
    return ", ".join(told)


def _next_step(serial: str, verdict: CheckVerdict) -> str:
    best = verdict.shown[0].cause
    if best.event is None:
        return "next: read that pose again, then check again"
    joints = ",".join(map(str, best.event.joints))
    given = f" --joints {joints}" if joints else ""
    return (
        f"next: find out what happened, record it (postproc robot event {serial} "
        f"{best.event.kind}{given}), then postproc robot refresh {serial} READINGS.csv"
    )


def check_json(serial: str, verdict: CheckVerdict) -> str:
    """Return a verdict as JSON."""
    causes = [
        {"cause": s.cause.name, "also": list(s.cause.also), "nats": round(s.nats, 3),
         "told": s.describe()}
        for s in verdict.shown[:10]
    ]  # fmt: skip
    told = {
        "robot": serial, "in_control": verdict.in_control,
        "readings": len(verdict.errors), "mean_mm": verdict.mean_mm,
        "p95_mm": verdict.within_mm, "max_mm": verdict.worst_mm,
        "t2": verdict.statistic, "t2_limit": verdict.limit,
        "average": verdict.drift, "average_limit": verdict.drift_limit,
        "blind": list(verdict.power.blind),
        "alike": [list(pair) for pair in verdict.power.alike],
        "causes": causes,
    }  # fmt: skip
    return json.dumps(schema("robot-check") | told, indent=1)


def tell_refresh(serial: str, found: Refreshed, output: str) -> str:
    """Write what a refresh did, and which programs are stale."""
    new = found.refresh
    lines = [
        f"{serial}: model {new.model.id} written to {output} ({found.why})",
        f"before {new.before.tell()}",
        f"after  {new.after.tell()}, each pose by a model made without it",
    ]
    if found.why == UNTOLD:
        lines.append(
            "warning: no event is recorded since the last model: the readings move it "
            "as far as the survey was unsure alone"
        )
    lines += tell_stale(found.stale)
    again = "; postproc batch --stale makes the stale programs again"
    stale = any(program.is_stale() for program in found.stale)
    lines.append(f"next: compensate with {output}{again if stale else ''}")
    return "\n".join(lines)


def tell_stale(stale: Iterable[StaleProgram]) -> list[str]:
    """List programs that would move, worst first."""
    every = list(stale)
    moved = [s for s in every if s.is_stale()]
    lines = [f"{len(moved)} of {len(every)} programs are stale (over {STALE_MM:g} mm)"]
    for one in moved:
        told = (
            f"{one.moves_mm:.3f} mm" if one.moves_mm >= 0 else f"not known: {one.why}"
        )
        lines.append(f"  {one.row.path}: {told}")
    return lines


def tell_replacement(new: str, done: Sequence[ReplacedProgram]) -> str:
    """List the programs that a robot took over, and what is not corrected of them."""
    written = [p for p in done if not p.why]
    lines = [f"{new}: {len(written)} of {len(done)} programs written"]
    for one in done:
        if one.why:
            lines.append(f"  {one.row.path}: not written: {one.why}")
        elif one.uncorrected:
            told = ", ".join(f"{count} {code}" for code, count in one.uncorrected)
            lines.append(f"  {one.row.path}: not corrected: {told}")
    return "\n".join(lines)
