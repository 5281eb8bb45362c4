"""The report as JSON, some thousand visits at a time, so that memory stays flat."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints, Map, chunks
from postproc.byte_columns import (
    ByteColumn,
    beside,
    blanked,
    fixed,
    joined,
    listed,
    named,
    repeated,
    shortest,
    whole,
)
from postproc.compensation.arrivals import ArrivalStates
from postproc.compensation.outcome import Outcome, Status
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

AT_ONCE = 5_000  # visits


def report_text(outcome: Outcome) -> str:
    """Write the whole report."""
    return "".join(report_pieces(outcome))


def report_pieces(outcome: Outcome, each: Map = map) -> Iterator[str]:
    """Write the report piece by piece.

    Args:
        outcome: What came of a program.
        each: How the pieces are made.
    """
    outcome = outcome.reported
    head = {"program": outcome.program, "model": outcome.model}
    yield json.dumps(head)[:-1] + ', "targets": ['
    tasks = list(chunks(len(outcome.visits), AT_ONCE))
    yield from each(lambda rows: _targets(outcome, rows), tasks)
    tail = {
        "predicted": {"before": asdict(outcome.before), "after": asdict(outcome.after)},
        "motion": {key: round(size, 5) for key, size in outcome.motion.items()},
        "diagnostics": [asdict(d) for d in outcome.diagnostics],
        "stages_s": dict(outcome.stages),
    }
    yield "],\n" + json.dumps(finite(tail))[1:] + "\n"


def _targets(outcome: Outcome, rows: slice) -> str:
    """Write some visits; a comma stands before all but the first."""
    comma = ",\n" if rows.start else "\n"
    text = _objects(_columns(outcome, np.arange(rows.start, rows.stop)))
    return comma + text[: -len(",\n")]


def target_rows(outcome: Outcome, rows: Ints) -> Iterator[dict[str, object]]:
    """Describe visits, ascending, in the keys of the report."""
    for some in chunks(len(rows), AT_ONCE):
        text = _objects(_columns(outcome, rows[some]))
        yield from json.loads("[" + text[: -len(",\n")] + "]")


def _objects(columns: Mapping[str, ByteColumn]) -> str:
    """Write visits as JSON objects of the given keys, each with a comma behind it."""
    parts: list[ByteColumn | bytes] = []
    for number, (key, column) in enumerate(columns.items()):
        parts += [f'{", " if number else "{"}"{key}": '.encode(), column]
    return joined([*parts, b"},\n"]).decode("ascii")


def _columns(outcome: Outcome, rows: Ints) -> dict[str, ByteColumn]:
    """Write the values of every key as JSON, for some visits."""
    v, d, told = outcome.visits, outcome.decisions, outcome.arrivals
    move = np.where(v.via[rows], len(Motion), v.motion[rows])
    has = v.literal[rows] >= 0
    placed, turned = len(outcome.position) > 0, len(d.turn) > 0
    degrees = (
        {"correction_deg": _rounded(np.rad2deg(d.turn[rows]), 6)} if turned else {}
    )
    return {
        "line": whole(v.line[rows]),
        "file": named(v.files, v.file[rows], json.dumps),
        "literal": _literals(outcome, rows),
        "name": named([name or None for name in v.names], v.name[rows], json.dumps),
        "move": named([*(m.name for m in Motion), "VIA"], move, json.dumps),
        "q_deg": _rounded(np.rad2deg(d.q[rows]), 5),
        "lambda": _signs(d.direction[rows]),
        "side": _rounded(d.side[rows], 3),
        "status": named([s.name.lower() for s in Status], d.status[rows], json.dumps),
        "why": named(d.reasons, d.why[rows], json.dumps),
        "original": _as_written(v.values[rows], has),
        "corrected": _as_written(d.corrected[rows], has),
        "position_mm": _rounded(outcome.position[rows] / MM, 4)
        if placed
        else repeated(b"[]", len(rows)),
        "correction_mm": _rounded(d.correction[rows] / MM, 5),
        **degrees,
        "step_mm": _steps(outcome, rows),
        "std_error_mm": _rounded(d.std_error[rows] / MM, 5),
        **({} if told is None else {"share_mm": _shares(told, rows)}),
    }


def _steps(outcome: Outcome, rows: Ints) -> ByteColumn:
    """Write how far the correction moves from the fly point before, null without."""
    before, correction = outcome.visits.run_mates[rows], outcome.decisions.correction
    step = np.linalg.norm(correction[rows] - correction[before], axis=1) / MM
    return fixed(np.where(before < 0, np.nan, step), 5)


def _shares(arrivals: ArrivalStates, rows: Ints) -> ByteColumn:
    """Write the size of every effect's share as an object."""
    sizes = arrivals.sizes(rows) / MM
    parts: list[ByteColumn | bytes] = []
    for number, name in enumerate(arrivals.effects):
        key = f"{', ' if number else ''}{json.dumps(name)}: "
        parts += [key.encode(), fixed(sizes[:, number], 5)]
    return beside([b"{", *parts, repeated(b"}", len(rows))])


def _literals(outcome: Outcome, rows: Ints) -> ByteColumn:
    """Write where the numbers of every visit stand."""
    v = outcome.visits
    literal = v.literal[rows]
    has = np.flatnonzero(literal >= 0)
    if not len(has):
        return repeated(b"null", len(rows))
    literal[literal < 0] = literal[has[0]]
    files = named(v.files, v.literals.file[literal], json.dumps)
    lines = whole(v.literals.line[literal])
    told = beside([b'{"file": ', files, b', "line": ', lines, b"}"])
    return blanked(told, v.literal[rows] < 0, b"null")


def _rounded(values: Floats, decimals: int) -> ByteColumn:
    """Write rows of numbers (k, p) for a person; what is not known becomes null."""
    return listed([fixed(values[:, k], decimals) for k in range(values.shape[1])])


def _signs(values: NDArray[np.int8]) -> ByteColumn:
    """Write rows of -1, 0 and 1 (k, p)."""
    signs = values.astype(np.int64) + 1
    return listed([named(["-1", "0", "1"], column, str) for column in signs.T])


def _as_written(values: Floats, written: NDArray[np.bool_]) -> ByteColumn:
    """Write the numbers of the file (k, 6); nothing where the file holds none."""
    told = listed([shortest(values[:, k], 9) for k in range(values.shape[1])])
    return blanked(told, ~written, b"[]")


def finite(value: object) -> object:
    """Replace NaN, which JSON does not have, by null."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
