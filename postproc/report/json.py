"""The report as JSON, some thousand visits at a time, so that memory stays flat."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from json.encoder import encode_basestring_ascii
from typing import Any

import numpy as np

from postproc.arrays import (
    Cells,
    Floats,
    Ints,
    chunks,
    format_fixed,
    format_texts,
    shortest,
    text_of,
    whole,
)
from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.solver.arrivals import ArrivalStates
from postproc.files import schema
from postproc.language.visits import Meaning, Visits
from postproc.report.head import ReportHead
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

AT_ONCE = 10_000  # visits
SIGNS = ("-1", "0", "1")
JOINTS = 6  # numbers of a joint target; a pose may have more


def report_text(outcome: Outcome) -> str:
    """Write the whole report."""
    return b"".join(report_pieces(outcome)).decode("ascii")


def tree_json(entries: Iterable[tuple[str, str, Mapping[str, Any]]]) -> str:
    """Return what came of every program of a tree: its path, status and facts."""
    rows = [{"program": place, "status": what} | dict(f) for place, what, f in entries]
    return json.dumps(finite(schema("tree") | {"programs": rows}), indent=1) + "\n"


def report_pieces(outcome: Outcome) -> Iterator[bytes]:
    """Write the report piece by piece."""
    outcome = outcome.reported
    head = {**schema("report"), "program": outcome.program, "model": outcome.model}
    yield (json.dumps(head)[:-1] + ', "targets": [').encode()
    for rows in chunks(len(outcome.visits), AT_ONCE):
        yield b",\n" if rows.start else b"\n"
        yield _objects(outcome, np.arange(rows.start, rows.stop))
    tail = {
        "head": ReportHead.of_outcome(outcome).to_json(),
        "predicted": {"before": asdict(outcome.before), "after": asdict(outcome.after)},
        "motion": {key: round(size, 5) for key, size in outcome.motion.items()},
        **in_time_of(outcome),
        **(
            {}
            if outcome.opinion is None
            else {"second_opinion": outcome.opinion.to_dict()}
        ),
        **error_summary_of(outcome),
        **tolerance_of(outcome),
        "diagnostics": [asdict(d) for d in outcome.diagnostics],
        "stages_s": dict(outcome.stages),
    }
    yield ("],\n" + json.dumps(finite(tail))[1:] + "\n").encode()


def error_summary_of(outcome: Outcome) -> dict[str, Any]:
    """Describe the expected true errors."""
    from postproc.report.tolerance import describe_errors

    return describe_errors(outcome)


def tolerance_of(outcome: Outcome) -> dict[str, object]:
    """Describe expected errors against a tolerance; nothing where nobody asked."""
    if outcome.tolerance is None:
        return {}
    from postproc.report.tolerance import tolerance_json

    return {"tolerance": tolerance_json(outcome.tolerance)}


def in_time_of(outcome: Outcome) -> dict[str, object]:
    """Describe the program in time, and its paths; nothing where nobody asked."""
    if outcome.in_time is None:
        return {}
    from postproc.report.in_time import describe_timing  # many files, where it is timed

    return describe_timing(outcome.in_time, outcome.visits)


def target_rows(outcome: Outcome, rows: Ints) -> Iterator[dict[str, object]]:
    """Describe visits, ascending, in the keys of the report."""
    for some in chunks(len(rows), AT_ONCE):
        yield from json.loads(b"[" + _objects(outcome, rows[some]) + b"]")


def _objects(outcome: Outcome, rows: Ints) -> bytes:
    """Write visits as JSON objects with commas between them."""
    columns: list[Cells] = []
    for key, (first, *others) in _columns(outcome, rows).items():
        lead = f'{", " if columns else "{"}"{key}": '
        columns += [first.behind(lead.encode()), *others]
    return text_of(len(rows), [*columns, Cells(b"},\n")])[: -len(b",\n")]


def _columns(outcome: Outcome, rows: Ints) -> dict[str, list[Cells]]:
    """Say what stands behind every key, for some visits."""
    v, d, told = outcome.visits, outcome.decisions, outcome.arrivals
    move = np.where(v.motion.via[rows], len(Motion), v.motion.kind[rows])
    placed, turned = len(outcome.position) > 0, len(d.turn) > 0
    degrees = (
        {"correction_deg": [_format_rows(np.rad2deg(d.turn[rows]), 6)]}
        if turned
        else {}
    )
    position = _format_rows(outcome.position[rows] / MM, 4) if placed else Cells(b"[]")
    return {
        "line": [whole(v.place.line[rows])],
        "file": [format_texts(v.files, v.place.file[rows], json.dumps)],
        "literal": _literals(outcome, rows),
        "name": [format_texts(v.target.names, v.target.name[rows], _quote)],
        "move": [format_texts([*(m.name for m in Motion), "VIA"], move, json.dumps)],
        "q_deg": [_format_rows(np.rad2deg(d.q[rows]), 5)],
        "lambda": [
            format_texts(
                SIGNS, d.direction[rows].astype(np.int64) + 1, str
            ).bracket_rows()
        ],
        "side": [_format_rows(d.side[rows], 3)],
        "status": [
            format_texts([s.name.lower() for s in Status], d.status[rows], json.dumps)
        ],
        "code": [format_texts([r.name for r in d.reasons], d.why[rows], json.dumps)],
        "reason": [format_texts([r.text for r in d.reasons], d.why[rows], json.dumps)],
        "original": [_as_written(v, v.target.values, rows)],
        "corrected": [_as_written(v, d.corrected, rows)],
        "position_mm": [position],
        "correction_mm": [_format_rows(d.correction[rows] / MM, 5)],
        **degrees,
        "step_mm": [_steps(outcome, rows)],
        "std_error_mm": [_format_rows(d.std_error[rows] / MM, 5)],
        **({} if told is None else {"share_mm": _shares(told, rows)}),
        **({} if told is None else _free(told, rows)),
        **_errors(outcome, rows),
        **_speed(outcome, rows),
    }


def _quote(name: str) -> str:
    """Write a name as JSON, null where there is none."""
    return encode_basestring_ascii(name) if name else "null"


def _errors(outcome: Outcome, rows: Ints) -> dict[str, list[Cells]]:
    """Write the expected true error before and after, and its 95 % bound."""
    errors = outcome.expected
    if errors is None:
        return {}
    columns = {
        "expected_before_mm": errors.before,
        "expected_mm": errors.after,
        "bound_95_mm": errors.high,
    }
    return {name: [format_fixed(x[rows] / MM, 5)] for name, x in columns.items()}


def _speed(outcome: Outcome, rows: Ints) -> dict[str, list[Cells]]:
    """Say how fast the TCP passes, where the program was run in time."""
    told = outcome.in_time
    if told is None:
        return {}
    return {
        "speed_mm_s": [format_fixed(told.after.clock.speed[told.own[rows]] / MM, 3)]
    }


def _steps(outcome: Outcome, rows: Ints) -> Cells:
    """Write how far the correction moves from the fly point before, null without."""
    before, correction = outcome.visits.run_mates[rows], outcome.decisions.correction
    step = np.linalg.norm(correction[rows] - correction[before], axis=1) / MM
    return format_fixed(np.where(before < 0, np.nan, step), 5)


def _shares(arrivals: ArrivalStates, rows: Ints) -> list[Cells]:
    """Write the size of every effect's share as an object."""
    sizes = arrivals.sizes(rows) / MM
    parts = []
    for number, name in enumerate(arrivals.effects):
        lead = f"{', ' if number else '{'}{json.dumps(name)}: "
        parts.append(format_fixed(sizes[:, number], 5).behind(lead.encode()))
    return [*parts, Cells(b"}" if parts else b"{}")]


