"""Diagnosing files: what is read, written and told; measured points of a program."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.calibration.diagnosis.diagnose import Extension, diagnose
from postproc.calibration.diagnosis.result import Diagnosis
from postproc.calibration.diagnosis.search import Progress
from postproc.calibration.diagnosis.trace import REMAINS, silent
from postproc.calibration.fit import file_shifts, read_surveys, several_points
from postproc.calibration.measurements import (
    COVARIATES,
    POSITION,
    Measurements,
    concatenate,
    read_points,
    read_stations,
)
from postproc.calibration.plausibility import (
    check_against,
    check_own_registration,
    check_stops,
)
from postproc.calibration.references import split_references
from postproc.calibration.registration import register, station_of
from postproc.calibration.report import DirectionReport
from postproc.calibration.tables import DETECT, TableFormat
from postproc.cli.jobs import read_files
from postproc.compensation.program import Planned, plan_visits, read_program, states_of
from postproc.exceptions import MeasurementError
from postproc.model.effects.effect import PART_MOTION
from postproc.model.effects.placement import Placement
from postproc.model.kinematics import Batch
from postproc.model.model import Model, load_model
from postproc.model.registration import Registration
from postproc.model.statistics import ErrorStatistics
from postproc.report.terminal import Column, folded, table_text
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import MM, inverse

# Measured points of a program: which visit each of them belongs to.


def join_program(
    data: Path, program: Path, cell: Cell, reading: TableFormat = DETECT
) -> Measurements:
    """Give measured points the planned states of the visits they were taken at.

    A row belongs to the visit with its id in a MEASURE comment, else to the only visit
    of the variable with that name.

    Args:
        data: Columns id, x_mm, y_mm, z_mm and any recorded covariate, or a list of
            points as SpatialAnalyzer and Leica software write it.
        program: The program that ran.
        cell: Its cell.
        reading: What the user knows of the file.

    Raises:
        MeasurementError: An id that the program does not have, or has several times.
        ProgramError: The program cannot be read.
    """
    table, references = split_references(read_points(data, reading))
    visits = read_program(read_files(program), cell).visits
    planned = plan_visits(visits, cell)
    places = _places(visits.measure_id, [visits.names[k] for k in visits.name])
    ids = table.text("id")
    rows = np.array([_visit_of(places, i, table.path, line) for i, line in zip(
        ids, table.line.tolist(), strict=True)], dtype=np.int64)  # fmt: skip
    order = np.argsort(rows, kind="stable")
    states = states_of(planned.plan, cell, cell.temperature, visits)[rows[order]]
    recorded = {
        name: scale * table.numbers(column, empty=True)[order]
        for column, (name, scale) in COVARIATES.items()
        if table.has(column)
    }
    lost = np.flatnonzero(np.isnan(states.q).any(axis=1))
    if len(lost):
        row = order[lost[0]]
        raise _unplanned(data, ids[row], int(table.line[row]), planned, int(rows[row]))
    stations, station = read_stations(table)
    return Measurements(
        path=table.path,
        states=states.with_(**recorded, station=station[order]),
        stations=stations,
        position=table.block(POSITION)[order] * MM,
        ids=tuple(ids[k] for k in order),
        line=table.line[order],
        inferred=np.zeros(len(rows), dtype=bool),
        sha256=table.sha256,
        references=references,
    )


def _unplanned(
    data: Path, name: str, line: int, planned: Planned, visit: int
) -> MeasurementError:
    """Say that a measured visit has no planned state."""
    problem = f"the program's visit {name} cannot be planned: {planned.reasons[visit]}"
    return MeasurementError(
        data, problem, "Mend the program or leave the row out", line=line
    )


def _places(measured: tuple[str, ...], names: list[str]) -> dict[str, list[int]]:
    """List the visits of every id, and of every variable name."""
    places: dict[str, list[int]] = {}
    for visit, (mark, name) in enumerate(zip(measured, names, strict=True)):
        for key in {mark.lower(), name.lower()} - {""}:
            places.setdefault(key, []).append(visit)
    return places


def _visit_of(places: dict[str, list[int]], key: str, path: Path, line: int) -> int:
    """Find the visit of an id."""
    found = places.get(key.lower(), [])
    if len(found) == 1:
        return found[0]
    problem = "has no visit" if not found else f"has {len(found)} visits"
    raise MeasurementError(
        path,
        f"id {key} {problem} in the program",
        "Mark the move with a comment -- MEASURE <id>",
        line=line,
    )


# Diagnosing files: what is read, written and told.

LIKELIEST = 8  # wrong directions that are listed
ADDED = "added"
HISTORY = (
    Column("model", "left"),
    Column("verdict", "left"),
    Column(ADDED, "left"),
    Column("before mm"),
    Column("after mm"),
    Column("rows"),
    Column("data", "left"),
)
FINDINGS = (
    Column("effect", "left"),
    Column("joint"),
    Column("by", "left"),
    Column("p"),
    Column("share"),
    Column("peak mm"),
    Column("or just as well", "left"),
)


ABOVE = 1.2  # of the noise floor: more is told
REGISTERED = (Placement.name,)  # what is fitted besides where the tracker is found


@dataclass(frozen=True)
class Asked:
    """How measurements are to be diagnosed.

    Attributes:
        output: The extended model's file; default: beside the given one.
        program: The program whose points were measured, compensated or not.
        measured_frame: "base", "uframe" or "tracker": what positions are given in.
        seed: Of the bootstrap.
    """

    output: Path | None = None
    program: Path | None = None
    measured_frame: str = "base"
    seed: int = 0


def diagnose_files(
    data: Sequence[Path],
    cell_path: Path,
    model_path: Path,
    asked: Asked = Asked(),
    progress: Progress = silent,
) -> Extension:
    """Diagnose measurement files with a model, and write the extended model.

    Args:
        data: Measurement files.
        cell_path: The cell.
        model_path: The model that may lack something.
        asked: What the user wants.
        progress: Told what is being done.

    Raises:
        PostprocError: A file cannot be used, or the model cannot be extended.
    """
    cell, model = load_cell(cell_path), load_model(model_path)
    model.check_arm(cell.arm, model_path)
    if asked.program is None:
        survey = read_surveys(data, cell)
    else:
        program = asked.program
        survey = concatenate([join_program(path, program, cell) for path in data])
    tracker, setup, placed = cell.tracker, several_points(survey), None
    notes: tuple[str, ...] = ()
    if asked.measured_frame == "uframe":
        survey = from_user_frame(survey, cell)
    elif asked.measured_frame == "tracker":
        seen = survey
        survey, placed = from_tracker_frame(survey, cell, model)
        notes = registrations(seen, survey, placed, cell, model)
        tracker, setup = placed.origin, REGISTERED
    if placed is None:
        setup = (*setup, *file_shifts(survey, cell.arm, cell.tracker))
    check_against(survey, cell.arm, model)
    found = diagnose(
        survey, cell.arm, model, tracker=tracker, setup=setup, seed=asked.seed,
        progress=progress,
    )  # fmt: skip
    seen_fixed = (*found.diagnosis.fixed_points, *notes)
    found = replace(
        found,
        model=replace(found.model, registration=placed),
        diagnosis=replace(found.diagnosis, fixed_points=seen_fixed),
    )
    if found.diagnosis.verdict != "rejected":
        found.model.save(asked.output or extended_path(model_path))
    return found


def extended_path(model_path: Path) -> Path:
    """Name the extended model's file when nobody did."""
    return model_path.with_name(f"{model_path.stem}.extended.json")


