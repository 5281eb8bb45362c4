"""How much of two moves the virtual controller gives to the corner between them."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.language.visits import FlyTrajectory, FlyType, Motion, Visits
from postproc.virtual.kinematics import Chain
from postproc.virtual.moves import Way

USUAL_DISTANCE = 5.0  # [mm], where the program sets no $FLY_DIST
USUAL_PERCENT = 100.0  # where it sets no $FLY_PER
RAMP = 0.4  # [s] in which a joint reaches its full speed
NO_WAY = 1e-9  # [m], [rad]


def in_space(visits: Visits, i: int, j: int) -> bool:
    """Tell whether the corner between moves i and j is a Cartesian one."""
    cartesian = Motion.JOINT not in (visits.motion[i], visits.motion[j])
    return bool(cartesian and visits.fly_type[i] == FlyType.FLY_CART)


def shares(
    chain: Chain, visits: Visits, i: int, j: int, ways: tuple[Way, Way]
) -> tuple[float, float]:
    """Return the parts of moves i and j, 0 .. 1/2, that the corner at visit i takes.

    FLY_CART: $FLY_DIST before and behind the point (FLY_FROM), so much that the TCP
    passes at $FLY_DIST (FLY_TOL), or nothing (FLY_PASS); at most half of the shorter
    move. FLY_NORM: the last $FLY_PER % of the braking time.
    """
    kind, trajectory = visits.fly_type[i], visits.fly_traj[i]
    passing = kind == FlyType.FLY_CART and trajectory == FlyTrajectory.FLY_PASS
    if not visits.fly[i] or visits.via[i] or passing or visits.fly_dist_mm[i] < 0:
        return 0.0, 0.0
    if not in_space(visits, i, j):
        return _overlapping(chain, visits, (i, j), ways)
    lengths = ways[0].length, ways[1].length
    if min(lengths) < NO_WAY:
        return 0.0, 0.0
    zone = 0.5 * min(lengths)
    distance = _given(visits.fly_dist_mm[i], USUAL_DISTANCE) * 1e-3
    if trajectory == FlyTrajectory.FLY_TOL:
        # The parabola's vertex is half as far from the point as the middle of its ends.
        turn = np.linalg.norm(_heading(ways[1], 0) - _heading(ways[0], -1))
        distance = distance * 4 / max(float(turn), NO_WAY)
    zone = min(zone, distance)
    return zone / lengths[0], zone / lengths[1]


def _overlapping(
    chain: Chain, visits: Visits, moves: tuple[int, int], ways: tuple[Way, Way]
) -> tuple[float, float]:
    """Brake the first move and start the second at the same time."""
    percent = np.clip(_given(visits.fly_per[moves[0]], USUAL_PERCENT), 0.0, 100.0)
    pushes, times = [], []
    for move, way in zip(moves, ways, strict=True):
        most = np.abs(way.joints[-1] - way.joints[0]) / chain.speed
        lasts = max(float(most.max()), NO_WAY)  # [s] at full joint speed
        cruise = lasts
        if visits.motion[move] != Motion.JOINT and visits.lin_spd[move] > 0:
            cruise = max(cruise, way.length / float(visits.lin_spd[move]))
        pushes.append(1.0 / (lasts * RAMP))
        times.append(min(lasts * RAMP / cruise, float(np.sqrt(lasts * RAMP))))
    overlap = percent / 100.0 * min(times)
    return 0.5 * pushes[0] * overlap**2, 0.5 * pushes[1] * overlap**2


def _heading(way: Way, end: int) -> Floats:
    """Return the direction of the TCP at the begin (0) or end (-1) of a way, (3,)."""
    step = way.tcp[1] - way.tcp[0] if end == 0 else way.tcp[-1] - way.tcp[-2]
    return np.asarray(step / max(float(np.linalg.norm(step)), NO_WAY))


def _given(value: float, usual: float) -> float:
    return usual if np.isnan(value) else float(value)
