"""What a measured path says, as text."""

from __future__ import annotations

import numpy as np

from postproc.calibration.diagnosis.measured_path import PathDiagnosis
from postproc.compensation.paths.servo_lag import ServoLag
from postproc.report.terminal import Column, table_text
from postproc.robot.pose import MM

HEADS = (
    Column("joint"),
    Column("steps"),
    Column("predicted mm"),
    Column("measured / predicted"),
    Column("+-"),
    Column("later mm"),
    Column("in motion", "left"),
)


def tell_path(found: PathDiagnosis) -> str:
    """Write what a measured path says for a terminal."""
    a = found.across
    lines = [
        f"{found.name}: {found.readings} readings at {found.rate:.0f} Hz, scatter "
        f"{found.scatter / MM:.4f} mm; {found.stops[0]} of {sum(found.stops)} stops "
        f"found, {found.moves} moves",
        f"error across the path, against the model: mean {a.mean_mm:.4f} mm, "
        f"95 % {a.p95_mm:.4f}, max {a.max_mm:.4f} over {a.n} places",
        "error along the path: unknown, because the tracker has its own clock",
        _of_lag(found.lag),
    ]
    if not found.joints:
        return "\n".join([*lines, "no joint changes its flank alone during a move"])
    rows = (
        (str(j.joint), str(j.steps), f"{j.predicted / MM:.3f}", f"{j.share:.2f}",
         f"{j.error:.2f}", f"{j.later / MM:.0f}", j.verdict)
        for j in found.joints
    )  # fmt: skip
    return "\n".join([*lines, table_text(HEADS, rows)])


def _of_lag(lag: ServoLag) -> str:
    """Say what bends tell of the servos' lag.

    >>> _of_lag(ServoLag(4e-4, 1e-5, 12))
    'servo lag 20.0 ms (+- 0.2), from the bends of 12 moves; not fitted'
    >>> _of_lag(ServoLag(1e-5, 1e-4, 12))
    'servo lag less than 14.5 ms, from the bends of 12 moves'
    """
    if lag.is_certain:
        error = lag.error / (2.0 * lag.seconds)
        return (
            f"servo lag {1e3 * lag.seconds:.1f} ms (+- {1e3 * error:.1f}), from the "
            f"bends of {lag.moves} moves; not fitted"
        )
    if not np.isfinite(lag.error):
        return "servo lag unknown: too few moves bend"
    return (
        f"servo lag less than {1e3 * lag.most:.1f} ms, from the bends of "
        f"{lag.moves} moves"
    )