def from_user_frame(survey: Measurements, cell: Cell) -> Measurements:
    """Convert positions from the cell's user frame to the arm's base frame."""
    T = inverse(cell.base.pose) @ cell.uframe.pose
    return replace(survey, position=survey.position @ T[:3, :3].T + T[:3, 3])


def from_tracker_frame(
    survey: Measurements, cell: Cell, model: Model
) -> tuple[Measurements, Registration]:
    """Convert positions from the tracker's frame, found with the model's help.

    A model that was fitted in the tracker's frame has probe points of its own, which
    are then found again; else those of the cell hold.

    Returns:
        The measurements in the base frame, and where tracker and probes are.
    """
    effects, values, _ = model.compensable()
    check_own_registration(survey, cell.arm)
    check_stops(survey, cell.arm)
    states = survey.states
    placed = register(
        cell.arm, states, survey.position, effects, values, survey.stations
    )
    _, first, which = np.unique(states.tool_id, return_index=True, return_inverse=True)
    if any(isinstance(e, Placement) for e in model.effects.effects):
        states = states.with_(tool=placed.probes[which])
    placed = replace(placed, probes=states.tool[first])
    position = placed.to_base(survey.position, states.station)
    return replace(survey, states=states, position=position), placed


def registrations(
    seen: Measurements,
    base: Measurements,
    placed: Registration,
    cell: Cell,
    model: Model,
) -> tuple[str, ...]:
    """Say what the model leaves in its survey's set-up, and registered by these rows.

    Args:
        seen: The rows in the tracker's frame.
        base: The same in the base frame, by a registration of their own.
        placed: That registration.
        cell: The cell.
        model: The model.
    """

    def left(rows: Measurements) -> float:
        error = model.error(cell.arm, rows.states)
        gap = rows.position - Batch(cell.arm, rows.states).walk.tcp - error
        return float(np.linalg.norm(gap, axis=1).mean()) / MM

    spent = 6 * len(placed.transforms) + 3 * len(placed.probes)
    free = max(3 * len(seen) - spent, 1)
    own = left(base) * float(np.sqrt(3 * len(seen) / free))
    told = (
        f"registered from its own rows the file is left {own:.4f} mm on average "
        f"({spent} numbers of {3 * len(seen)} readings counted)"
    )
    survey = model.registration
    if survey is None or np.setdiff1d(seen.states.tool_id, survey.tool_ids).size:
        return (told,)
    there = station_of(survey, cell.arm, seen.states, seen.position, seen.stations)
    station = seen.states.station
    as_fitted = left(
        replace(
            seen,
            states=there.on_probes(seen.states),
            position=there.to_base(seen.position, station),
        )
    )
    return (told, f"in the set-up of the model's survey {as_fitted:.4f} mm")


