"""The frame of later rows, by fixed points that the model's survey had read, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.measurements import Measurements, places_of_points
from postproc.calibration.monuments import APART
from postproc.model.model import Monument
from postproc.model.registration import rigid_fit
from postproc.robot.pose import MM

WHOLE = 3  # fixed points, not on a line, that tell all of a place


def monuments_of(survey: Measurements) -> tuple[Monument, ...]:
    """Say where fixed points stand, in the frame of the survey's first station.

    Args:
        survey: Rows whose readings of fixed points hold no drift.
    """
    fixed = survey.references
    if fixed is None or len(survey.stations) > 1:
        return ()
    return tuple(
        (name, (float(x), float(y), float(z)))
        for name, (x, y, z) in sorted(places_of_points(survey).items())
    )


@dataclass(frozen=True, eq=False)
class CommonPoints:
    """Fixed points that rows have in common with a model's survey.

    Attributes:
        names: Of the points.
        here: Where the rows have them, (f, 3) [m].
        there: Where the survey had them, base frame, (f, 3) [m].
    """

    names: tuple[str, ...]
    here: Floats
    there: Floats

    @classmethod
    def of(cls, rows: Measurements, monuments: Sequence[Monument]) -> CommonPoints:
        """Find them by their names."""
        here, there = places_of_points(rows), dict(monuments)
        names = tuple(sorted(set(here) & set(there)))
        return cls(
            names,
            np.array([here[name] for name in names]).reshape(-1, 3),
            np.array([there[name] for name in names]).reshape(-1, 3),
        )

    @property
    def are_enough(self) -> bool:
        """Whether they tell shift and turn: three that lie apart, not on a line."""
        if len(self.names) < WHOLE:
            return False
        size = np.linalg.svd(self.here - self.here.mean(axis=0), compute_uv=False)
        return bool(size[1] > APART)


def at_monuments(
    rows: Measurements, monuments: Sequence[Monument], whole: bool = False
) -> tuple[Measurements, str]:
    """Move rows so that fixed points lie where the model's survey had them.

    Three points that lie apart tell shift and turn, fewer a shift.

    Args:
        rows: The rows, with their readings of fixed points.
        monuments: Where these are, base frame [m].
        whole: Whether nothing less than shift and turn will do.

    Returns:
        The rows, moved, and how, a line for a terminal; "" where they were not.
    """
    common = CommonPoints.of(rows, monuments)
    names, seen, known = common.names, common.here, common.there
    if not names:
        return rows, ""
    turns = common.are_enough
    if whole and not turns:
        return rows, ""
    T = rigid_fit(seen, known) if turns else np.eye(4)
    T[:3, 3] = known.mean(axis=0) - T[:3, :3] @ seen.mean(axis=0)
    moved = rows.position @ T[:3, :3].T + T[:3, 3]
    off = np.linalg.norm(known - seen @ T[:3, :3].T - T[:3, 3], axis=1).max() / MM
    by = float(np.linalg.norm(moved - rows.position, axis=1).mean()) / MM
    what = "shift and turn" if turns else "shift"
    count = f"{len(names)} monuments" if len(names) > 1 else "a monument"
    return replace(rows, position=moved), (
        f"\nregistered by {count} of the survey ({what}, {by:.3f} mm on average); "
        f"{off:.3f} mm remain there"
    )
