"""Survey poses that tell most: reachable, and D-optimal for the parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.regression import Observability, observe
from postproc.exceptions import PostprocError
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm
from postproc.robot.state import States, make_states

# Exchange: which of many candidate poses tell the most together.
#
# Fedorov's exchange on the Bayesian information I + sum X_k^T X_k, columns being
# whitened and scaled by their prior (Chaloner and Verdinelli, Bayesian experimental
# design, 1995).

Gain = Callable[[Floats, Floats], Floats]

SWAPS = 2  # passes of exchange


def choose(X: Floats, count: int, gain: Gain) -> Ints:
    """Choose poses greedily, then exchange each for the best one.

    Args:
        X: Rows of every candidate, (n, r, p).
        count: Poses wanted.
        gain: What candidates (m, r, p) add to a design of a given covariance (p, p).

    Returns:
        Indices of the chosen candidates, ascending, (count,).
    """
    covariance = np.eye(X.shape[2])
    chosen: list[int] = []
    free = np.ones(len(X), dtype=bool)

    def take_best(covariance: Floats) -> Floats:
        """Choose the free candidate that adds most."""
        best = int(np.flatnonzero(free)[np.argmax(gain(X[free], covariance))])
        chosen.append(best)
        free[best] = False
        return _update_inverse(covariance, X[best], +1.0)

    for _ in range(count):
        covariance = take_best(covariance)
    for _ in range(SWAPS):
        before = sorted(chosen)
        for _ in range(count):
            one = chosen.pop(0)
            free[one] = True
            covariance = take_best(_update_inverse(covariance, X[one], -1.0))
        if sorted(chosen) == before:
            break
    return np.array(sorted(chosen), dtype=np.int64)


def gain_d(part: Floats, covariance: Floats) -> Floats:
    """How much candidates lower the log volume of the parameters' uncertainty, (m,)."""
    both = _through(part, covariance)
    gain: Floats = np.linalg.slogdet(np.eye(part.shape[1]) + both).logabsdet
    return gain


def gain_i(everywhere: Floats) -> Gain:
    """Make the gain of I-optimality.

    Args:
        everywhere: Rows of poses all over the workspace, (n, r, p).
    """
    flat = everywhere.reshape(-1, everywhere.shape[2])
    moment = flat.T @ flat / len(flat)

    def gain(part: Floats, covariance: Floats) -> Floats:
        """How much candidates lower the mean variance of predictions, (m,)."""
        both = np.eye(part.shape[1]) + _through(part, covariance)
        seen = _through(part, covariance @ moment @ covariance)
        solved = np.linalg.solve(both, seen)
        return np.asarray(np.trace(solved, axis1=1, axis2=2))

    return gain


def _through(part: Floats, square: Floats) -> Floats:
    """Return X S X^T of every candidate, (m, r, r)."""
    flat = (part.reshape(-1, part.shape[2]) @ square).reshape(part.shape)
    return np.asarray(flat @ np.swapaxes(part, 1, 2))


def _update_inverse(inverse: Floats, rows: Floats, sign: float) -> Floats:
    """Add (+1) or remove (-1) rows of an inverse information matrix (Woodbury)."""
    spread = inverse @ rows.T
    middle = np.linalg.inv(sign * np.eye(len(rows)) + rows @ spread)
    updated: Floats = inverse - spread @ middle @ spread.T
    return updated


# Which poses a survey may use: the tool free, the tracker in sight.

LIMIT_MARGIN = np.deg2rad(5.0)  # every approach starts to the side of its pose
FLOOR, COLUMN = 0.15, 0.45  # [m] least height, least distance from axis 1 when low
SHOULDER = 1.0  # [m] height below which the column is in the way
FACING = np.cos(np.deg2rad(75.0))  # the beam must come from before the flange
CLEARANCE = 0.2  # [m] between the beam and the arm's links