def tell(found: Diagnosis) -> str:
    """Write a diagnosis for a terminal."""
    lines = [f"verdict: {found.verdict}", found.story()]
    if found.findings:
        lines.append(
            table_text(FINDINGS, (_finding_row(found, k) for k in _numbers(found)))
        )
    lines += [_constants(found, k) for k in _numbers(found)]
    lines += [
        f"before {_spread(found.before)}",
        f"after  {_spread(found.after)}",
        f"on {found.n_held_out} rows, each left out of the search that predicts it; "
        f"noise floor {found.noise_floor_mm:.4f} mm ({found.noise_floor_source})",
    ]
    if found.vap_mm is not None:
        lines.append(f"vAP {found.vap_mm[0]:.4f} -> {found.vap_mm[1]:.4f} mm")
    lines += [*found.notes, *found.fixed_points, *filter(None, [found.flanks])]
    if found.set_anew is not None:
        lines.append(found.set_anew.tell())
    lines += [
        f"{f.effect} may be tracker_drift: nothing of it is compensated. Rows on fixed "
        "points (column reference) would tell"
        for f in found.findings
        if f.settings.get("form") == "time" and not f.settings.get("told")
    ]
    if found.verdict == "unexplained":
        lines += _unexplained(found)
    if found.verdict == "noise":
        lines += [f"not excluded: {what}" for what in found.not_excluded]
    if found.verdict != "unexplained" and found.after.mean_mm > (
        ABOVE * found.noise_floor_mm
    ):
        lines.append(
            f"what is left is {found.after.mean_mm / found.noise_floor_mm:.1f} times "
            "the noise floor: the arm repeats worse than its data sheet says, or "
            "something is missing that these rows do not show. Measure some poses twice"
        )
    lines += [f"row {d.id} (line {d.line}): {d.why}" for d in found.dropped]
    lines += tell_directions(found.directions, LIKELIEST)
    lines.append(f"measure next, to {found.why_next} (q1..q6 deg):")
    lines += [
        "  " + " ".join(f"{x:9.3f}" for x in np.degrees(q))
        for q in found.next_measurements
    ]
    return "\n".join(lines)


def tell_directions(found: DirectionReport | None, most: int) -> list[str]:
    """Tell of wrong directions in the file, likeliest first; the rest is counted."""
    if found is None:
        return []
    rows = found.likeliest[:most]
    names = ", ".join(f"{w.id} joint {w.joint} ({w.probability:.2f})" for w in rows)
    more = len(found.likeliest) - len(rows)
    return [
        f"directions: {found.rate:.1%} of the {found.telling} that rows can tell are "
        f"wrong in the file (estimated); {found.turned} were fitted the other way, "
        f"{found.unsure} as not known",
        f"likeliest wrong: row {names}" + (f" and {more} more" if more else ""),
    ]


