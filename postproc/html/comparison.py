"""The page of a comparison: every method on the same rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from postproc.html.figure import AFTER, OTHER, Figure, figure
from postproc.html.page import render

SCRIPTS = ("page.js", "figures.js")


def comparison_report(comparison: Mapping[str, Any]) -> str:
    """Make the page of what ``compare --json`` wrote.

    Raises:
        KeyError, ValueError, TypeError: It is no such report.
    """
    rows = sorted(comparison["rows"], key=lambda row: -float(row["mean_mm"]))
    return render(
        "comparison.html.j2",
        "Methods compared",
        {"figures": {"methods": methods(rows)}},
        SCRIPTS,
        rows=rows,
        split=comparison["split"],
    )


def methods(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Show mean, standard deviation and range of every method."""
    names = [row["method"] for row in rows]
    ranges: dict[str, list[Any]] = {"x": [], "y": []}
    for row in rows:
        ranges["x"] += [row["min_mm"], row["max_mm"], None]
        ranges["y"] += [row["method"]] * 2 + [None]
    spans = {
        **ranges,
        "type": "scatter",
        "mode": "lines+markers",
        "name": "min to max",
        "line": {"color": OTHER, "width": 1},
        "marker": {"symbol": "line-ns-open", "size": 10, "color": OTHER},
    }
    means = {
        "type": "scatter",
        "mode": "markers",
        "name": "mean ± std",
        "x": [row["mean_mm"] for row in rows],
        "y": names,
        "marker": {"symbol": "diamond", "size": 11, "color": AFTER},
        "error_x": {"array": [row["std_mm"] for row in rows], "color": AFTER},
    }
    axis = {"autorange": "reversed", "type": "category", "automargin": True}
    zero = {"rangemode": "tozero"}
    return figure([spans, means], "error [mm]", "", yaxis=axis, xaxis=zero)
