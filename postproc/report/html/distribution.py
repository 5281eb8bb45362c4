"""The picture that leads a page: expected errors before and after, and a tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats

WIDTH, HEIGHT = 720, 190  # of the picture
LEFT, RIGHT, TOP, BOTTOM = 12, 12, 26, 42  # margins
BINS_A_DECADE = 16
STEPS = (1.0, 2.0, 5.0)  # of labels in a decade


@dataclass(frozen=True)
class Bar:
    """One bar of the picture, in its units."""

    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Distribution:
    """How many targets have which expected error, over its logarithm.

    Attributes:
        before, after: Bars, without and with the corrections.
        ticks: Labels of lengths [mm] by their place.
        limits: Labels of tolerances by their place.
        most: Targets that the highest bar counts.
    """

    before: tuple[Bar, ...]
    after: tuple[Bar, ...]
    ticks: tuple[tuple[float, str], ...]
    limits: tuple[tuple[float, str], ...]
    most: int

    @property
    def box(self) -> str:
        """Return the view box of the picture."""
        return f"0 0 {WIDTH} {HEIGHT}"

    @property
    def base(self) -> float:
        """Return the height on which bars stand."""
        return HEIGHT - BOTTOM


def distribution(
    before: Floats, after: Floats, limits: Sequence[float] = ()
) -> Distribution | None:
    """Draw expected errors [mm], NaN where not known; None where none is known.

    Args:
        before: Without the corrections, (n,).
        after: With them, (n,).
        limits: Tolerances [mm].
    """
    known = np.isfinite(before) & np.isfinite(after)
    before, after = (np.maximum(x[known], 1e-4) for x in (before, after))
    if not len(after):
        return None
    sizes = np.concatenate([before, after, np.asarray(limits, dtype=float)])
    low, high = np.log10(sizes.min()) - 0.15, np.log10(sizes.max()) + 0.15
    bins = max(int(np.ceil((high - low) * BINS_A_DECADE)), 1)
    edges = np.linspace(low, high, bins + 1)
    counts = [np.histogram(np.log10(x), edges)[0] for x in (before, after)]
    most = int(max(c.max() for c in counts))

    def place(size: float) -> float:
        share = (np.log10(size) - low) / (high - low)
        return round(LEFT + float(share) * (WIDTH - LEFT - RIGHT), 1)

    step = (WIDTH - LEFT - RIGHT) / bins
    bars = [
        tuple(
            _bar(LEFT + k * step, step, count / most)
            for k, count in enumerate(own.tolist())
            if count
        )
        for own in counts
    ]
    labels = [s * 10.0**e for e in range(-5, 5) for s in STEPS]
    shown = [x for x in labels if low <= np.log10(x) <= high]
    return Distribution(
        before=bars[0],
        after=bars[1],
        ticks=tuple((place(x), f"{x:g}") for x in shown),
        limits=tuple((place(x), f"tolerance {x:g} mm") for x in limits),
        most=most,
    )


def _bar(x: float, width: float, share: float) -> Bar:
    """Place a bar of a share of the height."""
    height = max(share * (HEIGHT - TOP - BOTTOM), 1.0)
    return Bar(
        *(round(v, 1) for v in (x, HEIGHT - BOTTOM - height, width - 1.0, height))
    )
