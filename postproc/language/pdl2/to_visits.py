"""From the arrivals of a PDL2 program to `Visits`; blocks of moves in array passes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from postproc.arrays import Indices, Ints, chunks, isin_sorted
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.analysis.found_goals import FoundVisit
from postproc.language.analysis.origins import NOWHERE, Origins
from postproc.language.analysis.to_visits import Arrival, Collector
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.conditions import SettingTable
from postproc.language.pdl2.machine import (
    MOST_AXES,
    Machine,
    Pdl2Goal,
    Pdl2Visit,
)
from postproc.language.pdl2.pose_encoding import COMMENTS, PDL2_DIALECT

_IN_PART = "a target is computed from a part of it"
_RECURSIVE = Reason(
    Code.RECURSION, "it stands in a routine that calls itself, which is not followed"
)
_AXES_UNKNOWN = Reason(
    Code.EXTERNAL_AXES, "its auxiliary axes are not known before the program runs"
)


class Pdl2Collector(Collector):
    """Makes the visits of a PDL2 program.

    Attributes:
        settings: What moves are carried out with.
    """

    dialect, comments = PDL2_DIALECT, COMMENTS
    machine: Machine
    found: list[Pdl2Visit]

    def __init__(self, machine: Machine) -> None:
        """Read the settings of moves once each."""
        self.world, self.settings = machine.world, SettingTable()
        super().__init__(machine, self.world.numbering)

    def arrive(self, v: Pdl2Visit) -> Arrival:
        """Say what an arrival is carried out with."""
        row, goal = self.settings.index(v.modes), v.goal
        first = goal.why or (_RECURSIVE if self._is_again(v) else NO_REASON)
        given = [first, v.why, self.settings.problem(row, goal.target)]
        given += [self.aux_problem(goal), self.machine.handler]
        conditions = self.settings.conditions[row]
        return Arrival(conditions, given, goal.config is not None, v.fly)

    def _is_again(self, v: FoundVisit) -> bool:
        return id(v.scope.body) in self.machine.recursive

    def origins_of(self, one: FoundVisit) -> Origins:
        """Return where the arm may come from, in recursion from anywhere."""
        found = super().origins_of(one)
        return found | NOWHERE if self._is_again(one) else found

    def list_moves(self) -> Sequence[Indices]:
        """Return the moves of all programs."""
        texts = (program.lines for program in self.world.programs())
        return [
            np.flatnonzero(text.which(lambda said: isinstance(said, ast.Move)))
            for text in texts
        ]

    def count_axes(self) -> int:
        """Return the last auxiliary axis, see `Collector.count_axes`."""
        axes = {axis for v in self.found for axis in v.goal.axes or ()}
        return max([0, *(min(axis, MOST_AXES) for axis in axes)])

    def fill_goals(self, visit: Ints, goals: Sequence[Pdl2Goal]) -> None:
        """Fill configurations, too, see `Collector.fill_goals`."""
        super().fill_goals(visit, goals)
        c = self.columns
        c.config[visit] = c.configs.of([goal.config or "" for goal in goals])
        c.config_given[visit] = [goal.config is not None for goal in goals]
        distances = np.array([goal.distance_mm for goal in goals])
        if np.isfinite(distances).any():
            c.distance_mm = np.array(c.distance_mm)
            c.distance_mm[visit] = distances
        taught = [*self.world.taught_lines.values()]
        places = zip(c.file[visit].tolist(), c.line[visit].tolist(), strict=True)
        marked = (line in taught[file] for file, line in places)
        c.taught[visit] = [
            goal.taught or (mark and not goal.name)
            for goal, mark in zip(goals, marked, strict=True)
        ]

    # What else depends on numbers.

    def find_uses(self, literal: Indices) -> tuple[dict[int, str], Indices]:
        """Find it number by number, see `Collector.find_uses`."""
        slots, pinned = self.columns.slots, self.world.pinned
        follows = np.full(len(literal), -1, dtype=np.int32)
        bases = dict[int, tuple[int, ...]]()
        goals = (v.goal for v in self.found)
        for visit, goal in zip(self.begin.tolist(), goals, strict=True):
            for slot in goal.holds:
                pinned.setdefault(slot, _IN_PART)
            if goal.follows[0] >= 0:
                bases[visit] = goal.follows
        wanted = {-1, *pinned, *chain.from_iterable(bases.values())}
        numbers, owner = np.array(sorted(wanted)[1:]), dict[int, int]()
        for some in chunks(len(slots) if len(numbers) else 0):
            row, column = np.nonzero(isin_sorted(slots[some], numbers))
            own = literal[some][row] >= 0
            row, column = some.start + row[own], column[own]
            owner |= zip(slots[row, column].tolist(), row.tolist(), strict=True)
        stay = {int(literal[owner[k]]): why for k, why in pinned.items() if k in owner}
        for visit, base in bases.items():
            at = owner.get(base[0], -1)
            if at >= 0 and (slots[at] == base).all():
                follows[visit] = literal[at]
            else:
                parts = [int(literal[owner[slot]]) for slot in base if slot in owner]
                stay |= {part: _IN_PART for part in parts if part not in stay}
        return stay, follows

    def aux_problem(self, target: Pdl2Goal) -> Reason:
        """Return why a target stays because of its auxiliary axes."""
        kinds, axes = self.world.start.aux, target.axes
        if axes is None:
            if kinds and all(kind == "gun" for kind in kinds.values()):
                return NO_REASON
            return _AXES_UNKNOWN
        for axis in axes:
            kind = kinds.get(axis)
            if kind is None:
                text = (
                    f"auxiliary axis {axis} is not declared: say under [aux] in the "
                    "cell file whether it is a gun, a track or a positioner"
                )
                return Reason(Code.EXTERNAL_AXES, text)
            if kind != "gun":
                text = f"auxiliary axis {axis} is a {kind}: it moves arm or part"
                return Reason(Code.EXTERNAL_AXES, text)
        return NO_REASON
