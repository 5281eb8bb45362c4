"""Which targets move, where to, and why the others do not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.accuracy.guard import guard_size, guard_solutions, guard_steps, guard_turn
from postproc.arcs import STRAYS
from postproc.arrays import Bools, Floats, Ints
from postproc.carried import strayed_along
from postproc.followers import carry_along
from postproc.marks import mark_disagreement, mark_display, mark_unchanged, must_stay
from postproc.options import Options
from postproc.planning import Planned, Reading
from postproc.reasons import Reasons
from postproc.reconcile import agree
from postproc.report import Decisions, Status
from postproc.robot.cell import Cell
from postproc.solved import Solved
from postproc.written import change_mm, new_numbers, turns_in_file

LEVER_MM = 100.0  # from the TCP, by which turns count where arrivals must agree
NONE = np.empty((0, 3))
KNOWN = 0.5  # part of its play that a joint must have left behind to be on a side
HELD = "its direction of arrival would change with the correction"


@dataclass(frozen=True)
class Proposal:
    """Corrected numbers for the literals of a program.

    Attributes:
        edited: Literals that get new numbers, (m,).
        values: Their numbers, (m, 6) in the file's units.
        corrected: Visits whose target moves, (n,).
        decisions: What was decided for every visit.
        usable: Visits that could be corrected if they had their points alone, (n,).
        change_mm: What they would be corrected by, as arrivals at one point compare
            it, (n, k) [mm].
        fixed: Literals that must keep their values for what else depends on them, (k,).
    """

    edited: Ints
    values: Floats
    corrected: Bools
    decisions: Decisions
    usable: Bools
    change_mm: Floats
    fixed: Ints


def propose(
    reading: Reading,
    planned: Planned,
    solved: Solved,
    aside: Floats,
    held: Bools,
    cell: Cell,
    options: Options,
) -> Proposal:
    """Decide what moves, until no arc becomes quite another one by it.

    Args and returns are those of `decide`: every round leaves more points alone.
    """
    strays, arcs = np.zeros(len(held), dtype=bool), planned.targets.via.any()
    while True:
        found = decide(
            reading, planned, solved, aside, held, strays, cell, options
        )  # fmt: skip
        if not arcs:
            return found
        shift = solved.command[:, :3, 3] - planned.plan.tcp[:, :3, 3]
        shift -= aside - planned.plan.aside
        moves = np.where(found.corrected[:, None], shift, 0.0)
        values = found.decisions.corrected
        more = strayed_along(reading.visits, planned, cell, values, moves) & ~strays
        if not more.any():
            return found
        strays = strays | more


def decide(
    reading: Reading,
    planned: Planned,
    solved: Solved,
    aside: Floats,
    held: Bools,
    strays: Bools,
    cell: Cell,
    options: Options,
) -> Proposal:
    """Guard every solved visit, and compare the arrivals at every literal.

    Args:
        reading: The program.
        planned: Its plan.
        solved: The corrected command of every visit.
        aside: From targets to where the corrected path passes them, (n, 3) [m].
        held: Visits that must be left alone, (n,).
        strays: Visits whose correction would make another arc, (n,).
        cell: Guards and frames.
        options: What the user asked for.
    """
    visits, plan, side = reading.visits, planned.plan, solved.direction
    correction = solved.command[:, :3, 3] - plan.tcp[:, :3, 3]
    reasons = Reasons(len(visits))
    display = mark_display(visits, planned, reasons)
    unchanged = mark_unchanged(visits, reasons, options)
    reasons.adopt(planned.reasons.index, planned.reasons.texts)
    for text, outside in solved.outside.items():
        reasons.mark(outside, text)
    guard_solutions(reasons, cell.arm, cell.limits, plan.q, solved.q)
    guard_turn(reasons, cell.limits, solved.turn)
    guard_size(reasons, cell.limits, correction, solved.residual)
    # A fly point also moves for what the corner at it is rounded by.
    moved = correction - (aside - plan.aside)
    guard_size(reasons, cell.limits, moved, solved.residual)
    guard_steps(reasons, cell.limits, correction, side, visits.run_mates)
    reasons.mark(held, HELD)
    reasons.mark(strays, STRAYS)
    numbers = new_numbers(visits, plan, solved, aside)
    change = change_mm(visits, numbers, correction)
    both = change
    if len(solved.turned):
        turn = turns_in_file(visits, solved)
        both = np.concatenate([change, turn * LEVER_MM], axis=1)
    agreement = agree(visits.literal, reasons.none, numbers, both)
    trusted = ~np.any([held, *solved.outside.values()], axis=0)
    usable = reasons.none
    stay = must_stay(visits, agreement, change, trusted, cell)
    chosen, unsafe = mark_disagreement(visits, agreement, stay, cell, reasons)
    status = np.where(reasons.none, Status.SAFE, Status.GUARDED)
    for rows, value in (
        (unsafe, Status.UNSAFE),
        (display, Status.DISPLAY),
        (unchanged, Status.UNCHANGED),
    ):
        status[rows] = value
    corrected = status == Status.SAFE
    values = np.array(visits.values)
    values[corrected] = agreement.values[agreement.group[corrected]]
    carry_along(visits, agreement, chosen, values)
    decisions = Decisions(
        status=status.astype(np.int64),
        why=reasons.index,
        reasons=reasons.texts,
        q=plan.q,
        direction=(side >= KNOWN).astype(np.int8) - (side <= -KNOWN),
        side=side,
        corrected=values,
        correction=np.where(corrected[:, None], correction, 0.0),
        std_error=np.full_like(correction, np.nan),  # when it is settled
        turn=np.where(corrected[:, None], solved.turn, 0.0)
        if options.orientation
        else NONE,
    )
    return Proposal(
        agreement.literal[chosen],
        agreement.values[chosen],
        corrected,
        decisions,
        usable,
        both,
        agreement.literal[np.any([*stay.values()], axis=0)],
    )