def joint_box(arm: Arm) -> tuple[Floats, Floats]:
    """Give the joint ranges of a survey: the limits with a margin, half a turn at most.

    Returns:
        Lower and upper ends, (6,) [rad].
    """
    low = np.maximum(arm.lower + LIMIT_MARGIN, -np.pi + LIMIT_MARGIN)
    high = np.minimum(arm.upper - LIMIT_MARGIN, np.pi - LIMIT_MARGIN)
    shifted = high - low < np.minimum(arm.upper - arm.lower, 2 * np.pi) - 0.5
    low = np.where(shifted, np.maximum(arm.lower + LIMIT_MARGIN, high - 2 * np.pi), low)
    return low, high


def usable(arm: Arm, q: Floats, tool: Floats, tracker: Floats | None) -> Bools:
    """Tell which poses keep the tool free and the tracker in sight.

    Args:
        arm: The arm.
        q: Joint angles, (n, 6) [rad].
        tool: Probe points in the flange frame, (n, 3) [m].
        tracker: Tracker position in the base frame, (3,) [m], or None.
    """
    frames = arm.link_frames(q)
    tcp = ArmStates(arm, make_states(q, tool=tool)).walk.tcp
    aside = np.hypot(tcp[:, 0], tcp[:, 1])
    low = np.minimum(tcp[:, 2], frames[:, 6, 2, 3])
    free: Bools = (low > FLOOR) & ((aside > COLUMN) | (low > SHOULDER))
    if tracker is None:
        return free
    beam = tracker - tcp
    beam /= np.linalg.norm(beam, axis=1)[:, None]
    facing: Bools = np.einsum("ni,ni->n", frames[:, 6, :3, 2], beam) > FACING
    joints = frames[:, :6, :3, 3]  # the flange itself is next to the probe
    away = joints - tcp[:, None]
    along = np.maximum(np.einsum("nki,ni->nk", away, beam), 0.0)
    gap = np.linalg.norm(away - along[:, :, None] * beam[:, None], axis=2)
    clear: Bools = (gap[:, :5] > CLEARANCE).all(axis=1)
    return free & facing & clear


# Where to measure: poses that show as much of the model as possible.

MODES = ("lhs", "optimal", "d-optimal")
POOL = 6  # candidate poses per wanted pose in an optimal design
TYPICAL_NOISE = 3e-5  # [m] tracker and repeatability of one coordinate
AROUND = np.deg2rad(15.0)  # round an arrival of a program
MOST_ARRIVALS = 500  # of a program, by which poses are chosen
ATTEMPTS = 12  # times the number of drawn poses doubles before giving up


@dataclass(frozen=True)
class Design:
    """A survey: every pose is measured once from each side.

    Attributes:
        q: Joint angles of the poses, (n, 6) [rad].
        side: Arrival directions of the first approach, (n, 6), +1 or -1; the second
            approach comes from the other side of every joint.
        probe: Index of the probe point, (n,).
        mode: One of MODES.
        observability: What the design shows of the base model.
    """

    q: Floats
    side: Floats
    probe: Ints
    mode: str
    observability: Observability

    def summary(self) -> str:
        """Describe the design in one line."""
        o = self.observability
        return (
            f"{len(self.q)} poses ({self.mode}), each from both sides; "
            f"{o.rank} directions of the model observable, "
            f"condition number {o.condition:.0f}, O1 {o.o1:.3g}"
        )


