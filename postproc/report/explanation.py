"""Why every target moves, as a table and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.explanation import Explanation
from postproc.compensation.outcome import Status
from postproc.compensation.solver.arrivals import ArrivalStates
from postproc.exceptions import printable
from postproc.files import schema
from postproc.report.json import target_rows
from postproc.report.terminal import Column, arrows, print_table, status_colour
from postproc.robot.pose import MM

STATUS = "status, reason"
FEW = 3  # places of origin that a row names
COLUMNS = (
    Column("line"),
    Column("target", "left"),
    Column("from", "left"),
    Column("q [deg]"),
    Column("J1-6", "left"),
    Column("correction x, y, z [mm]"),
    Column("+- x, y, z [mm]"),
    Column(STATUS, "left"),
)
IN_TIME = (Column("v [mm/s]"), Column("AT_p [mm]"))  # where it was run in time
PLANNED = (*COLUMNS[:5], Column(STATUS, "left"))  # without a model
SHARES = (Column("effect", "left"), *map(Column, ("share mm", "x", "y", "z")))
WHOLE = "predicted error"  # the sum of the shares
PART = ("of it free forms", "+- free forms")  # what no law predicts, and how surely


def explanation_json(found: Explanation, line: int | None = None) -> str:
    """Return one object per visit as JSON text.

    Raises:
        ProgramError: There is no target on the line asked for.
    """
    chosen = found.choose_visits(line)
    if found.outcome is not None:
        told = target_rows(found.outcome, chosen)
    else:
        told = (_plan_row(found, i) for i in chosen.tolist())
    rows = [
        {
            **row,
            "from": found.name_origins(i),
            "travel_deg": _degrees_or_none(found.travel[i]),
        }
        for i, row in zip(chosen.tolist(), told, strict=True)
    ]
    return json.dumps({**schema("explanation"), "visits": rows}, indent=1) + "\n"


def _plan_row(found: Explanation, i: int) -> dict[str, object]:
    """Describe visit i without a model."""
    v = found.visits
    return {
        "line": int(v.place.line[i]),
        "name": v.target_name(i) or None,
        "q_deg": _degrees_or_none(found.q[i]),
        "lambda": [int(s) for s in found.direction[i]],
        "code": found.reasons[i].name,
        "reason": found.reasons[i].text,
    }


def print_explanation(found: Explanation, line: int | None = None) -> None:
    """Print a table, one row per visit, and how many came out how.

    Of one line, the shares of the effects in every visit follow instead.

    Raises:
        ProgramError: There is no target on the line asked for.
    """
    rows = found.choose_visits(line)
    cells = (_cells(found, i) for i in rows.tolist())
    columns: Sequence[Column] = PLANNED if found.outcome is None else COLUMNS
    if found.in_time is not None:
        columns = (*COLUMNS[:-1], *IN_TIME, COLUMNS[-1])
    print_table(columns, cells, {STATUS: status_colour})
    if line is None:
        print("\n".join(map(printable, found.summary().split("\n"))))
    elif found.outcome is not None and found.outcome.arrivals is not None:
        shares = found.outcome.arrivals.shares(rows) / MM
        free = found.outcome.arrivals.free(rows) / MM
        for i, own, part in zip(rows.tolist(), shares, free, strict=True):
            _print_shares(found, i, own, part, found.outcome.arrivals)


def _print_shares(
    found: Explanation, i: int, shares: Floats, free: Floats, told: ArrivalStates
) -> None:
    """Print which of k effects has which share in the error there.

    Args:
        found: The explanation.
        i: The visit.
        shares: Of the effects, (k, 3) [mm].
        free: What free forms have of it, and how surely, (2, 3) [mm].
        told: Names the effects.
    """
    if not np.isfinite(shares).any():
        return
    sizes = np.linalg.norm(shares, axis=1)
    order = np.argsort(-sizes, kind="stable").tolist()
    rows = [_share_cells(told.effects[k], shares[k]) for k in order]
    rows.append(_share_cells(WHOLE, shares.sum(axis=0)))
    if told.free_forms:
        rows += map(_share_cells, PART, free)
    place = f"{found.line_of(i, 'line ')} from {_few(found.name_origins(i))}:"
    print(f"\n{printable(place)}")
    print_table(SHARES, rows)


def _cells(found: Explanation, i: int) -> list[str]:
    """Write visit i as the cells of a table row."""
    v = found.visits
    name = v.target_name(i) or ("VIA" if v.motion.via[i] else "inline")
    sides = arrows(found.direction[i])
    angles = " ".join(_format_number(q, 8, 3) for q in np.rad2deg(found.q[i]))
    cells = [found.line_of(i), name, _few(found.name_origins(i)), angles, sides]
    if found.outcome is None:
        return [*cells, found.reasons[i].text]
    d = found.outcome.decisions
    moved = " ".join(_format_number(c, 7, 3) for c in d.correction[i] / MM)
    sure = " ".join(_format_number(s, 5, 3) for s in d.std_error[i] / MM)
    status = Status(d.status[i]).name.lower()
    why = d.reasons[d.why[i]].text
    said = f"{status}: {why}" if why else status
    return [*cells, moved, sure, *_write_speed(found, i), said]


def _write_speed(found: Explanation, i: int) -> list[str]:
    """Write how fast visit i is passed, and how well the way there is kept to."""
    told = found.in_time
    if told is None:
        return []
    speed = float(told.after.clock.speed[told.own[i]]) / MM
    at = np.flatnonzero(told.paths.visit == i)
    sizes = [f"{size:.3f}" for size in (told.paths.after.sizes[at] / MM).tolist()]
    return [_format_number(speed, 7, 1), *(sizes or [""])]


def _few(places: str) -> str:
    """Shorten a list of places that a visit is reached from.

    >>> _few("line 3, line 5, line 7, line 9")
    'line 3, line 5 and 2 more'
    """
    listed = places.split(", ")
    if len(listed) <= FEW:
        return places
    return f"{', '.join(listed[: FEW - 1])} and {len(listed) - FEW + 1} more"


def _format_number(value: float, width: int, digits: int) -> str:
    """Write a number; a dash where it is not known."""
    return f"{value:{width}.{digits}f}" if np.isfinite(value) else "-".rjust(width)


def _degrees_or_none(values: Floats) -> list[float | None]:
    """Round angles [rad] to degrees; what is not known becomes None."""
    degrees = np.rad2deg(values).tolist()
    return [round(v, 5) if np.isfinite(v) else None for v in degrees]


def _share_cells(name: str, share: Floats) -> list[str]:
    """Write a share (3,) [mm] as the cells of a table row."""
    size = float(np.linalg.norm(share))
    rounded = [round(v, 4) + 0.0 for v in (size, *share.tolist())]  # no -0.0
    return [name, *(_format_number(v, 7, 4) for v in rounded)]
