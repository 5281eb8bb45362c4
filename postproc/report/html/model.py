"""The page of a model: what was fitted, how well, and what rows could not see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.measurements import Measurements
from postproc.calibration.report import FitReport
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.report.head import ReportHead
from postproc.report.html.figure import (
    AFTER,
    OTHER,
    Figure,
    PoseFigures,
    along_axes,
    distribution,
    figure,
    in_space,
    log_axis,
    points,
    pose_figures,
    round_values,
    thin,
)
from postproc.report.html.page import render
from postproc.report.json import finite
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

# The steps in which a model came about, as rows of a page.


def name_of(effect: Mapping[str, Any]) -> str:
    """Name an effect with its joint and what drives it.

    >>> name_of({"effect": "coupling", "joint": 6, "source": "joint 5"})
    'coupling of joint 6 by joint 5'
    """
    joint, source = effect.get("joint"), effect.get("source")
    name = str(effect["effect"])
    name += "" if joint is None else f" of joint {joint}"
    own = source is None or source == f"joint {joint}"
    return name if own else f"{name} by {source}"


def steps(history: Sequence[Mapping[str, Any]] | None) -> list[dict[str, Any]]:
    """Take what the table of steps shows; what a step does not tell stays empty."""
    return [_step(entry) for entry in history or ()]


def _step(entry: Mapping[str, Any]) -> dict[str, Any]:
    added = entry.get("added") or ([entry] if "effect" in entry else [])
    means = {
        when: (entry.get(when) or {}).get("mean_mm") for when in ("before", "after")
    }
    return {
        "parent": str(entry.get("parent") or ""),
        "verdict": str(entry.get("verdict") or ""),
        "added": [name_of(effect) for effect in added],
        "rows": entry.get("n_held_out", ""),
        **means,
    }


# The page of a model: what was fitted, how well, and what the rows could not see.

SCRIPTS = ("page.js", "sheets.js", "figures.js")
SHOWN_UNITS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/(N m)": ("urad/(N m)", 1e6)}
CORRELATED = 0.9
UNSEEN = 0.1  # a parameter known less than this is at its prior
MOST_PAIRS = 40


def calibration_report(
    model: Mapping[str, Any], fit: Mapping[str, Any] | None = None
) -> str:
    """Make the page of a model file.

    Args:
        model: The model file.
        fit: The report of the fit with its rows, see `postproc.report.html.model`;
            default: what stands under ``fit`` in the file, or nothing. Without it the
            page has no residuals.

    Raises:
        KeyError, ValueError, TypeError: It is no model file.
    """
    told = dict(fit or model.get("fit") or {})
    rows = _rows(told.get("rows"))
    figures = {"coverage": coverage(model["ranges"], rows)}
    figures |= residuals(rows) if rows else {}
    parameters = told.get("parameters") or parameter_table(model["parameters"])
    pairs = told.get("correlated") or list_correlated(model)
    iso: dict[str, PoseFigures] = {}
    if rows:
        q, side = rows["q_deg"], rows["lambda"].astype(int)
        iso = {when: pose_figures(q, side, rows[f"{when}_mm"]) for when in WHEN}
    return render(
        "calibration.html.j2",
        f"Model {model['id']}",
        {"figures": figures},
        SCRIPTS,
        model=model,
        head=ReportHead.of_model(
            model["id"], model["data_sha256"], model.get("provenance") or {}
        ).rows(),
        fit=told,
        parameters=parameters,
        unseen=told.get("unseen")
        or [str(p["name"]) for p in parameters if p["determined"] < UNSEEN],
        pairs=pairs[:MOST_PAIRS],
        more_pairs=max(0, len(pairs) - MOST_PAIRS),
        iso=iso,
        has_rows=bool(rows),
        history=steps(model.get("history")),
    )


def _rows(rows: Mapping[str, Sequence[Any]] | None) -> dict[str, Floats]:
    if not rows:
        return {}
    return {k: np.array(v, dtype=float) for k, v in rows.items() if k != "id"}


WHEN = ("before", "after")


def residuals(rows: Mapping[str, Floats]) -> dict[str, Figure]:
    """Show measured errors and what the model leaves of them."""
    errors = {when: rows[f"{when}_mm"] for when in WHEN}
    size = {when: np.linalg.norm(e, axis=1) for when, e in errors.items()}
    order = np.arange(1.0, len(size["before"]) + 1)
    some = thin(len(order))
    along = [points(when, order[some], s[some]) for when, s in size.items()]
    whole = np.concatenate([*size.values()])
    whole = whole[whole > 0]
    axis = log_axis(float(whole.min()), float(whole.max())) if len(whole) else {}
    return {
        "histogram": distribution(size),
        "axes": along_axes(errors),
        "order": figure(along, "visit order", "error [mm]", yaxis=axis),
        "space": in_space(rows["position_mm"], errors),
    }


def coverage(ranges: Mapping[str, Any], rows: Mapping[str, Floats]) -> Figure:
    """Show which angles of every joint the survey covered."""
    low, high = (np.rad2deg(np.array(ranges[k])) for k in ("lower", "upper"))
    joints = [f"J{j}" for j in range(1, 7)]
    bar = {
        "type": "bar",
        "orientation": "h",
        "name": "range covered",
        "y": joints,
        "base": round_values(low, 2),
        "x": round_values(high - low, 2),
        "marker": {"color": "#dcdcdc", "line": {"color": OTHER, "width": 1}},
        "hovertemplate": "%{base:.1f} deg and %{x:.1f} deg on<extra></extra>",
    }
    traces: list[Figure] = [bar]
    if rows:
        some = thin(len(rows["q_deg"]), 2000)
        q = rows["q_deg"][some]
        marker = {"symbol": "line-ns-open", "size": 9, "color": AFTER, "opacity": 0.5}
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "rows",
                "x": round_values(q.T, 2),
                "y": np.repeat(joints, len(q)).tolist(),
                "marker": marker,
            }
        )
    axis = {"autorange": "reversed", "type": "category"}
    return figure(traces, "joint angle [deg]", "", yaxis=axis)


def parameter_table(parameters: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Write the parameters of a model file in the units that people use."""
    out = []
    for p in parameters:
        unit, factor = SHOWN_UNITS.get(p["unit"], (p["unit"], 1.0))
        prior = p["prior_std"]
        known = 1.0 - (p["std_error"] / prior) ** 2 if prior > 0 else 1.0
        out.append(
            {
                "name": p["name"],
                "value": p["value"] * factor,
                "std_error": p["std_error"] * factor,
                "unit": unit,
                "share": None,
                "determined": float(np.clip(known, 0.0, 1.0)),
            }
        )
    return out


