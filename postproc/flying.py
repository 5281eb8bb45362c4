"""What a program says of its fly points, and what it leaves to be assumed."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.language.visits import Diagnostic, FlyTrajectory, FlyType, Motion, Visits
from postproc.motion.targets import Fly
from postproc.robot.pose import MM

USUAL_DISTANCE = 5.0  # [mm] where $FLY_DIST is not set, as simulation systems take it
USUAL_OVERLAP = 100.0  # [%] where $FLY_PER is not set
FAR = 0.1  # [mm] passing a point farther away than this is worth a note


def rounding_of(visits: Visits) -> tuple[Ints, Floats, Floats]:
    """Tell how fly points are rounded: `Fly`, distances [m] and overlaps, (n,) each."""
    cartesian = visits.fly_type == FlyType.FLY_CART
    passing = cartesian & (visits.fly_traj == FlyTrajectory.FLY_PASS)
    within = visits.fly_traj == FlyTrajectory.FLY_TOL
    rounding = np.where(cartesian, np.where(within, Fly.WITHIN, Fly.FROM), Fly.OVERLAP)
    rounding[passing | (visits.fly_dist_mm < 0)] = Fly.EXACT
    distance = np.nan_to_num(visits.fly_dist_mm, nan=USUAL_DISTANCE) * MM
    overlap = np.nan_to_num(visits.fly_per, nan=USUAL_OVERLAP) / 100.0
    return rounding, np.maximum(distance, 0.0), np.clip(overlap, 0.0, 1.0)


def rounded_points(visits: Visits, away: Floats) -> list[Diagnostic]:
    """Say once how far the path passes rounded fly points, and what was assumed.

    Args:
        visits: Every arrival.
        away: How far the path passes each, (n,) [mm].
    """
    rows = np.flatnonzero(away > 0)
    if len(rows) == 0:
        return []
    found = [_note(visits, int(rows[0]), "fly-assumed", text)
             for text in [_assumed(visits, rows)] if text]  # fmt: skip
    far = rows[away[rows] > FAR]
    if len(far):
        worst = int(far[np.argmax(away[far])])
        text = (
            f"the path passes {len(far)} fly points by more than {FAR:g} mm, this one "
            f"by {away[worst]:.2f} mm, as $FLY_TYPE, $FLY_DIST and $FLY_PER say: it is "
            "corrected for where the path passes; to hit it, stop there (MOVE)"
        )
        found.append(_note(visits, worst, "fly-corner", text))
    return found


def _assumed(visits: Visits, rows: Ints) -> str:
    """List what fly points take for granted."""
    cartesian = visits.fly_type[rows] == FlyType.FLY_CART
    overlap = ~cartesian | (visits.motion[rows] == Motion.JOINT)
    untold = [
        ("$FLY_TYPE FLY_NORM", visits.fly_type[rows] == FlyType.UNSET),
        (f"$FLY_PER {USUAL_OVERLAP:g}", overlap & np.isnan(visits.fly_per[rows])),
        (f"$FLY_DIST {USUAL_DISTANCE:g}",
         cartesian & np.isnan(visits.fly_dist_mm[rows])),
        ("$FLY_TRAJ FLY_FROM",
         cartesian & (visits.fly_traj[rows] == FlyTrajectory.UNSET)),
    ]  # fmt: skip
    taken = ", ".join(text for text, where in untold if where.any())
    return taken and f"fly points are rounded as with {taken}: not set in the program"


def _note(visits: Visits, row: int, code: str, text: str) -> Diagnostic:
    return Diagnostic(visits.files[visits.file[row]], int(visits.line[row]), code, text)
