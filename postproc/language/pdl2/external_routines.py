"""Routines that the files at hand do not hold: what they do to arm and frames."""

from __future__ import annotations

from enum import StrEnum
from functools import cache
from pathlib import Path

from postproc.diagnostics import Code
from postproc.files import base_name
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.job import World
from postproc.language.pdl2.program import Program
from postproc.language.text.symbol_column import read_names

TRACKING = "sensor_trk"
"""Built-in routine that lets a sensor lead the arm, or ends that."""


class RoutineEffect(StrEnum):
    """What a routine that is not at hand does."""

    STILL = "motionless"  # it neither moves the arm nor sets frames
    KNOWN = "known"  # likewise, says the list that is shipped
    MOVES = "moves"
    SETS_FRAMES = "sets-frames"
    TABLE = "table"  # the cell file has a table of the frames that it sets
    TRACKS = "tracks"  # a sensor leads the arm, or does no more
    UNKNOWN = "unknown"


@cache
def list_motionless() -> frozenset[str]:
    """Return the names of the shipped list.

    >>> "spot" in list_motionless(), "tf" in list_motionless()
    (True, False)
    """
    return frozenset(read_names(Path(__file__).with_name("still_routines.txt")))


def effect_of(world: World, program: Program, name: str) -> RoutineEffect:
    """Tell what a routine, or a program, that the job does not hold does.

    What the cell says of a routine holds; the shipped list comes last, unless calls
    are taken strictly.

    Args:
        world: The files of the job.
        program: The one that calls it.
        name: In lower case.
    """
    start = world.start
    if name in start.frame_tables:
        return RoutineEffect.TABLE
    exporter = program.outside.get(name)
    holders = [exporter] if exporter else [*map(base_name, program.imports)]
    full = (f"{holders[0]}.{name}",) if len(set(holders)) == 1 else ()
    if said := start.effect_of(name, *full):
        return RoutineEffect(said)
    if name == TRACKING:
        return RoutineEffect.TRACKS
    if name in ast.NAMES["built-in"]:
        return RoutineEffect.STILL
    known = not start.assume_motion and name in list_motionless()
    return RoutineEffect.KNOWN if known else RoutineEffect.UNKNOWN


def stays_still(world: World, program: Program, name: str) -> bool:
    """Tell whether a routine that is not at hand does nothing to arm and frames."""
    return effect_of(world, program, name) in (RoutineEffect.STILL, RoutineEffect.KNOWN)


def report_unknown_routine(world: World, program: Program, row: int, name: str) -> None:
    """Say, once for each routine, what to put into the cell file about it."""
    text = (
        f"{name} is not in the given files and may move the arm and set frames: "
        "targets after it are not corrected until these are set again. To have them "
        "corrected, write under [routines] of the cell: "
        f'{name} = "motionless" if it does neither, {name} = "moves" if it moves; if '
        f"it sets frames, under [frames.routines.{name}] a row for each call: "
        '"1,2" = { tool = [x, y, z, a, e, r], uframe = [x, y, z, a, e, r] }'
    )
    world.report_once(program, row, Code.UNKNOWN_ROUTINE, name, text)
