"""A check of an arm: the few readings that tell most of what may have changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.calibration.pose_design import (
    POOL,
    TYPICAL_NOISE,
    choose,
    draw_poses,
    gain_i,
)
from postproc.exceptions import PostprocError
from postproc.model.effect_sum import Combination
from postproc.model.effects.base_shift import BaseShift
from postproc.model.effects.effect import Effect
from postproc.model.effects.joint_offset import JointOffset
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.state import States

FEWEST = 5  # readings: two poses from both sides, and the first one again
CANDIDATES = 40 * POOL  # poses that a check is chosen from
LARGEST = 3  # effects of the arm that a check looks at beside zeros, tool and base
CHANGES = 3.0  # of their usual sizes: what zeros, tool and base may change by


@dataclass(frozen=True)
class CheckDesign:
    """The n readings of a check: the last one repeats the first.

    Attributes:
        q: Joint angles, (n, 6) [rad].
        side: Arrival directions, (n, 6), +1 or -1.
        probe: Index of the probe point, (n,).
        names: Of the readings: the pose, and a letter for the arrival.
        effects: What the poses were chosen for.
    """

    q: Floats
    side: Floats
    probe: Ints
    names: tuple[str, ...]
    effects: tuple[str, ...]


def design_check(
    arm: Arm,
    probes: Floats,
    readings: int,
    tracker: Floats | None = None,
    seed: int = 0,
    model: Model | None = None,
) -> CheckDesign:
    """Choose the poses of a check.

    They tell most, on average over the workspace, of the errors that changes of zeros,
    tool, base and the arm's largest effects make (Bayesian I-optimal exchange).

    Args:
        arm: The arm.
        probes: Probe points in the flange frame, (k, 3) [m]; poses take turns.
        readings: How many, the repeated one included.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        seed: Of the random draws.
        model: The arm's error as it was surveyed; its largest effects count too.

    Raises:
        PostprocError: Too few readings, or too few poses can be measured.
    """
    if readings < FEWEST:
        raise PostprocError(
            f"{readings} readings are no check. Ask for {FEWEST} or more: two poses "
            "from both sides, and the first one again"
        )
    rng = np.random.default_rng(seed)
    pool = draw_poses(arm, np.atleast_2d(probes), CANDIDATES, tracker, rng)
    X, names = _rows(arm, pool, len(np.atleast_2d(probes)), model)
    kept = choose(X, readings // 2, gain_i(X))
    return _in_order(pool[kept], readings, names)


def _rows(
    arm: Arm, pool: States, probes: int, model: Model | None
) -> tuple[Floats, tuple[str, ...]]:
    """Return scaled rows from both sides, (n, 6, p), and the names of their effects."""
    changes: list[Effect] = [
        JointOffset(),
        ToolShift(np.inf, probes > 1),
        BaseShift(np.inf),
    ]
    own = [] if model is None else _largest(arm, pool, model)
    both = []
    for states in (pool, pool.with_(direction=-pool.direction)):
        batch = ArmStates(arm, states)
        parts = [(Combination(tuple(changes)), CHANGES)]
        parts += [(Combination(tuple(own)), 1.0)] if own else []
        both.append(
            np.concatenate(
                [one.columns(batch) * one.scales * size for one, size in parts], axis=2
            )
        )
    names = tuple(dict.fromkeys(effect.name for effect in (*changes, *own)))
    return np.concatenate(both, axis=1) / TYPICAL_NOISE, names


def _largest(arm: Arm, pool: States, model: Model) -> list[Effect]:
    """Return the effects of a model that move the tool most over some poses."""
    fitted, values, _ = model.compensable()
    moved = fitted.columns(ArmStates(arm, pool)) * values
    sizes = [
        float(np.sqrt((moved[:, :, part].sum(axis=2) ** 2).sum(axis=1).mean()))
        for part in fitted.slices
    ]
    order = np.argsort(-np.array(sizes), kind="stable")[:LARGEST]
    return [fitted.effects[k] for k in sorted(order.tolist())]


def _in_order(pool: States, readings: int, effects: tuple[str, ...]) -> CheckDesign:
    """Reach every pose from both sides, the last one perhaps from one, then the first.

    Poses of one probe point follow each other.
    """
    order = np.argsort(pool.tool_id, kind="stable")
    pose = np.repeat(np.arange(len(order)), 2)[: readings - 1]
    second = np.tile([False, True], len(order))[: readings - 1]
    pose, second = np.append(pose, 0), np.append(second, False)
    rows = order[pose]
    side = np.where(second[:, None], -pool.direction[rows], pool.direction[rows])
    letters = ["b" if back else "a" for back in second[:-1].tolist()] + ["c"]
    names = tuple(f"{k + 1}{x}" for k, x in zip(pose.tolist(), letters, strict=True))
    return CheckDesign(pool.q[rows], side, pool.tool_id[rows], names, effects)
