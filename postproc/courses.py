"""Where the numbers of one program lead, as they change from round to round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Floats
from postproc.language.visits import Visits
from postproc.motion.replan import Course, reach, reach_again
from postproc.motion.targets import Targets
from postproc.motion.trace import NOWHERE, Standing
from postproc.resolve import moved_targets
from postproc.robot.cell import Cell


class Courses:
    """The last course of a program, and the way to the next one."""

    def __init__(self, visits: Visits, targets: Targets, cell: Cell) -> None:
        """Begin with the program as it is.

        Args:
            visits: Its visits.
            targets: Where they go.
            cell: The arm and its surroundings.
        """
        self._visits, self._targets, self._cell = visits, targets, cell
        self._last: Course | None = None

    @property
    def end(self) -> Standing:
        """Return where the last course leaves the arm; nowhere before the first."""
        return NOWHERE if self._last is None else self._last.end

    def after(self, values: Floats, begin: Standing) -> Course:
        """Find where the program leads with other numbers.

        Args:
            values: The numbers, (n, 6) in the program's units.
            begin: Where the arm stands at the first visit, if that is known beforehand.
        """
        new = replace(self._visits, values=values)
        old = self._visits.values
        moved = ((values != old) & ~(np.isnan(values) & np.isnan(old))).any(axis=1)
        rows = np.flatnonzero(moved)
        targets = moved_targets(self._targets, new, self._cell, rows)
        arm, last = self._cell.arm, self._last
        if last is None or last.begin is not begin:
            self._last = reach(arm, targets, begin)
        else:
            self._last = reach_again(arm, last, targets, moved)
        self._visits, self._targets = new, targets
        return self._last
