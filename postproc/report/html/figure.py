"""Figures as plain data, drawn by the page; accuracy in the terms of ISO 9283."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints
from postproc.calibration.iso9283.definitions import (
    pose_accuracy,
    repeatability,
    variation,
)
from postproc.calibration.iso9283.figures import POSE_CYCLES, few

# Figures as plain data, drawn by the page.

Figure = dict[str, Any]

# Okabe and Ito: told apart with any kind of colour vision, and in grey by lightness.
BEFORE, AFTER, OTHER = "#d55e00", "#0072b2", "#767676"
BINS = 40
MOST = 20_000  # points of a figure
CROWDED = 3  # decades from which a logarithmic axis labels powers of ten only


def figure(traces: Sequence[Figure], x: str, y: str, **layout: Any) -> Figure:
    """Put traces on titled axes."""
    axes = {"xaxis": {"title": {"text": x}}, "yaxis": {"title": {"text": y}}}
    for key in ("xaxis", "yaxis"):
        axes[key] = {**axes[key], **layout.pop(key, {})}
    return {"traces": list(traces), "layout": {**axes, **layout}}


def round_values(values: Floats, digits: int = 5) -> list[float | None]:
    """Round for the page; what is not known becomes None."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    return [v if v == v else None for v in np.round(flat, digits).tolist()]


def bars(name: str, x: Sequence[Any], y: Sequence[Any], **more: Any) -> Figure:
    """Make bars; those of what was before are hatched, so that grey tells them too."""
    before = name == "before"
    colour = BEFORE if before else AFTER
    pattern = {"shape": "/" if before else "", "fgcolor": colour, "bgcolor": "#fff"}
    marker = {"color": colour, "line": {"color": colour, "width": 1}}
    if before:
        marker["pattern"] = {**pattern, "solidity": 0.35}
    return {"type": "bar", "name": name, "x": x, "y": y, "marker": marker, **more}


def points(name: str, x: Floats, y: Floats, **more: Any) -> Figure:
    """Make points: open circles before, dots after."""
    before = name == "before"
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": round_values(x),
        "y": round_values(y),
        "marker": {
            "color": BEFORE if before else AFTER,
            "symbol": "circle-open" if before else "circle",
            "size": 6 if before else 5,
            "opacity": 0.8,
        },
        **more,
    }


def distribution(errors: Mapping[str, Floats]) -> Figure:
    """Compare distributions of lengths, on a logarithmic scale: both remain visible."""
    known = {k: v[np.isfinite(v) & (v > 0)] for k, v in errors.items()}
    whole = np.concatenate([*known.values(), [1e-3]])
    edges = np.geomspace(whole.min(), whole.max() * (1 + 1e-9) + 1e-9, BINS + 1)
    traces = []
    for name, v in known.items():
        counts = np.histogram(v, bins=edges)[0]
        line = {"shape": "hv", "color": colour_of(name), "width": 2}
        if name == "before":
            line["dash"] = "dash"
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": name,
                "x": round_values(edges, 6),
                "y": [*counts.tolist(), 0],
                "line": line,
                "fill": "tozeroy",
            }
        )
    axis = log_axis(float(edges[0]), float(edges[-1]))
    return figure(traces, "error [mm]", "rows", xaxis=axis)


def log_axis(low: float, high: float) -> Figure:
    """Make a logarithmic axis whose ticks are whole numbers of a power of ten.

    >>> log_axis(0.02, 0.3)["tickvals"]
    [0.01, 0.02, 0.05, 0.1, 0.2, 0.5]
    """
    first, last = int(np.floor(np.log10(low))), int(np.floor(np.log10(high)))
    steps = (1, 2, 5) if last - first < CROWDED else (1,)
    ticks = [float(f"{k}e{p}") for p in range(first, last + 1) for k in steps]
    return {"type": "log", "tickvals": ticks, "ticktext": [f"{t:g}" for t in ticks]}


def colour_of(name: str) -> str:
    """Choose the colour of what was before or is after."""
    return BEFORE if name == "before" else AFTER


def along_axes(errors: Mapping[str, Floats]) -> Figure:
    """Show the spread of errors (n, 3) axis by axis, each set on its own scale."""
    traces, layout = [], {"grid": {"rows": 1, "columns": 2, "pattern": "independent"}}
    for k, (name, e) in enumerate(errors.items()):
        least, low, mid, high, most = np.percentile(e, (2.5, 25, 50, 75, 97.5), axis=0)
        number = str(k + 1) if k else ""
        traces.append(
            {
                "type": "box",
                "name": name,
                "x": list("xyz"),
                "q1": round_values(low),
                "median": round_values(mid),
                "q3": round_values(high),
                "lowerfence": round_values(least),
                "upperfence": round_values(most),
                "marker": {"color": colour_of(name)},
                "fillcolor": "#fff" if k == 0 else "#9cc8e4",
                "xaxis": f"x{number}",
                "yaxis": f"y{number}",
            }
        )
        layout[f"xaxis{number}"] = {"title": {"text": f"axis, {name}"}}
        layout[f"yaxis{number}"] = {"title": {"text": "" if k else "error [mm]"}}
    return {"traces": traces, "layout": layout}