def design_survey(
    arm: Arm,
    probes: Floats,
    poses: int,
    mode: str = "lhs",
    tracker: Floats | None = None,
    seed: int = 0,
    job: States | None = None,
) -> Design:
    """Choose the poses of a survey.

    Args:
        arm: The arm.
        probes: Probe points in the flange frame, (k, 3) [m]; poses take turns.
        poses: Number of poses.
        mode: "lhs" (Latin hypercube); "optimal": the predicted errors are known best,
            on average over the workspace (Bayesian I-optimal exchange); "d-optimal":
            the parameters are.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        seed: Of the random draws.
        job: Arrivals of a program: poses are round these, and chosen so that the errors
            there are known best, unless the mode is "d-optimal".

    Raises:
        PostprocError: A wrong mode or number, or too few poses can be measured.
    """
    if mode not in MODES:
        raise PostprocError(f"no survey mode {mode!r}. Use {', '.join(MODES)}")
    if poses < 1:
        raise PostprocError(f"{poses} poses are no survey. Ask for 1 or more")
    rng = np.random.default_rng(seed)
    spread = mode == "lhs" and job is None
    wanted = poses * (1 if spread else POOL)
    draw = _all_over(arm, rng) if job is None else _round_job(arm, job.q, rng)
    pool = _candidates(arm, np.atleast_2d(probes), wanted, tracker, rng, draw)
    # Columns of the base model per pose, three rows from either side.
    base = Combination(propose(BASE_EFFECTS, arm, pool))
    back = pool.with_(direction=-pool.direction)
    both = [base.columns(ArmStates(arm, s)) for s in (pool, back)]
    X = np.concatenate(both, axis=1) * base.scales / TYPICAL_NOISE
    if not spread:
        there = X if job is None else _rows_of_job(arm, base, job, rng)
        kept = choose(X, poses, gain_d if mode == "d-optimal" else gain_i(there))
        pool, X = pool[kept], X[kept]
    seen = observe(X.reshape(-1, X.shape[2]), base.names, floor=1.0)
    name = mode if job is None else "round the program's arrivals"
    return Design(pool.q, pool.direction, pool.tool_id, name, seen)


Draw = Callable[[int], Floats]


def _all_over(arm: Arm, rng: np.random.Generator) -> Draw:
    """Draw poses (n, 6) [rad] all over the joint ranges, from a Latin hypercube."""
    low, high = joint_box(arm)
    return lambda n: low + qmc.LatinHypercube(6, rng=rng).random(n) * (high - low)


def _round_job(arm: Arm, q: Floats, rng: np.random.Generator) -> Draw:
    """Draw poses (n, 6) [rad] some degrees round those of a program, (m, 6) [rad]."""
    low, high = joint_box(arm)

    def draw(n: int) -> Floats:
        at = q[rng.integers(len(q), size=n)]
        return np.clip(at + rng.uniform(-AROUND, AROUND, (n, 6)), low, high)

    return draw


def _rows_of_job(
    arm: Arm, base: Combination, job: States, rng: np.random.Generator
) -> Floats:
    """Return rows of the base model at arrivals of a program, (n, 3, p), scaled."""
    some = rng.permutation(len(job))[:MOST_ARRIVALS]
    columns = base.columns(ArmStates(arm, job[some]))
    return np.asarray(columns * base.scales / TYPICAL_NOISE)


def _candidates(
    arm: Arm,
    probes: Floats,
    count: int,
    tracker: Floats | None,
    rng: np.random.Generator,
    draw: Draw,
) -> States:
    """Draw poses that can be measured.

    Raises:
        PostprocError: Hardly any pose can be measured.
    """
    drawn = count
    for _ in range(ATTEMPTS):
        q = draw(drawn)
        probe = np.arange(drawn) % len(probes)
        good = usable(arm, q, probes[probe], tracker)
        turns = [np.flatnonzero(good & (probe == k)) for k in range(len(probes))]
        need = [len(range(k, count, len(probes))) for k in range(len(probes))]
        if all(len(t) >= m for t, m in zip(turns, need, strict=True)):
            keep = np.empty(count, dtype=np.int64)
            for k, rows in enumerate(turns):
                keep[k :: len(probes)] = rng.permutation(rows)[: need[k]]
            # Every joint arrives as often from each side.
            half = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
            side = np.stack([rng.permutation(half) for _ in range(6)], axis=1)
            tools = probe[keep]
            return make_states(q[keep], side, probes[tools], tool_id=tools)
        drawn *= 2
    raise PostprocError(
        "hardly any pose can be measured: the tracker does not see the probe or the "
        "arm cannot reach. Move the tracker or check the probe points"
    )
