"""All of the second opinion: positions of every target, directions of a sample."""

from __future__ import annotations

from time import monotonic

import numpy as np

from postproc.verify.directions import SECONDS, judge_directions
from postproc.verify.goals import goals_of
from postproc.verify.opinion import ArmFacts, Claim, Opinion
from postproc.verify.pinocchio_arm import PinocchioArm
from postproc.verify.positions import (
    LoadedArms,
    confirmed,
    judge_branches,
    judge_motion,
    judge_positions,
    posture_of,
)
from postproc.verify.ways import WayMaker


def judge(
    program: str,
    facts: ArmFacts,
    source: Claim,
    output: Claim,
    seconds: float = SECONDS,
) -> Opinion:
    """Judge what a planner says of a program and of its output.

    Args:
        program: Its name.
        facts: The arm.
        source: What is said of the program as it was.
        output: Of what was written.
        seconds: Time for directions.
    """
    begun = monotonic()
    arm = PinocchioArm.build(facts)
    rows, postures = [], []
    for claim in (source, output):
        goals, at = goals_of(claim, facts), posture_of(arm, claim.q)
        rows += judge_positions(claim, goals, at, _loaded(facts, claim))
        rows += judge_branches(claim, facts.file, at)
        postures.append(at)
    if len(output.own) == len(source):
        rows += judge_motion(source, output, facts, *postures)
    maker = WayMaker(arm, output.visits, goals, confirmed(output, goals, at))
    rows += judge_directions(output, maker, facts, begun + seconds)
    return Opinion(program, tuple(rows), monotonic() - begun)


def _loaded(facts: ArmFacts, claim: Claim) -> LoadedArms:
    """Build the arm with every load that it carries."""
    loads = np.unique(claim.payload, axis=0)
    return {tuple(load.tolist()): PinocchioArm.build(facts, load) for load in loads}