def in_space(position_mm: Floats, errors: Mapping[str, Floats]) -> Figure:
    """Show errors (n, 3) [mm] where they were measured, each set magnified."""
    rows = thin(len(position_mm))
    p = position_mm[rows]
    extent = float(np.linalg.norm(np.ptp(p, axis=0))) or 1.0
    traces = []
    for name, e in errors.items():
        usual = float(np.percentile(np.linalg.norm(e, axis=1), 95))
        scale = magnification(0.06 * extent / max(usual, 1e-9))
        ends = np.stack([p, p + scale * e[rows], np.full_like(p, np.nan)], axis=1)
        x, y, z = (round_values(ends[:, :, k], 2) for k in range(3))
        width = 2 if name == "before" else 5
        traces.append(
            {
                "type": "scatter3d",
                "mode": "lines",
                "name": f"{name}, drawn {scale:g} times as long",
                "x": x,
                "y": y,
                "z": z,
                "hoverinfo": "skip",
                "line": {"color": colour_of(name), "width": width},
            }
        )
    axes = {f"{k}axis": {"title": {"text": f"{k} base [mm]"}} for k in "xyz"}
    camera = {"eye": {"x": 1.5, "y": -1.5, "z": 1.0}, "center": {"z": -0.15}}
    scene = {"aspectmode": "data", "camera": camera, **axes}
    margin = {"l": 0, "r": 0, "t": 0, "b": 0}
    return {"traces": traces, "layout": {"scene": scene, "margin": margin}}


def magnification(wanted: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten.

    >>> magnification(370.0), magnification(0.3)
    (200.0, 1.0)
    """
    if not wanted > 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(k for k in (1, 2, 5) if k * power <= wanted))


def thin(n: int, most: int = MOST) -> NDArray[np.int64]:
    """Choose at most so many of n rows, evenly."""
    return np.arange(n) if n <= most else np.arange(most) * n // most


# Accuracy, repeatability and multi-directional variation of poses (ISO 9283).

SAME = 1e-6  # [deg] commands that differ by less are the same pose


@dataclass(frozen=True)
class PoseFigures:
    """Figures of poses that were visited more than once [mm]; NaN where none were.

    Attributes:
        accuracy: AP, distance of the mean landing from the command, mean and max over
            poses reached twice or more from one side.
        repeatability: RP, mean distance from the mean landing plus three times its
            standard deviation, likewise.
        variation: vAP, largest distance between the mean landings from different
            sides, mean and max over poses reached from several sides.
        repeated: Poses reached more than once from one side.
        several: Poses reached from several sides.
        arrivals: Arrivals a side that the figures of `variation` rest on, at least.
        cycles: Arrivals that those of `accuracy` and `repeatability` rest on, likewise.
    """

    accuracy: tuple[float, float]
    repeatability: tuple[float, float]
    variation: tuple[float, float]
    repeated: int
    several: int
    arrivals: int
    cycles: int

    @property
    def remarks(self) -> dict[str, str]:
        """Say of every figure why it is no ISO value, "" where it is one."""
        repeated = few(self.cycles, POSE_CYCLES) if self.repeated else ""
        several = few(self.arrivals, POSE_CYCLES) if self.several else ""
        return dict(
            zip(("accuracy", "repeatability", "variation"),
                (repeated, repeated, several), strict=True)
        )  # fmt: skip


def pose_figures(q_deg: Floats, direction: Ints, error_mm: Floats) -> PoseFigures:
    """Group measured rows by command and side, and work out the figures.

    Args:
        q_deg: Commanded joint angles, (n, 6).
        direction: Arrival directions, (n, 6).
        error_mm: Measured minus commanded position, (n, 3).
    """
    pose = _number(np.round(q_deg / SAME))
    side = _number(np.column_stack([pose, direction]))
    repeated = [e for k in np.unique(side) if len(e := error_mm[side == k]) > 1]
    accuracy = [pose_accuracy(np.zeros(3), e) for e in repeated]
    spread = [repeatability(e) for e in repeated]
    apart, arrivals = [], []
    for k in np.unique(pose):
        sides, counts = np.unique(side[pose == k], return_counts=True)
        if len(sides) > 1:
            centres = np.array([error_mm[side == s].mean(axis=0) for s in sides])
            apart.append(variation(centres))
            arrivals.append(int(counts.min()))
    return PoseFigures(
        _mean_max(accuracy),
        _mean_max(spread),
        _mean_max(apart),
        len(accuracy),
        len(apart),
        min(arrivals, default=0),
        min(map(len, repeated), default=0),
    )


def _number(rows: Floats | Ints) -> Ints:
    """Number equal rows alike, (n,)."""
    return np.asarray(np.unique(rows, axis=0, return_inverse=True)[1]).ravel()


def _mean_max(values: list[float]) -> tuple[float, float]:
    """Return mean and maximum; NaN where there is none."""
    return (float(np.mean(values)), max(values)) if values else (np.nan, np.nan)
