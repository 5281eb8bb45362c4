"""The page of a diagnosis: what the model lacks, and what says so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from postproc.report.html.figure import (
    AFTER,
    OTHER,
    Figure,
    bars,
    distribution,
    figure,
    points,
    round_values,
    thin,
)
from postproc.report.html.model import name_of, steps
from postproc.report.html.page import render

SCRIPTS = ("page.js", "sheets.js", "figures.js")
VERDICTS = {
    "effect": "The model lacks a named effect.",
    "noise": "The remaining error is noise: these rows show no missing effect.",
    "rejected": "The result is worse on new poses: no model is written.",
    "unexplained": "The remaining error is not noise, and no named effect explains it.",
}
BANDS = 24  # of the running mean along a covariate
FEWEST = 3  # rows in a band
MOST_CANDIDATES = 25


def diagnosis_report(diagnosis: Mapping[str, Any]) -> str:
    """Make the page of what ``diagnose --report`` wrote as JSON.

    Beyond the keys that every diagnosis has, the page shows, where they are given:
    ``evidence`` of an effect (``covariate``, ``unit``, ``direction``, and lists ``x``,
    ``before_mm``, ``after_mm`` of the residual projected on the effect's direction),
    ``candidates`` (``effect``, ``joint``, ``source``, ``p_value``), ``rows`` (lists
    ``before_mm``, ``after_mm`` of held-out error vectors) and ``history``.

    Raises:
        KeyError, ValueError, TypeError: It is no such report.
    """
    effects = list(diagnosis["effects"])
    candidates = distinct(diagnosis.get("candidates") or ())
    figures: dict[str, Figure] = {"summary": before_after(diagnosis)}
    for k, effect in enumerate(effects):
        if effect.get("evidence"):
            figures[f"evidence-{k}"] = evidence(effect["evidence"])
    if candidates:
        figures["candidates"] = significance(candidates[:MOST_CANDIDATES])
    if diagnosis.get("rows"):
        rows, when = diagnosis["rows"], ("before", "after")
        errors = [np.array(rows[f"{name}_mm"], dtype=float) for name in when]
        sizes = [np.linalg.norm(error, axis=1) for error in errors]
        figures["histogram"] = distribution(dict(zip(when, sizes, strict=True)))
    return render(
        "diagnosis.html.j2",
        f"Diagnosis: {diagnosis['verdict']}",
        {"figures": figures},
        SCRIPTS,
        diagnosis=diagnosis,
        said=diagnosis.get("story") or VERDICTS.get(diagnosis["verdict"], ""),
        effects=effects,
        names=[name_of(e) for e in effects],
        alike=[[name_of(c) for c in e.get("confusable_with", ())] for e in effects],
        candidates=[{**c, "name": name_of(c)} for c in candidates[:MOST_CANDIDATES]],
        figures=figures,
        history=steps(diagnosis.get("history")),
    )


def distinct(candidates: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Keep the best of the candidates of one name, which differ in settings only."""
    best: dict[str, Mapping[str, Any]] = {}
    for candidate in sorted(candidates, key=lambda c: float(c["p_value"])):
        best.setdefault(name_of(candidate), candidate)
    return list(best.values())


def before_after(diagnosis: Mapping[str, Any]) -> Figure:
    """Show the statistics of held-out errors beside the noise floor."""
    keys = ("mean_mm", "p95_mm", "max_mm")
    names = ["mean", "95 %", "max"]
    traces = [
        bars(
            when,
            [diagnosis[when][k] for k in keys],
            names,
            orientation="h",
            texttemplate="%{x:.3f}",
            textposition="outside",
            cliponaxis=False,
        )
        for when in ("before", "after")
    ]
    floor = diagnosis["noise_floor_mm"]
    span = {"x0": floor, "x1": floor, "y0": 0, "y1": 1, "yref": "paper"}
    shape = {"type": "line", **span, "line": {"color": OTHER, "dash": "dash"}}
    text = {
        "text": "noise floor",
        "x": floor,
        "y": 1,
        "yref": "paper",
        "xanchor": "left",
        "yanchor": "bottom",
        "showarrow": False,
    }
    known = floor is not None
    return figure(
        traces,
        "error on held-out rows [mm]",
        "",
        barmode="group",
        yaxis={"autorange": "reversed", "type": "category"},
        xaxis={"rangemode": "tozero"},
        shapes=[shape] if known else [],
        annotations=[text] if known else [],
    )


def evidence(data: Mapping[str, Any]) -> Figure:
    """Show the projected residual against the covariate, before and after."""
    x = np.array(data["x"], dtype=float)
    some = thin(len(x))
    traces: list[Figure] = []
    for when in ("before", "after"):
        y = np.array(data[f"{when}_mm"], dtype=float)
        traces.append(points(when, x[some], y[some], opacity=0.55))
        middle, mean = running_mean(x, y)
        dash = "dash" if when == "before" else "solid"
        colour = traces[-1]["marker"]["color"]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": f"mean {when}",
                "x": middle,
                "y": mean,
                "line": {"color": colour, "width": 3, "dash": dash},
            }
        )
    unit = f" [{data['unit']}]" if data.get("unit") else ""
    where = data.get("direction") or "its direction"
    return figure(traces, f"{data['covariate']}{unit}", f"residual along {where} [mm]")


def running_mean(x: Any, y: Any) -> tuple[list[float | None], list[float | None]]:
    """Average y (n,) in bands that hold equally many x (n,)."""
    order = np.argsort(x, kind="stable")
    count = max(1, min(BANDS, len(order) // FEWEST))
    bands = np.array_split(order, count)
    filled = [band for band in bands if len(band)]
    middle = np.array([np.median(x[band]) for band in filled])
    mean = np.array([np.mean(y[band]) for band in filled])
    return round_values(middle, 6), round_values(mean, 6)


def significance(candidates: Sequence[Mapping[str, Any]]) -> Figure:
    """Show how surprising each candidate's score is: -log10 of its p-value."""
    least = 1e-300
    p = np.array([max(float(c["p_value"]), least) for c in candidates])
    marker = {"color": AFTER, "line": {"color": AFTER, "width": 1}}
    trace = {
        "type": "bar",
        "orientation": "h",
        "x": round_values(-np.log10(p), 3),
        "y": [f"{k + 1}. {name_of(c)}" for k, c in enumerate(candidates)],
        "marker": marker,
    }
    axis = {"autorange": "reversed", "type": "category", "automargin": True}
    return figure([trace], "−log10 of the p-value", "", yaxis=axis)
