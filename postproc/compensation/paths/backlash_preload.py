"""How play is taken up at a stop where a move begins.

The drives of the joints that leave the other way than they came cross their gaps there,
each by its own, and no link moves: the tool is commanded to turn a little too, as it
would where the drives alone turned. Without that, a correction of its place alone moves
all joints, and leaves some of them within their play.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints, spans
from postproc.compensation.options import Job
from postproc.compensation.paths.path_error import sides_on_moves
from postproc.language.visits import OrientationLaw, Visits
from postproc.model.backlash_width import half_widths
from postproc.model.flank_hypotheses import flanks_of, nominal_widths
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.pose import rotation_vector

TAKEN = 2e-5, 1e-4, 3e-4  # [m] from where a move begins: where play is taken up
LATEST = 0.9  # of a way: the last place of it for a stop
WHOLE = 0.999  # of half the play: a drive that lies there has crossed
LEAVING = 5e-3  # [m] behind which a move is under way
LEAST = 1e-9  # of half the play: less is no way of a drive
CROSSES = 0.3  # of half the play: a joint that goes so far will rest on that flank


@dataclass(frozen=True)
class BacklashPreload:
    """What a stop that takes up play is meant to do.

    Attributes:
        side: Where each joint is to lie in its play behind it, (6,) from -1 to 1.
        turn: What the tool turns by in its own frame, (3,) [rad].
        crossing: Joints whose drives cross their gaps there, from 1.
    """

    side: Floats
    turn: Floats
    crossing: tuple[int, ...]


def cross_at_once(side: Floats, first: Ints) -> Floats:
    """Let drives that cross their gaps on ways do so where they begin to, (s, 6).

    Those too that turn back before they are across, and were under way: a link that is
    to turn, and turn again, has to be pushed by one flank, and by the other. One that
    rests on its way across, and goes on, is under way.

    Args:
        side: Where each joint lies in its play along some ways, (s, 6) from -1 to 1.
        first: The samples of way w are first[w] .. first[w + 1] - 1.
    """
    out = np.array(side)
    step = np.diff(side, axis=0)
    step[first[1:-1] - 1] = 0.0
    for joint in range(side.shape[1]):
        at = np.flatnonzero(np.abs(step[:, joint]) > LEAST)
        if not len(at):
            continue
        sense, way = np.sign(step[at, joint]), np.searchsorted(first, at, side="right")
        turns = np.flatnonzero((np.diff(sense) != 0) | (np.diff(way) != 0))
        opens, closes = np.append(0, turns + 1), np.append(turns, len(at) - 1)
        begin, end, moves = at[opens], at[closes] + 1, sense[opens]
        whole = moves * side[end, joint] > WHOLE
        far = moves * (side[end, joint] - side[begin, joint]) > CROSSES
        turns_back = np.append(end[:-1] == begin[1:], False)
        goes_on = (end == first[way[opens]] - 1) | turns_back
        crosses = whole | (far & goes_on)
        count = (end - begin)[crosses]
        out[spans(begin[crosses] + 1, count), joint] = np.repeat(moves[crosses], count)
    return out


def take_up(
    cycle: ProgramCycle, setting: Job, visits: Visits, moves: Collection[int]
) -> dict[int, BacklashPreload]:
    """Say how play is taken up where some moves begin.

    Args:
        cycle: The program without such stops, compensated.
        setting: What it is compensated with.
        visits: The program.
        moves: The visits at their ends.
    """
    if not moves:
        return {}
    cell, model = setting.cell, setting.model
    own = np.array(sorted(moves, reverse=True))  # so that none follows the one before
    way, sides, first = sides_on_moves(cycle, cell, model, own)
    begins, last = first[:-1], first[1:] - 1
    far = np.append(0, np.cumsum(way < LEAVING))
    at = np.minimum(begins + far[first[1:]] - far[begins], last)
    came, leaves = sides[begins], cross_at_once(sides, first)[at]
    crosses = (np.abs(leaves - came) > CROSSES) & (np.abs(leaves) > WHOLE)
    crosses &= nominal_widths(flanks_of(model, cell.arm)) == 1.0
    side = np.where(crosses, np.sign(leaves), came)
    q = cycle.path.q[cycle.ways[1][own]]
    tool = cycle.targets.tool[own, :3, :3]
    turn = find_drive_turns(setting, visits, own, tool, q, side - came)
    return {
        v: BacklashPreload(
            side[k], turn[k], tuple((np.flatnonzero(crosses[k]) + 1).tolist())
        )
        for k, v in enumerate(own.tolist())
    }


def find_drive_turns(
    setting: Job, visits: Visits, v: Ints | int, tool: Floats, q: Floats,
    crossed: Floats,
) -> Floats:  # fmt: skip
    """Say what the tool has to turn by so that drives alone move.

    Where a program does not say how the tool turns on the way it must not turn.

    Args:
        setting: What the program is compensated with.
        visits: The program.
        v: The visit at the end of the move, or of that of each place, (k,).
        tool: How the tool is mounted, (3, 3) or (k, 3, 3).
        q: Joint angles at k places on its way, (k, 6) [rad].
        crossed: What each drive has crossed there since the move began, of its play,
            (k, 6) from -2 to 2.

    Returns:
        Rotation vectors in the tool's own frame, (k, 3) [rad].
    """
    cell, law = setting.cell, visits.motion.orientation_law[v]
    known = np.isin(law, (OrientationLaw.UNSET, OrientationLaw.ONE_AXIS))
    known &= ~visits.motion.wrist_joint[v]
    if setting.options.orientation or not known.any():
        return np.zeros((len(q), 3))
    half = np.where(setting.gap > 0.0, half_widths(setting.model, cell.arm, q), 0.0)
    behind = q + np.linalg.solve(cell.arm.coupling, (crossed * half).T).T
    before, after = (cell.arm.flange(a)[:, :3, :3] @ tool for a in (q, behind))
    turn = rotation_vector(np.swapaxes(before, 1, 2) @ after)
    return np.where(np.expand_dims(known, -1), turn, 0.0)
