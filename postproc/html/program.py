"""The page of a compensated program: what moved, by how much, and what did not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from postproc.compensation.outcome import Outcome, Status
from postproc.html.columns import Program, columns_of
from postproc.html.listing import listing
from postproc.html.packing import choose, pack
from postproc.html.page import render
from postproc.html.rows import columns_from
from postproc.html.summary import (
    finite,
    histogram,
    left_alone,
    seconds,
    tell_counts,
    uncertainty,
)

SCRIPTS = ("page.js", "columns.js", "view.js", "table.js", "source.js", "program.js")


def program_report(outcome: Outcome, sources: Mapping[str, bytes] | None = None) -> str:
    """Make the page of an outcome.

    Args:
        outcome: What came of a program.
        sources: Bytes of the source files by name; default: those of the outcome.
    """
    program = Program(
        name=outcome.program,
        model=outcome.model,
        columns=columns_of(outcome),
        predicted={"before": asdict(outcome.before), "after": asdict(outcome.after)},
        diagnostics=tuple(asdict(d) for d in outcome.diagnostics),
        stages=outcome.stages,
        sources=outcome.sources if sources is None else sources,
    )
    return _page(program)


def program_report_from_json(
    data: Mapping[str, Any], sources: Mapping[str, bytes] | None = None
) -> str:
    """Make the page of a written report.

    Args:
        data: What ``compensate --report`` wrote.
        sources: Bytes of the source files by name, where they are at hand.

    Raises:
        KeyError, ValueError, TypeError: It is no such report.
    """
    program = Program(
        name=str(data["program"]),
        model=str(data["model"]),
        columns=columns_from(data["targets"]),
        predicted={when: data["predicted"][when] for when in ("before", "after")},
        diagnostics=tuple(data.get("diagnostics", ())),
        stages=data.get("stages_s", {}),
        sources=sources or {},
    )
    return _page(program)


def _page(program: Program) -> str:
    """Choose what the page carries and render it."""
    columns = program.columns
    carried = columns[choose(columns)]
    payload = {
        "columns": pack(carried),
        "listing": listing(program.sources, carried),
        "histogram": histogram(columns),
        "predicted": finite(program.predicted),
    }
    return render(
        "program.html.j2",
        program.name,
        payload,
        SCRIPTS,
        program=program,
        counts=tell_counts(columns),
        corrected=int((columns.status == Status.SAFE).sum()),
        groups=left_alone(columns),
        predicted=finite(program.predicted),
        sigma=uncertainty(columns),
        stages=seconds(program.stages),
        shown=len(carried),
        placed=bool(np.isfinite(columns.position_mm).all(axis=1).any()),
    )