def list_correlated(model: Mapping[str, Any]) -> list[tuple[str, str, float]]:
    """List pairs of parameters that the rows cannot tell apart well, worst first."""
    names = [p["name"] for p in model["parameters"]]
    packed = np.array(model["covariance"], dtype=float)
    if len(packed) == 0:
        return []
    i, j = np.triu_indices(len(names))
    std = np.sqrt(packed[i == j])
    scale = std[i] * std[j]
    r = np.divide(packed, scale, out=np.zeros_like(packed), where=scale > 0)
    rows = np.flatnonzero((i < j) & (np.abs(r) > CORRELATED))
    rows = rows[np.argsort(-np.abs(r[rows]), kind="stable")]
    return [(names[i[k]], names[j[k]], float(r[k])) for k in rows]


# What a calibration page shows beyond the model file: the rows and the report.


def fit_evidence(
    report: FitReport, model: Model, survey: Measurements, arm: Arm
) -> dict[str, Any]:
    """Put the report of a fit and its rows into JSON values.

    Returns:
        The fields of the report, ``unseen`` in words, and ``rows``: lists of ``id``,
        ``q_deg``, ``lambda``, ``position_mm``, ``before_mm`` (measured error) and
        ``after_mm`` (what the model leaves of it), in visit order, base frame.
    """
    states = survey.states
    before = survey.position - ArmStates(arm, states).walk.tcp
    after = before - model.predict_measured(arm, states)
    told = asdict(report) | {"unseen": [str(u) for u in report.unseen]}
    rows = {
        "id": list(survey.ids),
        "q_deg": _lists(np.rad2deg(states.q), 6),
        "lambda": np.asarray(states.direction, dtype=int).tolist(),
        "position_mm": _lists(survey.position / MM, 4),
        "before_mm": _lists(before / MM, 5),
        "after_mm": _lists(after / MM, 5),
    }
    evidence: dict[str, Any] = finite(told | {"rows": rows})
    return evidence


def _lists(values: Floats, digits: int) -> list[list[float]]:
    """Round, as nested lists."""
    lists: list[list[float]] = np.round(values, digits).tolist()
    return lists


# The page of a comparison: every method on the same rows.


def comparison_report(comparison: Mapping[str, Any]) -> str:
    """Make the page of what ``compare --report`` wrote as JSON.

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
        span=comparison.get("span_deg") or (),
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
