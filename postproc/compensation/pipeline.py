"""A program planned and corrected until its sides stay put."""

from __future__ import annotations

from dataclasses import replace

from postproc.compensation.options import Job
from postproc.compensation.outcome import Status
from postproc.compensation.output.clones import give_own_points
from postproc.compensation.output.rewrite import check_motion
from postproc.compensation.program import (
    ParsedProgram,
    PlannedProgram,
    plan_visits,
    states_of,
)
from postproc.compensation.scale.consensus import RoundLog
from postproc.compensation.scale.window_work import in_windows
from postproc.compensation.solver.decisions import Proposal
from postproc.compensation.solver.iterate import FROM_START, Boundary, iterate
from postproc.compensation.solver.taught_frames import correct_taught
from postproc.compensation.window_result import WindowResult, correction_of
from postproc.robot.direction import UNLED, Arrivals


def correct(reading: ParsedProgram, setting: Job) -> tuple[ParsedProgram, WindowResult]:
    """Plan a program, and correct it until its sides are those corrected for.

    Moves can only be given points of their own when all arrivals are at hand: with
    shared_points = "clone" a program is one window, however long.

    Args:
        reading: The program.
        setting: What it is compensated with.

    Returns:
        The program, with clones where they were asked for, and what came of it.
    """
    clock = setting.clock
    if setting.options.shared_points != "clone":
        kept = in_windows(reading, setting, correct_visits)
        return reading, _whole(reading, setting)[0] if kept is None else kept
    kept, proposal = _whole(reading, replace(setting, averages=False))
    with clock("clone"):
        reading = give_own_points(reading, proposal, setting.cell)
    if reading.cloned or kept.decisions.count(Status.CONFLICT):
        kept, _ = _whole(reading, setting)
    return reading, kept


def _whole(reading: ParsedProgram, setting: Job) -> tuple[WindowResult, Proposal]:
    """Correct a program as one window; return all of its proposal."""
    _, kept, proposal = correct_visits(reading, setting)
    return kept, proposal


def correct_visits(
    reading: ParsedProgram,
    setting: Job,
    lead: Boundary = FROM_START,
    arrived: Arrivals = UNLED,
    doubtful: int = 0,
    trail: RoundLog | None = None,
) -> tuple[PlannedProgram, WindowResult, Proposal]:
    """Plan and correct some visits.

    Args:
        reading: The visits.
        setting: What they are compensated with.
        lead: How they go on from others, see `iterate`.
        arrived: How the arm arrives at the first of them, see `plan_visits`.
        doubtful: Why what comes from the first one is doubtful, 0 where it is not.
        trail: See `iterate`.
    """
    cell, model, visits = setting.cell, setting.model, reading.visits
    timed, clock = "speed" in model.needs, setting.clock
    with clock("plan"):
        planned = plan_visits(visits, cell, timed, lead.begin, arrived, doubtful)
        planned = correct_taught(planned, visits, cell, model)
    states = states_of(planned.plan, cell, setting.temperature, visits)
    found = iterate(reading, planned, states, setting, lead, trail)
    check_motion(visits, found.moved, cell.limits)
    with clock("report"):
        kept = correction_of(visits, planned, states, found, cell, model)
    return planned, kept, found.proposal
