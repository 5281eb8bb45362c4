"""Which moves that leave their paths get points, and which a stop where they begin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.compensation.paths.arcs import halves
from postproc.compensation.paths.backlash_preload import take_up
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.split_constraints import shortest_pieces
from postproc.language.languages import language_of
from postproc.model.backlash_width import ELASTIC
from postproc.model.model import CONFIRMED, UNCERTAIN

UNSURE = 2e-5  # [m] a flank that is less sure is no reason to put points anywhere
SMALL = 5e-5  # [m] a step of a joint that matters little if it is not as predicted


def find_split(work: InsertionPlan) -> None:
    """Say which of the moves that leave their paths may be split."""
    visits, paths = work.source.reading.visits, work.paths
    shortest = work.setting.cell.limits.segment_ms / 1e3
    pieces = shortest_pieces(visits, work.first.before, shortest)
    far = set(paths.visit[work.to_split].tolist())
    for v in sorted({half for row in far for half in halves(visits, row)}):
        if told := _explain_refusal(work, paths.row_of(v), v):
            if v in far:
                work.left[v] = told
            continue
        work.open[v] = pieces[v]
        if v not in far:
            work.beside.add(v)
        if work.setting.options.preload_backlash and _can_stop(work, v):
            # What gives way before it carries is led off by what a sharp gap asks for.
            taken = take_up(work.first.after, work.setting, visits, v)
            if _in_doubt(work, v, taken.crossing, work.verdicts):
                work.unconfirmed.add(v)
            else:
                work.idle[v] = taken


def _explain_refusal(work: InsertionPlan, k: int, v: int) -> str:
    """Say why a path that is left too far gets no points, "" where it may."""
    after = work.paths.after
    if work.splitter is None:
        name = language_of(work.source.reading.sources[0].name).name
        return f"no points are inserted into {name} programs"
    if v in work.approaches:
        return "its target is approached again from an inserted stop"
    if told := work.find_hindrance(work.splitter, v):
        return told
    if after.unsure[work.paths.samples(k)].max() > UNSURE:
        return "the flank of a joint is uncertain along it"
    return _otherwise_in_motion(work, k, v)


def _can_stop(work: InsertionPlan, v: int) -> bool:
    """Tell whether the arm stands where a move begins, and may stop once more."""
    visits = work.source.reading.visits
    before = int(visits.before[v])
    if work.splitter is None or visits.fly[before] or visits.via[before]:
        return False
    return work.splitter.stops(int(visits.file[v]), int(work.lines[v]))


def _otherwise_in_motion(work: InsertionPlan, k: int, v: int) -> str:
    """Name a joint that changes its flank on a path, and in motion not as at stops."""
    model = work.setting.model
    by_reversals = model.flank_widths and not model.in_motion
    changing = work.paths.crossing[work.paths.samples(k)].any(axis=0)
    # Where none was measured it is as at stops, if nothing speaks against it.
    told = [said or CONFIRMED for said in work.verdicts]
    joint = _in_doubt(work, v, (np.flatnonzero(changing) + 1).tolist(), told)
    if not joint:
        return ""
    said = told[joint - 1]
    where = "at stops" if by_reversals or said == ELASTIC else "in motion"
    return f"joint {joint} changes its flank, which {where} is {said}"


def _in_doubt(
    work: InsertionPlan, v: int, joints: Sequence[int], told: Sequence[str]
) -> int:
    """Name a joint that may not change its flank in motion as at stops, 0 for none.

    What is not confirmed may be, where what the joints may lack of their steps is too
    small to matter much: all of it, but for what nobody could measure for certain.
    """
    lacks = {
        joint: (work.max_lag[joint - 1] if told[joint - 1] == UNCERTAIN else 1.0)
        * _step(work, v, joint)
        for joint in joints
        if told[joint - 1] != CONFIRMED
    }
    return max(lacks, key=lacks.__getitem__) if sum(lacks.values()) >= SMALL else 0


def _step(work: InsertionPlan, v: int, joint: int) -> float:
    """Return how far a joint's change of its flank moves the TCP at a visit [m]."""
    cycle, arm = work.first.after, work.setting.cell.arm
    tool = cycle.targets.tool[v, :3, 3]
    by_joint = arm.jacobian(cycle.path.q[v][None], tool)[0, :3, joint - 1]
    gap = 2.0 * work.setting.gap[joint - 1]
    return float(np.linalg.norm(by_joint) * gap)
