"""What a file's residuals are without repeated readings and without strays."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.measurements import Measurements
from postproc.calibration.orientations import means
from postproc.calibration.stops import labels_of, usual_limit
from postproc.robot.pose import MM

FEWEST = 10  # rows of which some may be strays
NAMED = 5  # strays that are named


def beside_all(rows: Measurements, left: Floats) -> str:
    """Say what means over readings leave, and which rows are far off the others.

    Args:
        rows: The rows.
        left: Their residuals, (n, 3) [m].

    Returns:
        Lines for a terminal, "" where every row is a stop and none a stray.
    """
    return _of_means(rows, left) + _of_strays(rows, left)


def _of_means(rows: Measurements, left: Floats) -> str:
    """Say what the means of repeated readings leave."""
    label = labels_of(rows.states, rows.visit)
    count = len(np.unique(label))
    if count == len(rows):
        return ""
    size = np.linalg.norm(means(left, label), axis=1) / MM
    return (
        f"\n{len(rows)} readings, {count} means over stops and probe points: the error "
        f"of the means is {size.mean():.4f} mm on average, {size.max():.4f} mm at most"
    )


def _of_strays(rows: Measurements, left: Floats) -> str:
    """Name rows that are farther off than rows that scatter alike ever are."""
    size = np.linalg.norm(left, axis=1)
    far = size > usual_limit(size, max(len(size), 1))
    if len(rows) < FEWEST or not far.any():
        return ""
    worst = np.flatnonzero(far)[np.argsort(-size[far])]
    named = [
        f"{rows.ids[i]} in line {rows.line[i]}: {size[i] / MM:.3f} mm"
        for i in worst[:NAMED]
    ]
    more = f", and {len(worst) - NAMED} more" if len(worst) > NAMED else ""
    return (
        f"\n{len(worst)} of {len(rows)} rows are far off the others ("
        f"{', '.join(named)}{more}): without them {size[~far].mean() / MM:.4f} mm on "
        "average"
    )
