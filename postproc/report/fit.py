"""A fit, and a comparison of methods, as text, JSON and a page."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from postproc.calibration.baselines import VOLUME_DEG, Comparison
from postproc.calibration.evidence import WEAK, name_evidence
from postproc.calibration.fit import Calibration
from postproc.calibration.report import FitReport, Found
from postproc.files import schema
from postproc.report.diagnosis import tell_directions
from postproc.report.json import finite
from postproc.report.terminal import Column, table_text

FOUND = (
    Column("found", "left"),
    Column("joint"),
    Column("rms mm"),
    Column("max mm"),
    Column("evidence", "left"),
    Column("", "left"),
)
MOST, FEW = 20, 8  # findings, and rows, that a short report lists
SHOWN_MM = 0.0005  # of poses: less is not listed
COMPARED = (
    Column("method", "left"),
    Column("range mm"),
    Column("mean mm"),
    Column("std mm"),
)


def tell_fit_files(found: Calibration, output: Path) -> str:
    """Write the report of a fit, and where its model is, for a terminal.

    Args:
        found: The fit.
        output: The file its model was written to.
    """
    report = tell_fit(found.report)
    if found.rejected:
        return f"{report}\nno model is written: {found.rejected}"
    return f"{report}\nmodel {found.model.id} written to {output}"


def fit_json(found: Calibration) -> str:
    """Return the whole report of a fit, parameters and findings, as JSON text.

    A figure that is not known is null: JSON has no word for it.
    """
    verdict = "rejected" if found.rejected else "accepted"
    said = {
        **schema("fit"),
        "model": found.model.id,
        "verdict": verdict,
        **asdict(found.report),
    }
    return json.dumps(finite(said), indent=1, allow_nan=False) + "\n"


def fit_page(found: Calibration) -> str:
    """Return the page (HTML) of a fit."""
    from postproc.report.html import calibration_report
    from postproc.report.html.model import fit_evidence

    rows = fit_evidence(found.report, found.model, found.survey, found.cell.arm)
    return calibration_report(found.model.to_dict(), rows)


def comparison_page(found: Comparison) -> str:
    """Return the page (HTML) of a comparison of methods."""
    from postproc.report.html import comparison_report

    return comparison_report(asdict(found))


def tell_fit(report: FitReport) -> str:
    """Write the report of a fit for a terminal."""
    lines = [_tell_found(_large(report.found)), *_tell_rest(report)]
    if report.held_out is not None:
        lines.insert(0, report.held_out.describe())
    lines += _tell_rows(report)
    lines += tell_directions(report.directions, FEW)
    lines += [report.flanks, *(f"warning: {warning}" for warning in report.warnings)]
    lines += [] if report.free is None else [report.free.tell()]
    lines += _tell_scatter(report)
    return "\n".join(line for line in lines if line)


def _tell_found(found: Sequence[Found]) -> str:
    """Write what effects do, as a table; no line where nothing has a name."""
    if not found:
        return ""
    cells = (
        (
            f.effect, str(f.joint or ""), f"{f.size_mm:.3f}", f"{f.max_mm:.3f}",
            name_evidence(f.evidence), _remark(f),
        )
        for f in found
    )  # fmt: skip
    return table_text(FOUND, cells)


def _remark(found: Found) -> str:
    """Say what is special about a finding."""
    told = [f"IMPOSSIBLE: {text}" for text in found.impossible]
    if found.wave is not None:
        order, size, error = found.wave
        told.append(f"order {order:.4g}, {size:.3f} +- {error:.3f} mrad")
    if found.setup:
        told.append("of the set-up: not compensated")
    return "; ".join(told)


def _large(found: Sequence[Found]) -> list[Found]:
    """Take the largest findings for which there is evidence, and impossible ones."""
    shown = [f for f in found if f.evidence > WEAK]
    few = shown[:MOST]
    return few + [f for f in found if f.impossible and f not in few]


def _tell_rest(report: FitReport) -> list[str]:
    """Say in a line each what is small, alike, or not determined."""
    lines, found = [], report.found
    shown = _large(found)
    rest = [f for f in found if f not in shown]
    if rest:
        size = float(np.sqrt(sum(f.size_mm**2 for f in rest)))
        names = _count_names(f.effect for f in rest)
        lines.append(f"small or without evidence, {size:.3f} mm together: {names}")
    if report.unseen:
        names = _group_names(u.name for u in report.unseen)
        count = len(report.unseen)
        lines.append(
            f"{count} parameters not determined by the rows, at the prior: {names}"
        )
    if report.correlated:
        names = _count_names(a.partition(".")[0] for a, _, _ in report.correlated)
        lines.append(f"pairs of strongly correlated parameters: {names}")
    if lines:
        lines.append("--report FILE.json lists all parameters and rows")
    return lines


def _count_names(names: Iterable[str]) -> str:
    """Count names, the most frequent first.

    >>> _count_names(["a", "b", "b"])
    '2 of b, 1 of a'
    """
    return ", ".join(f"{n} of {name}" for name, n in Counter(names).most_common())


def _group_names(names: Iterable[str]) -> str:
    """Name parameters by their effects; where there are more than a few, count them.

    >>> _group_names(["geometry.a2", "backlash.b1", "geometry.d2"])
    'geometry a2 d2, backlash b1'
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        effect, _, own = name.partition(".")
        groups.setdefault(effect, []).append(own)
    return ", ".join(
        f"{effect} {' '.join(own) if len(own) < FEW else len(own)}"
        for effect, own in sorted(groups.items(), key=lambda g: -len(g[1]))
    )


