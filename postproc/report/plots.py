"""Plots for papers and reports; the only module that imports matplotlib."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from postproc.calibration.baselines import Comparison
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.diagnose import Extension
from postproc.calibration.diagnosis.result import Profile, periodogram, profile
from postproc.exceptions import OutputError
from postproc.files import write_all
from postproc.robot.pose import MM

BEFORE, AFTER = "#d55e00", "#0072b2"  # told apart by all kinds of colour vision
SPAN = "#767676"
BINS = 40
SMOOTHED = 15  # rows of a running median


def plot_diagnosis(found: Extension, path: Path) -> list[Path]:
    """Draw the residual before and after, every finding, and the periodograms.

    Args:
        found: A diagnosis.
        path: PNG or SVG; its stem begins the name of every plot.

    Returns:
        The files written.

    Raises:
        OutputError: They cannot be written.
    """
    figures = {"residual": histogram(found), "periodogram": periodograms(found)}
    search = found.search
    for number, addition in enumerate(search.additions):
        shown = profile(search.fit, search.place(number), addition.candidate)
        title = str(addition.candidate.family)
        figures[f"finding{number + 1}"] = against_covariate(shown, title)
    written = []
    for name, figure in figures.items():
        target = path.with_name(f"{path.stem}-{name}{path.suffix or '.png'}")
        written.append(save(figure, target))
    return written


def plot_comparison(found: Comparison, path: Path) -> Path:
    """Draw the errors that every method leaves on rows it has not seen.

    Args:
        found: A comparison.
        path: PNG or SVG.

    Raises:
        OutputError: It cannot be written.
    """
    figure, axes = _figure("error on held-out rows [mm]", "")
    rows = sorted(found.rows, key=lambda row: row.mean_mm)
    for place, row in enumerate(rows):
        axes.plot([row.min_mm, row.max_mm], [place] * 2, "|-", color=SPAN)
        spread = {"xerr": row.std_mm, "fmt": "D", "color": AFTER, "capsize": 3}
        axes.errorbar(row.mean_mm, place, **spread)
        told = f"{row.mean_mm:.3f}"
        axes.annotate(told, (row.mean_mm, place), (0, 7), textcoords="offset points")
    axes.set_yticks(range(len(rows)), [row.method for row in rows])
    axes.set_ylim(-0.6, len(rows) - 0.2)
    axes.set_xlim(left=0.0)
    axes.set_title("mean (diamond) ± standard deviation, smallest to largest (line)")
    return save(figure, path)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as the suffix says; the same figure gives the same bytes.

    Raises:
        OutputError: It cannot be written.
    """
    kind = path.suffix.lower().removeprefix(".") or "png"
    drawn = BytesIO()
    try:
        with rc_context({"svg.hashsalt": "postproc"}):
            dated = {"Date": None} if kind == "svg" else None
            figure.savefig(drawn, dpi=150, metadata=dated, format=kind)
    except ValueError as exc:
        cure = "Name a .png or .svg file in an existing folder"
        raise OutputError(path, str(exc), cure) from None
    write_all({path: drawn.getvalue()})
    return path


def histogram(found: Extension) -> Figure:
    """Draw the lengths of held-out errors before and after."""
    figure, axes = _figure("error on held-out rows [mm]", "rows")
    lengths = [
        np.linalg.norm(e, axis=1) / MM
        for e in (found.held_out.before, found.held_out.after)
    ]
    bins = np.linspace(0.0, max(float(x.max()) for x in lengths), BINS)
    for values, colour, hatch, label in zip(
        lengths, (BEFORE, AFTER), ("//", ""), ("before", "after"), strict=True
    ):
        what = f"{label}, mean {values.mean():.3f} mm"
        axes.hist(values, bins, alpha=0.6, color=colour, hatch=hatch, label=what)
    floor = found.diagnosis.noise_floor_mm
    axes.axvline(floor, color="black", linestyle=":", label=f"noise {floor:.3f} mm")
    axes.legend()
    return figure


def against_covariate(shown: Profile, title: str) -> Figure:
    """Draw a residual against the covariate that matters, before and after."""
    figure, axes = _figure(f"{shown.label} [{shown.unit}]", shown.direction)
    order = np.argsort(shown.values)
    for values, colour, mark, label in (
        (shown.before, BEFORE, "x", "without it"),
        (shown.after, AFTER, "o", "with it"),
    ):
        axes.plot(shown.values, values, mark, color=colour, markersize=3, alpha=0.5)
        half = SMOOTHED // 2
        padded = np.pad(values[order], half, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
        smooth = np.asarray(np.median(windows, axis=1))
        axes.plot(shown.values[order], smooth, color=colour, label=label)
    limit = 1.5 * float(np.percentile(np.abs(shown.before), 98))
    axes.set_ylim(-limit, limit)
    axes.set_title(title)
    axes.legend()
    return figure


def periodograms(found: Extension) -> Figure:
    """Draw, joint by joint, what waves of its angle explain before and after."""
    figure = Figure(figsize=(8, 9), layout="constrained")
    all_axes = figure.subplots(6, 1, sharex=True)
    search = found.search
    for fit, colour, style, label in (
        (search.base, BEFORE, "-", "before"),
        (search.fit, AFTER, "--", "after"),
    ):
        projection = Projection.of(fit)
        for joint, axes in enumerate(all_axes, start=1):
            p = periodogram(projection, joint)
            axes.plot(p.orders, p.power, style, color=colour, label=label)
            axes.set_ylabel(f"joint {joint}")
    all_axes[0].legend()
    all_axes[0].set_title("half of the chi-square that a wave explains")
    all_axes[-1].set_xlabel("waves per turn of the joint")
    return figure


def _figure(x: str, y: str) -> tuple[Figure, Any]:
    """Make a figure with one pair of axes."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    return figure, axes
