"""All of the second opinion: positions of every target, directions of a sample."""

from __future__ import annotations

from time import monotonic

import numpy as np

from postproc.verify.directions import judge_directions
from postproc.verify.goals import goals_of
from postproc.verify.opinion import (
    ENOUGH,
    Allowance,
    ArmFacts,
    Claim,
    Opinion,
    OpinionRow,
)
from postproc.verify.pinocchio_arm import PinocchioArm
from postproc.verify.positions import (
    confirm_angles,
    judge_branches,
    judge_motion,
    judge_positions,
    motion_not_judged,
    posture_of,
)
from postproc.verify.ways import WayMaker


def judge(
    program: str,
    facts: ArmFacts,
    source: Claim,
    output: Claim,
    allowance: Allowance = ENOUGH,
) -> Opinion:
    """Judge what a planner says of a program and of its output.

    Args:
        program: Its name.
        facts: The arm.
        source: What is said of the program as it was.
        output: Of what was written.
        allowance: How long it may take.
    """
    begun = monotonic()
    arm = PinocchioArm.build(facts)
    rows: list[OpinionRow] = []
    postures = []
    for claim in (output, source):  # what was written counts, where time is short
        goals = goals_of(claim, facts)
        at = posture_of(arm, claim.q, begun + allowance.positions)
        loads = np.unique(claim.payload, axis=0)
        arms = {tuple(own.tolist()): PinocchioArm.build(facts, own) for own in loads}
        found = judge_positions(claim, goals, at, arms)
        rows[:0] = [*found, *judge_branches(claim, facts.file, at)]
        postures.append(at)
    if len(output.own) == len(source):
        rows += judge_motion(source, output, facts, *reversed(postures))
    else:
        rows += motion_not_judged(source, facts)
    goals = goals_of(output, facts)
    maker = WayMaker(
        arm, output.visits, goals, confirm_angles(output, goals, postures[0])
    )
    placed = monotonic()
    rows += judge_directions(output, maker, facts, placed + allowance.ways)
    ended = monotonic()
    return Opinion(program, tuple(rows), ended - begun, ended - placed)