def _free(arrivals: ArrivalStates, rows: Ints) -> dict[str, list[Cells]]:
    """Write what free forms predict, and how surely; nothing without free forms."""
    if not arrivals.free_forms:
        return {}
    error, std = np.moveaxis(arrivals.free(rows) / MM, 1, 0)
    return {
        "nonparametric_mm": [_format_rows(error, 5)],
        "nonparametric_std_mm": [_format_rows(std, 5)],
    }


def _literals(outcome: Outcome, rows: Ints) -> list[Cells]:
    """Write where the numbers of every visit stand."""
    v = outcome.visits
    literal = v.target.literal[rows]
    has = np.flatnonzero(literal >= 0)
    if not len(has):
        return [Cells(b"null")]
    none = literal < 0
    literal[none] = literal[has[0]]
    files = format_texts(v.files, v.literals.file[literal], json.dumps)
    lines = whole(v.literals.line[literal])
    return [
        files.within(b'{"file": ', b"", b', "line": ').unless(none, b"null"),
        lines.within(b"", b"", b"}").unless(none, b""),
    ]


def _format_rows(values: Floats, decimals: int) -> Cells:
    """Write rows of numbers (k, p) for a person; what is not known becomes null."""
    return format_fixed(values, decimals).bracket_rows()


def _as_written(visits: Visits, values: Floats, rows: Ints) -> Cells:
    """Write the numbers of the file (k, w); nothing where the file holds none."""
    values, none = values[rows], visits.target.literal[rows] < 0
    if values.shape[1] > JOINTS:
        values[visits.target.meaning[rows] == Meaning.JOINTS, JOINTS:] = np.nan
    return shortest(values, 9).bracket_rows().unless(none, b"[]")


def finite(value: Any) -> Any:
    """Replace NaN, which JSON does not have, by null, all the way down."""
    if isinstance(value, Mapping):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
