"""From the arrivals of a RAPID task to `Visits`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from postproc.language import collect
from postproc.language.collect import Conditions
from postproc.language.placed import PlacedFrame, composed, from_record
from postproc.language.rapid.dialect import COMMENTS, RAPID_DIALECT
from postproc.language.rapid.interpreter import RapidMachine
from postproc.language.rapid.modes import NO_SHIFT, UNKNOWN_SHIFT
from postproc.language.rapid.moves import (
    FrameOfMove,
    RapidVisit,
    pose_of_numbers,
)
from postproc.language.visits import Meaning, Visits
from postproc.robot.trajectory import Motion

_SHIFT = "the program displacement (PDispOn, PDispSet) is not known here"


def visits_of(machine: RapidMachine, moves: Mapping[int, Sequence[int]]) -> Visits:
    """Put the arrivals into the order of the program, as columns."""
    base = PlacedFrame(from_record(machine.start.base))
    placed: dict[tuple[FrameOfMove, tuple[float, ...]], PlacedFrame] = {}

    def conditions(v: RapidVisit) -> Conditions:
        key = v.wobj, v.modes.shift
        if key not in placed:
            placed[key] = _displaced(*key)
        return _conditions(v, base, placed[key])

    return collect.visits_of(machine, RAPID_DIALECT, COMMENTS, moves, conditions)


def _conditions(v: RapidVisit, base: PlacedFrame, uframe: PlacedFrame) -> Conditions:
    """Say what an arrival is carried out with."""
    joint = v.motion == Motion.JOINT
    return Conditions(
        tool=PlacedFrame(v.tool.pose, v.tool.taught),
        base=base,
        uframe=uframe,
        remote=not v.tool.held or v.wobj.held,
        reasons=_reasons(v),
        flags=v.modes.confj if joint else v.modes.confl,
        flagged=v.goal.target == Meaning.POSE,
        law=v.modes.arc_law if v.motion == Motion.CIRCULAR else v.modes.law,
        zone_mm=v.zone_mm,
        speed=v.speed,
        wrist=bool(v.modes.wrist) and not joint,
        override=v.modes.override,
    )


def _displaced(wobj: FrameOfMove, shift: tuple[float, ...]) -> PlacedFrame:
    """Place a work object with the program displacement in it."""
    if shift == UNKNOWN_SHIFT or not wobj.pose:
        return PlacedFrame(())
    pose = wobj.pose
    if shift != NO_SHIFT:
        pose = composed(pose, pose_of_numbers(shift))
    return PlacedFrame(pose, wobj.taught)


def _reasons(v: RapidVisit) -> tuple[str, ...]:
    """Say why a visit cannot be compensated."""
    given = (*sorted(v.modes.blocked), v.why, v.goal.why, v.tool.why)
    if v.goal.target == Meaning.JOINTS:
        return given
    unknown = v.modes.shift == UNKNOWN_SHIFT
    return (*given, v.wobj.why, _SHIFT if unknown else "")
