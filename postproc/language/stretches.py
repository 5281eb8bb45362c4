"""Run a stretch of quiet lines at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.language import pdl2 as ast
from postproc.language.arrivals import HELD, WRITTEN, Run
from postproc.language.calls import call_statement, calls_in_expressions
from postproc.language.lines import Lines
from postproc.language.machine import Here, Machine
from postproc.language.moves import motion_of
from postproc.language.quiet import Point, Quiet, find_quiet
from postproc.language.values import Nothing, Value
from postproc.language.visits import Motion

_NO_INDEX = Nothing("its index is known only at run time")


@dataclass
class Stretches:
    """The stretches of quiet lines of a job, found when a body is first come to."""

    machine: Machine
    quiet: dict[int, Quiet] = field(default_factory=dict)

    def run(self, here: Here) -> bool:
        """Run the stretch that begins at a row; tell whether there is one.

        Where a condition handler may move the arm at any time there is none: every
        move may then come from elsewhere.
        """
        if self.machine.interrupted:
            return False
        quiet = self._quiet(here)
        end = quiet.end(here.row)
        if end == here.row:
            return False
        rows = np.arange(here.row, end)
        variant = quiet.variant[rows - quiet.first]
        ways = self._run_one_of_each(here, quiet, rows, variant)
        moves = np.isin(variant, np.array([*ways], dtype=np.int64))
        self._record(here, quiet, rows[moves], variant[moves], ways)
        here.row = end
        return True

    def _quiet(self, here: Here) -> Quiet:
        body = here.place.body
        if id(body) not in self.quiet:
            self.quiet[id(body)] = find_quiet(here.world, here.place, here.volatile)
        return self.quiet[id(body)]

    def _run_one_of_each(
        self, here: Here, quiet: Quiet, rows: Ints, variant: Ints
    ) -> dict[int, tuple[Motion, str]]:
        """Let the first line of every variant have its effects.

        Returns:
            The trajectory of every variant of a move, and why it is not known.
        """
        found, first = np.unique(variant, return_index=True)
        ways = {}
        for at in np.argsort(first).tolist():
            here.row = int(rows[first[at]])
            number = int(found[at])
            statement = quiet.statements[number]
            if quiet.calls[number]:
                calls_in_expressions(self.machine, here, statement)
            if isinstance(statement, ast.Call):
                call_statement(self.machine, here, statement)
            elif isinstance(statement, ast.Move):
                ways[number] = motion_of(here, statement, here.store.settings)
        return ways

    def _record(
        self,
        here: Here,
        quiet: Quiet,
        rows: Ints,
        variant: Ints,
        ways: dict[int, tuple[Motion, str]],
    ) -> None:
        """Record the moves and let the arm stand at the end of the last."""
        here.row = int(rows[0])
        point, held = _points(here, quiet, rows, variant)
        moves = {k: quiet.statements[k] for k in ways}
        run = Run(
            here.place,
            rows,
            variant,
            {k: move for k, move in moves.items() if isinstance(move, ast.Move)},
            ways,
            self.machine.predecessors(here),
            here.store.settings,
            point,
            held,
            here.reason,
        )
        base = self.machine.record(here, 0, run)
        here.store.last = frozenset({base + len(rows) - 1})


def _points(
    here: Here, quiet: Quiet, rows: Ints, variant: Ints
) -> tuple[Ints, dict[int, Value]]:
    """Look up the variables that moves go to, see `Run`."""
    program, initial = here.place.program, here.world.initial
    point = np.full(len(rows), WRITTEN, dtype=np.int64)
    held: dict[int, Value] = {}
    named = np.flatnonzero(np.array(quiet.named, dtype=bool)[variant])
    shapes = program.lines.shape[rows[named]]
    own = quiet.name[shapes]
    point[named] = HELD
    point[named[own >= 0]] = quiet.rows[own[own >= 0]]
    asked = (point[named] < 0) | _assigned(here, quiet, own)
    some = (named[asked], shapes[asked], own[asked])
    for at, shape, name in zip(*(column.tolist() for column in some), strict=True):
        if name >= 0:
            key = quiet.prefix + quiet.names[name]
        else:
            key = _key(program.lines, quiet.points[shape], int(rows[at]))
        value = here.store.assigned(key) if key else _NO_INDEX
        point[at] = initial.point(key) if value is None else HELD
        if point[at] < 0:
            point[at], held[at] = HELD, value or here.store.read(key)
    return point, held


def _assigned(here: Here, quiet: Quiet, names: Ints) -> Bools:
    """Tell which of the program's own variables it has given a value itself, (m,)."""
    values, found = here.store.values, np.zeros(len(names), dtype=bool)
    own = np.flatnonzero(names >= 0)
    keys = [quiet.prefix + quiet.names[name] for name in names[own].tolist()]
    given = {*islice(values, len(keys))}
    if len(given) < len(keys):  # all that there are
        found[own] = [key in given for key in keys]
    else:
        found[own] = [values.get(key) is not None for key in keys]
    return found


def _key(lines: Lines, point: Point, row: int) -> str:
    """Return where the point of a move is stored, "" where its index is not known."""
    if not point.index:
        return point.key
    index = [float(lines.value[lines.first[row] + slot]) for slot in point.index]
    if not all(number.is_integer() for number in index):
        return ""
    return f"{point.key}[{','.join(str(int(number)) for number in index)}]"
