"""From where to approach a target so that the side of every joint is known there.

What to do is said of any target. Some are approached anew unasked: the arm goes back on
the way that it came, before the last move, and from there straight to the target.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.findings.findings import SURE, name_axes
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.arm import Arm
from postproc.robot.direction import half_width
from postproc.robot.pose import MM, lengths
from postproc.robot.trajectory import Motion

FAR = 0.3  # [m] an approach that would have to be longer is led from elsewhere
LOST = 1e-6  # [rad] a joint that turns less on the last piece of a way stands still


def advise(arm: Arm, cycle: ProgramCycle, rows: Ints) -> dict[int, str]:
    """Say how to approach targets that a joint reaches from a side that is not sure.

    A joint's side is sure once its drive has gone through its play. On a straight
    approach that begins farther back, the joints turn on as they do at its end: what is
    missing there is the longest of what they need.

    Args:
        arm: The arm; its play and coupling are used.
        cycle: The program in time.
        rows: Visits to look at.

    Returns:
        What to do, by visit; only where something can be said.
    """
    edge, source = cycle.ways
    told = {}
    for v in rows.tolist():
        if edge[v] < 0 or source[v] < 0:
            most = np.rad2deg(2 * half_width(arm).max())
            told[v] = (
                "before it, add a JOINT move from a place in the program that moves "
                f"every axis by {most:.2f} deg or more"
            )
            continue
        path = cycle.path.edges
        samples = path.path[path.start[edge[v]] : path.start[edge[v] + 1]]
        way = np.vstack([cycle.path.q[source[v]], samples])[-2:]
        tool = np.tile(cycle.targets.tool[v, :3, 3], (2, 1))
        length = float(np.linalg.norm(np.diff(arm.tcp(way, tool), axis=0)))
        turned = (arm.coupling @ np.diff(way, axis=0)[0]) if len(way) > 1 else None
        if turned is None:
            continue
        side = cycle.arrived.side[v]
        on = np.where(np.abs(turned) < LOST, 0.0, np.sign(turned))
        lacks = np.maximum((SURE - side * on) * half_width(arm), 0.0)
        missing = np.where(np.abs(side) < SURE, lacks, 0.0)  # of the drives [rad]
        if not missing.any():
            continue  # as it is compensated now, the sides are known
        cartesian = bool(cycle.targets.move[v] != Motion.JOINT)
        told[v] = _advise_joints(missing, turned, length, cartesian)
    return told


def _advise_joints(
    missing: Floats, turned: Floats, length: float, cartesian: bool
) -> str:
    """Say what to do about joints that lack some travel (6,) on their last piece."""
    joints = np.flatnonzero(missing > 0)
    names, turn = name_axes(joints), "turn" if len(joints) > 1 else "turns"
    angle = np.ceil(np.rad2deg(missing.max()) * 1e3) / 1e3
    if (np.abs(turned[joints]) < LOST).any():
        return (
            f"start the approach where {names} {turn} by {angle:.3f} deg or more on "
            "the way to the target"
        )
    back = length * float((missing[joints] / np.abs(turned[joints])).max())
    if cartesian and 0 < back <= FAR:
        return f"start the approach {np.ceil(back / MM):.0f} mm farther back"
    return (
        f"start the approach farther back, so that {names} {turn} by {angle:.3f} deg "
        "more"
    )


# Targets that are approached anew: from a stop on the way already travelled.

FINE = 2.5e-4  # [m] between places on that way, about
ASIDE = 5e-4  # [m] that the new way is beside the one already travelled at the most
AMPLE = 1.2  # of the travel that takes a drive from one flank to the other
SHORT = 1e-3  # [m] from the target: what lies nearer is no approach


def place_to_approach(
    arm: Arm, cycle: ProgramCycle, row: int, before: int, unsure: Bools, most: float
) -> Floats | None:
    """Find a place from where the side of every joint is known at a target.

    It lies on the way that led to where the last move begins, never beyond the target,
    and nearly on the line to it: straight from there the arm passes where it was.

    Args:
        arm: The arm; its play and coupling are used.
        cycle: The program in time.
        row: The visit whose target is approached.
        before: The visit at which its move begins.
        unsure: Joints whose side is not known there, (6,).
        most: Distance from the target [m].

    Returns:
        Joint angles there, (6,) [rad]; None where there is no such place.
    """
    edge, source = (int(found[before]) for found in cycle.ways)
    if edge < 0 or source < 0:
        return None
    path = cycle.path.edges
    samples = path.path[path.start[edge] : path.start[edge + 1]]
    way = np.vstack([cycle.path.q[source], samples])[::-1]
    tool = cycle.targets.tool[row, :3, 3]
    way = _finely(way, arm.tcp(way, np.tile(tool, (len(way), 1))))
    place = arm.tcp(way, np.tile(tool, (len(way), 1)))
    target = arm.tcp(cycle.path.q[[row]], tool[None])[0]
    turned = np.abs((cycle.path.q[row] - way) @ arm.coupling.T)
    enough = turned >= AMPLE * 2 * half_width(arm)
    off = place - target
    distance = lengths(off)
    fits = (distance <= most) & (distance >= SHORT)
    fits &= np.maximum.accumulate(distance) <= most  # on the last stretch of the way
    fits &= off @ (target - place[0]) <= 0.0
    fits &= enough[:, unsure].all(axis=1)
    for k in np.lexsort((distance, -enough.sum(axis=1))).tolist():
        if fits[k] and _aside(place[: k + 1], target) <= ASIDE:
            return np.asarray(way[k])
    return None


def _finely(way: Floats, place: Floats) -> Floats:
    """Put samples on a way (m, 6) with the TCP at places (m, 3) so that it is fine."""
    parts = np.maximum(np.ceil(lengths(np.diff(place, axis=0)) / FINE), 1).astype(int)
    at = np.append(0, np.cumsum(parts))
    rows = np.arange(at[-1] + 1)
    return np.array([np.interp(rows, at, way[:, joint]) for joint in range(6)]).T


def _aside(way: Floats, target: Floats) -> float:
    """Measure how far a way (k, 3) is from the line from its end to the target."""
    line = target - way[-1]
    line = line / np.linalg.norm(line)
    off = way - way[-1]
    return float(lengths(off - (off @ line)[:, None] * line).max())
