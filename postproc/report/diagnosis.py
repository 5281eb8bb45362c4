"""A diagnosis, and the chain of models that led to one, as text and JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from postproc.calibration.diagnosis.investigate import REMAINS
from postproc.calibration.diagnosis.result import Diagnosis
from postproc.calibration.evidence import name_evidence
from postproc.calibration.report import DirectionReport
from postproc.files import schema
from postproc.model.effects.effect import PART_MOTION
from postproc.model.model import Model, load_model
from postproc.model.statistics import ErrorStatistics
from postproc.report.terminal import Column, fold_cells, table_text

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


def tell(found: Diagnosis) -> str:
    """Write a diagnosis for a terminal."""
    lines = found.headlines()
    if found.findings:
        lines.append(
            table_text(FINDINGS, (_finding_row(found, k) for k in _numbers(found)))
        )
    lines += [_constants(found, k) for k in _numbers(found)]
    lines += [
        f"before {_spread(found.before)}",
        f"after  {_spread(found.after)}",
        f"on {found.n_held_out} rows held out of the search that predicts them; "
        f"noise floor {found.noise_floor_mm:.4f} mm ({found.noise_floor_source})",
    ]
    if found.vap_mm is not None:
        lines.append(f"vAP {found.vap_mm[0]:.4f} -> {found.vap_mm[1]:.4f} mm")
    lines += [*found.notes, *found.fixed_points, *filter(None, [found.flanks])]
    if found.set_anew is not None:
        lines.append(found.set_anew.tell())
    lines += [
        f"{f.effect} may be tracker_drift and is not compensated. Rows on monuments "
        "(column reference) would separate the two"
        for f in found.findings
        if f.settings.get("form") == "time" and not f.settings.get("told")
    ]
    if found.verdict == "unexplained":
        lines += _describe_unexplained(found)
    if found.verdict == "noise":
        lines += [f"not excluded: {what}" for what in found.not_excluded]
    if found.verdict != "unexplained" and found.after.mean_mm > (
        ABOVE * found.noise_floor_mm
    ):
        lines.append(
            "the remaining error is "
            f"{found.after.mean_mm / found.noise_floor_mm:.1f} times the noise floor: "
            "the arm repeats worse than its data sheet states, or these rows do not "
            "show an effect that the model lacks. Measure some poses twice"
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


def _describe_unexplained(found: Diagnosis) -> list[str]:
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
        f"closest: {p.direction} by {p.driver} (evidence {name_evidence(p.evidence)}, "
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
        row = (model.id, "fitted", _list_effects(model), "", "", str(model.rows), "")
        return table_text(HISTORY, fold_cells(HISTORY, [row], ADDED)) + _origin(model)
    first = str(model.history[0].get("parent", ""))
    made = [*(str(r.get("parent", "")) for r in model.history[1:]), model.id]
    steps = [
        _step(name, record) for name, record in zip(made, model.history, strict=True)
    ]
    rows = [(first, "given", "", "", "", "", ""), *steps]
    return table_text(HISTORY, fold_cells(HISTORY, rows, ADDED)) + _origin(model)


def _origin(model: Model) -> str:
    """Write where a model comes from, nothing where its file does not tell."""
    return "" if model.provenance is None else f"\n{model.id} {model.provenance}"


def _step(name: str, record: Mapping[str, Any]) -> tuple[str, ...]:
    """Write one step of the history: the model that was made, and from what."""
    added = []
    for one in record["added"]:
        where = f" of joint {one['joint']}" if one.get("joint") else ""
        by = f" by {one['source']}" if one.get("source") else ""
        p_value = f"{float(one['p_value']):.1e}"
        added.append(f"{one['effect']}{where}{by}, p = {p_value}")
    return (
        name, str(record["verdict"]), "; ".join(added) or "nothing",
        f"{record['before']['mean_mm']:.4f}", f"{record['after']['mean_mm']:.4f}",
        str(record["n_held_out"]), str(record["data_sha256"])[:12],
    )  # fmt: skip


def _list_effects(model: Model) -> str:
    return ", ".join(e.name for e in model.effects.effects)


def history_json(model_path: Path) -> str:
    """Return the chain as JSON."""
    model = load_model(model_path)
    told: dict[str, object] = {"id": model.id, "history": list(model.history)}
    if model.provenance is not None:
        told["provenance"] = asdict(model.provenance)
    return json.dumps(schema("history") | told, indent=1)