def _numbers(found: Diagnosis) -> range:
    return range(len(found.findings))


def _finding_row(found: Diagnosis, number: int) -> tuple[str, ...]:
    f = found.findings[number]
    others = ", ".join(
        effect + (f" {joint}" if joint else "") for effect, joint in f.confusable_with
    )
    cells = ", ".join(str(r) for r in f.rivals if r.effect == PART_MOTION)
    others = "; ".join(filter(None, (others, cells)))
    return (
        f.effect, str(f.joint or ""), f.source or "", f"{f.p_value:.1e}",
        f"{f.share:.0%}", f"{f.peak_mm:.3f}", others,
    )  # fmt: skip


def _constants(found: Diagnosis, number: int) -> str:
    """Write the parameters of a finding in one line, the clearest ones."""
    f = found.findings[number]
    clear = [
        f"{name} = {value:.4g}" + (f" +- {error:.2g}" if error else "") + f" {unit}"
        for name, (value, error, unit) in f.parameters.items()
        if abs(value) > 2 * error
    ]
    told = f"{f.effect}: " + (", ".join(clear[:8]) or "no parameter stands out")
    if f.told:
        told = f"{f.told}, {f.peak_mm:.2g} mm at the tool; no name in the library"
    doubts = [f"IMPOSSIBLE: {text}" for text in f.impossible]
    if f.of_setup and not f.nameless:
        doubts.append("of the set-up: not compensated")
    return "; ".join([told, *doubts])


def _spread(spread: ErrorStatistics) -> str:
    return (
        f"mean {spread.mean_mm:.4f} mm, std {spread.std_mm:.4f}, 95 % "
        f"{spread.p95_mm:.4f}, max {spread.max_mm:.4f}"
    )


def _unexplained(found: Diagnosis) -> list[str]:
    """Say what shows the structure, and where it lives."""
    curves = [f for f in found.findings if f.nameless]
    lines = [
        f"no effect with a name follows {f.source}"
        + (f" at joint {f.joint}" if f.joint else "")
        + f": a curve takes up {f.share:.0%} (p = {f.p_value:.2g})"
        + ("; it may be the set-up's: not compensated" if f.of_setup else "")
        for f in curves
    ]
    shown = [x for x in found.leftovers if x.p_value < REMAINS]
    lines += [f"still there: {x.what} (p = {x.p_value:.2g})" for x in shown[:2]]
    if not shown:
        return lines
    return lines + [
        f"closest: {p.direction} by {p.driver} ({p.evidence:.1f} nats, "
        f"p = {p.p_value:.2g})"
        for p in found.places[:2]
    ]


def history_text(model_path: Path) -> str:
    """Write the chain of models that led to a model, oldest first.

    Raises:
        ModelError: The file cannot be used.
    """
    model = load_model(model_path)
    if not model.history:
        row = (model.id, "fitted", _named(model), "", "", str(model.rows), "")
        return table_text(HISTORY, folded(HISTORY, [row], ADDED))
    first = str(model.history[0].get("parent", ""))
    made = [*(str(r.get("parent", "")) for r in model.history[1:]), model.id]
    steps = [
        _step(name, record) for name, record in zip(made, model.history, strict=True)
    ]
    rows = [(first, "given", "", "", "", "", ""), *steps]
    return table_text(HISTORY, folded(HISTORY, rows, ADDED))


def _step(name: str, record: Mapping[str, Any]) -> tuple[str, ...]:
    """Write one step of the history: the model that was made, and from what."""
    return (
        name, str(record["verdict"]),
        "; ".join(_added(a) for a in record["added"]) or "nothing",
        f"{record['before']['mean_mm']:.4f}", f"{record['after']['mean_mm']:.4f}",
        str(record["n_held_out"]), str(record["data_sha256"])[:12],
    )  # fmt: skip


def _named(model: Model) -> str:
    return ", ".join(e.name for e in model.effects.effects)


def _added(entry: dict[str, object]) -> str:
    """Write one added effect of the history."""
    where = f" of joint {entry['joint']}" if entry.get("joint") else ""
    by = f" by {entry['source']}" if entry.get("source") else ""
    return f"{entry['effect']}{where}{by}, p = {float(str(entry['p_value'])):.1e}"


def history_json(model_path: Path) -> str:
    """Return the chain as JSON."""
    model = load_model(model_path)
    return json.dumps({"id": model.id, "history": list(model.history)}, indent=1)
