"""The report as JSON, some thousand visits at a time, so that memory stays flat."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from postproc.language.visits import Motion
from postproc.pose import MM
from postproc.report import Outcome, Status

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

AT_ONCE = 5_000  # visits


def report_pieces(outcome: Outcome) -> Iterator[str]:
    """Write the report piece by piece."""
    head = {"program": outcome.program, "model": outcome.model}
    yield json.dumps(head)[:-1] + ', "targets": ['
    comma = "\n"
    for first in range(0, len(outcome.visits), AT_ONCE):
        rows = np.arange(first, min(first + AT_ONCE, len(outcome.visits)))
        yield comma + ",\n".join(_rows(_columns(outcome, rows)))
        comma = ",\n"
    tail = {
        "predicted": {"before": asdict(outcome.before), "after": asdict(outcome.after)},
        "diagnostics": [asdict(d) for d in outcome.diagnostics],
        "stages_s": dict(outcome.stages),
    }
    yield "],\n" + json.dumps(finite(tail))[1:] + "\n"


def target_row(outcome: Outcome, i: int) -> dict[str, object]:
    """Describe visit i in the keys of the report."""
    row: dict[str, object] = json.loads(*_rows(_columns(outcome, np.array([i]))))
    return row


def _rows(columns: Mapping[str, list[str]]) -> Iterator[str]:
    """Write visits as JSON objects of the given keys."""
    row = "{" + ", ".join(f'"{key}": %s' for key in columns) + "}"
    return (row % values for values in zip(*columns.values(), strict=True))


def _columns(outcome: Outcome, rows: Ints) -> dict[str, list[str]]:
    """Write the values of every key as JSON, for some visits."""
    v, d = outcome.visits, outcome.decisions
    move = np.where(v.via[rows], len(Motion), v.motion[rows])
    has = v.literal[rows] >= 0
    placed, turned = len(outcome.position) > 0, len(d.turn) > 0
    degrees = (
        {"correction_deg": _rounded(np.rad2deg(d.turn[rows]), 6)} if turned else {}
    )
    return {
        "line": list(map(str, v.line[rows].tolist())),
        "file": _named(v.files, v.file[rows]),
        "literal": _literals(outcome, rows),
        "name": _named([name or None for name in v.names], v.name[rows]),
        "move": _named([*(m.name for m in Motion), "VIA"], move),
        "q_deg": _rounded(np.rad2deg(d.q[rows]), 5),
        "lambda": _whole(d.direction[rows]),
        "side": _rounded(d.side[rows], 3),
        "status": _named([s.name.lower() for s in Status], d.status[rows]),
        "why": _named(d.reasons, d.why[rows]),
        "original": _as_written(v.values[rows], has),
        "corrected": _as_written(d.corrected[rows], has),
        "position_mm": _rounded(outcome.position[rows] / MM, 4)
        if placed
        else ["[]"] * len(rows),
        "correction_mm": _rounded(d.correction[rows] / MM, 5),
        **degrees,
        "step_mm": _steps(outcome, rows),
        "std_error_mm": _rounded(d.std_error[rows] / MM, 5),
    }


def _steps(outcome: Outcome, rows: Ints) -> list[str]:
    """Write how far the correction moves from the fly point before, null without."""
    before, correction = outcome.visits.run_mates[rows], outcome.decisions.correction
    step = np.linalg.norm(correction[rows] - correction[before], axis=1) / MM
    return [
        "null" if mate < 0 else f"{size:.5f}"
        for mate, size in zip(before.tolist(), step.tolist(), strict=True)
    ]


def _named(texts: Sequence[str | None], index: Ints) -> list[str]:
    """Write one of some texts for every visit."""
    used, at = np.unique(index, return_inverse=True)
    written = [json.dumps(texts[k]) for k in used.tolist()]
    return [written[k] for k in at.tolist()]


def _literals(outcome: Outcome, rows: Ints) -> list[str]:
    """Write where the numbers of every visit stand."""
    v = outcome.visits
    literal = v.literal[rows]
    out, has = ["null"] * len(rows), np.flatnonzero(literal >= 0)
    files = _named(v.files, v.literals.file[literal[has]])
    lines = v.literals.line[literal[has]].tolist()
    for k, file, line in zip(has.tolist(), files, lines, strict=True):
        out[k] = f'{{"file": {file}, "line": {line}}}'
    return out


def _rounded(values: Array, decimals: int) -> list[str]:
    """Write rows of numbers (k, p) for a person; what is not known becomes null."""
    row = "[" + ", ".join([f"%.{decimals}f"] * values.shape[1]) + "]"
    text = "\n".join([row] * len(values)) % tuple(values.ravel().tolist())
    return text.replace("nan", "null").split("\n")


def _whole(values: Array) -> list[str]:
    """Write rows of whole numbers (k, p)."""
    return [str(row) for row in values.astype(np.int64).tolist()]


def _as_written(values: Array, written: NDArray[np.bool_]) -> list[str]:
    """Write the numbers of the file (k, 6); nothing where the file holds none."""
    exact = [
        json.dumps([None if v != v else round(v, 9) for v in row])
        for row in values[written].tolist()
    ]
    out = ["[]"] * len(values)
    for k, text in zip(np.flatnonzero(written).tolist(), exact, strict=True):
        out[k] = text
    return out


def finite(value: object) -> object:
    """Replace NaN, which JSON does not have, by null."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