def _tell_rows(report: FitReport) -> list[str]:
    """List rows that count less, and those that stand out and count all the same."""
    rows = report.dropped
    lines = [f"row {row.id} (line {row.line}): {row.why}" for row in rows[:FEW]]
    if len(rows) > FEW:
        lines.append(f"and {len(rows) - FEW} more rows that count less")
    if report.spared:
        ids = ", ".join(report.spared[:FEW])
        more = len(report.spared) - FEW
        ids += f" and {more} more" if more > 0 else ""
        lines.append(f"suspect, but used, because nearby rows agree: row {ids}")
    return lines


def _tell_scatter(report: FitReport) -> list[str]:
    """Tell of the noise, which published methods do not know, and of the errors."""
    lines = []
    if report.tracker_mm or report.repeatability_mm:
        lines.append(
            f"tracker {report.tracker_mm:.4f} mm, repeatability "
            f"{report.repeatability_mm:.4f} mm per axis ({report.repeated})"
        )
    if report.pose_mm > SHOWN_MM:
        lines.append(
            f"errors of poses that no effect describes {report.pose_mm:.4f} mm per "
            f"axis (estimated; {report.split})"
        )
    if report.orientation_mrad is not None:
        lines.append(f"orientation {report.orientation_mrad:.4f} mrad (estimated)")
    lines.append(f"measured error  {report.before.tell()}")
    lines.append(f"error after fit {report.after.tell()}")
    return lines


def comparison_json(found: Comparison) -> str:
    """Return a comparison as JSON text."""
    return json.dumps({**schema("comparison"), **asdict(found)}, indent=1) + "\n"


def tell_comparison(found: Comparison) -> str:
    """Write a comparison for a terminal."""
    rows = (
        (
            r.method,
            f"{r.min_mm:.4f} .. {r.max_mm:.4f}",
            f"{r.mean_mm:.4f}",
            f"{r.std_mm:.4f}",
        )
        for r in found.rows
    )
    span = ", ".join(f"{v:.0f}" for v in found.span_deg)
    told = f"joints 1 to 6 span {span} deg"
    if max(found.span_deg) > VOLUME_DEG:
        told += f"; the ELMs follow about {VOLUME_DEG:.0f}"
    return f"{table_text(COMPARED, rows)}\n{found.split}\n{told}"
