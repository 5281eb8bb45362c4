"""The first routine that leaves targets, and how many it would free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.language.krl.collect import visits_of
from postproc.language.krl.interpreter import KrlMachine
from postproc.language.visits import Diagnostic, Visits

CODE = "first-cause"
MOST = 5_000  # visits of a job that is followed again to count them


def first_cause(machine: KrlMachine, visits: Visits) -> list[Diagnostic]:
    """Return what to declare first, and how many targets that frees.

    The job is followed again as if the routine, and then all unknown ones, were still.

    Args:
        machine: It has followed the job.
        visits: What it found.
    """
    calls = sorted(machine.unknown_calls.items(), key=lambda item: item[1])
    if not calls or len(visits) > MOST:
        return []
    left = _left(visits)
    names = [name for name, _ in calls]
    freed, freed_by_all = (
        left - _left_if(machine, some) for some in (names[:1], names)
    )
    name, (file, row) = calls[0]
    if not freed_by_all:
        return []
    lines = ", ".join(f'{one} = "still"' for one in names)
    text = (
        f"{name}( ) is the first of {len(names)} routines in no available file. If it "
        f"neither moves the arm nor sets frames, {freed} of {left} targets that are "
        f"left are freed; {freed_by_all} if none of them does. Under [routines] in the "
        f"cell: {lines}"
    )
    return [machine.texts[file].diagnostic(row, CODE, text)]


def _left(visits: Visits) -> int:
    """Count the visits with a reason for leaving them."""
    empty = np.array([not why for why in visits.reasons], bool)
    return int((~empty[visits.reason]).sum())


def _left_if(machine: KrlMachine, still: list[str]) -> int:
    """Count them with some routines that neither move nor set frames."""
    said = dict(machine.start.routines) | dict.fromkeys(still, "still")
    again = KrlMachine.of(machine.task, replace(machine.start, routines=said))
    again.run()
    return _left(visits_of(again))
