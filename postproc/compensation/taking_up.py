"""How play is taken up at a stop where a move begins.

The drives of the joints that leave the other way than they came cross their gaps there,
each by its own, and no link moves: the tool is commanded to turn a little too, as it
would where the drives alone turned. Without that, a correction of its place alone moves
all joints, and leaves some of them within their play.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.options import Setting
from postproc.compensation.path_accuracy import sides_on_leaving
from postproc.language.visits import OrientationLaw, Visits
from postproc.motion.cycle import ProgramCycle
from postproc.robot.direction import WIDTH_IN_PLAYS
from postproc.robot.pose import rotation_vector

CROSSES = 0.3  # of half the play: a joint that goes so far will rest on that flank


@dataclass(frozen=True)
class TakeUp:
    """What a stop that takes up play is meant to do.

    Attributes:
        side: Where each joint is to lie in its play behind it, (6,) from -1 to 1.
        turn: What the tool turns by in its own frame, (3,) [rad].
        crossing: Joints whose drives cross their gaps there, from 1.
    """

    side: Floats
    turn: Floats
    crossing: tuple[int, ...]


def take_up(cycle: ProgramCycle, setting: Setting, visits: Visits, v: int) -> TakeUp:
    """Say how play is taken up where a move begins.

    Args:
        cycle: The program without such stops, compensated.
        setting: What it is compensated with.
        visits: The program.
        v: The visit at the end of the move.
    """
    cell = setting.cell
    came, leaves = sides_on_leaving(cycle, cell, v)
    turned = leaves - came
    crosses = np.abs(turned) > CROSSES
    crossing = tuple((np.flatnonzero(crosses) + 1).tolist())
    side = np.where(crosses, np.sign(turned), came)
    law = visits.orientation_law[v]
    known = law in (OrientationLaw.UNSET, OrientationLaw.ONE_AXIS)
    if setting.options.orientation or visits.wrist_joint[v] or not known:
        return TakeUp(side, np.zeros(3), crossing)
    width = np.where(setting.gap > 0.0, WIDTH_IN_PLAYS * cell.arm.play, 0.0)
    q = cycle.path.q[int(cycle.ways[1][v])]
    crossed = np.linalg.solve(cell.arm.coupling, (side - came) / 2 * width)
    before, behind = (
        cell.arm.flange(angles[None])[0, :3, :3] @ cycle.targets.tool[v, :3, :3]
        for angles in (q, q + crossed)
    )
    turn = rotation_vector((before.T @ behind)[None])[0]
    return TakeUp(side, turn, crossing)
