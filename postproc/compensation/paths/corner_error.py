"""How far rounded corners between two lines are passed: ISO 9283, cornering deviations.

The cornering round-off error CR is the smallest distance between the programmed corner
and the attained path. A plan knows where rounding leads, and the model what the arm is
off there: the systematic part. The overshoot CO is the controller's: nothing tells it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.paths.path_error import PathAccuracy
from postproc.language.visits import Visits
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.pose import lengths
from postproc.robot.trajectory import Motion


@dataclass(frozen=True)
class RoundOff:
    """c fly points between two lines (structure of arrays).

    Attributes:
        path: The path that leads to each, of a `PathAccuracy`, (c,), ascending.
        before, after: Round-off error of the program as it was written, and
            compensated, (c,) [m].
    """

    path: Ints
    before: Floats
    after: Floats

    def __len__(self) -> int:
        """Return the number of corners."""
        return len(self.path)

    def of(self, path: int) -> tuple[float, float] | None:
        """Return both errors where a path ends in a corner [m]."""
        k = int(np.searchsorted(self.path, path))
        if k == len(self) or self.path[k] != path:
            return None
        return float(self.before[k]), float(self.after[k])


def predict_corners(
    visits: Visits, cycle: ProgramCycle, paths: PathAccuracy
) -> RoundOff:
    """Predict the round-off errors of a program.

    Args:
        visits: The program as it was written, n visits.
        cycle: It in time.
        paths: How it keeps to its paths.
    """
    lines = (visits.motion.kind == Motion.LINEAR) & (cycle.ways[1] >= 0)
    behind = np.full(len(visits), -1)
    on = np.flatnonzero(lines & (visits.graph.before >= 0))
    behind[visits.graph.before[on]] = on
    corner = lines & visits.motion.fly & (behind >= 0) & (visits.graph.before >= 0)
    p, aside = cycle.targets.tcp[:, :3, 3], cycle.path.aside
    told = np.asarray(~np.isnan(p).any(axis=1))  # steps have no place of their own
    corner &= told & told[visits.graph.before] & told[behind]
    path = np.flatnonzero(corner[paths.visit])
    row = paths.visit[path]
    units = [
        step / np.maximum(lengths(step), 1e-12)[:, None]
        for step in (p[row] - p[visits.graph.before[row]], p[behind[row]] - p[row])
    ]
    along = units[0] + units[1]
    along = along / np.maximum(lengths(along), 1e-12)[:, None]
    end = paths.first[path + 1] - 1
    sizes = []
    for way in (paths.before, paths.after):
        off = np.nan_to_num(aside[row]) + way.off[end]
        sizes.append(lengths(off - (off * along).sum(axis=1)[:, None] * along))
    return RoundOff(path, *sizes)
