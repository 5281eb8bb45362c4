"""Where to measure: poses that show as much of the model as possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from postproc.accuracy.exchange import choose, gain_d, gain_i
from postproc.accuracy.observability import Observability, observe
from postproc.accuracy.reachability import joint_box, usable
from postproc.arrays import Floats, Ints
from postproc.exceptions import PostprocError
from postproc.model.combination import Combination
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm
from postproc.robot.state import States, make_states

MODES = ("lhs", "optimal", "d-optimal")
POOL = 6  # candidate poses per wanted pose in an optimal design
TYPICAL_NOISE = 3e-5  # [m] tracker and repeatability of one coordinate
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

    Raises:
        PostprocError: A wrong mode or number, or too few poses can be measured.
    """
    if mode not in MODES:
        raise PostprocError(f"no survey mode {mode!r}. Use {', '.join(MODES)}")
    if poses < 1:
        raise PostprocError(f"{poses} poses are no survey. Ask for 1 or more")
    rng = np.random.default_rng(seed)
    wanted = poses * (1 if mode == "lhs" else POOL)
    pool = _candidates(arm, np.atleast_2d(probes), wanted, tracker, rng)
    X, names = _whitened(arm, pool)
    if mode != "lhs":
        kept = choose(X, poses, gain_i(X) if mode == "optimal" else gain_d)
        pool, X = pool[kept], X[kept]
    seen = observe(X.reshape(-1, X.shape[2]), names, floor=1.0)
    return Design(pool.q, pool.direction, pool.tool_id, mode, seen)


def _candidates(
    arm: Arm,
    probes: Floats,
    count: int,
    tracker: Floats | None,
    rng: np.random.Generator,
) -> States:
    """Draw poses that can be measured from a Latin hypercube.

    Raises:
        PostprocError: Hardly any pose can be measured.
    """
    low, high = joint_box(arm)
    drawn = count
    for _ in range(ATTEMPTS):
        cube = qmc.LatinHypercube(6, rng=rng).random(drawn)
        q = low + cube * (high - low)
        probe = np.arange(drawn) % len(probes)
        good = usable(arm, q, probes[probe], tracker)
        turns = [np.flatnonzero(good & (probe == k)) for k in range(len(probes))]
        need = [len(range(k, count, len(probes))) for k in range(len(probes))]
        if all(len(t) >= m for t, m in zip(turns, need, strict=True)):
            keep = np.empty(count, dtype=np.int64)
            for k, rows in enumerate(turns):
                keep[k :: len(probes)] = rng.permutation(rows)[: need[k]]
            side = _balanced_sides(count, rng)
            tools = probe[keep]
            return make_states(q[keep], side, probes[tools], tool_id=tools)
        drawn *= 2
    raise PostprocError(
        "hardly any pose can be measured: the tracker does not see the probe or the "
        "arm cannot reach. Move the tracker or check the probe points"
    )


def _balanced_sides(count: int, rng: np.random.Generator) -> Floats:
    """Draw directions, (count, 6): every joint as often from each side."""
    half = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    return np.stack([rng.permutation(half) for _ in range(6)], axis=1)


def _whitened(arm: Arm, states: States) -> tuple[Floats, tuple[str, ...]]:
    """Columns of the base model per pose, (n, 6, p): three rows from either side."""
    base = Combination(propose(BASE_EFFECTS, arm, states))
    back = states.with_(direction=-states.direction)
    both = [base.columns(Batch(arm, s)) for s in (states, back)]
    X = np.concatenate(both, axis=1) * base.scales / TYPICAL_NOISE
    return X, base.names
