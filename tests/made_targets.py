"""Targets for tests of motion, reached one after the other."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.motion.targets import Fly, Targets


def make_targets(
    kind: Ints, tcp: Floats | None = None, joints: Floats | None = None, **given: object
) -> Targets:
    """Build targets reached one after the other; what is not given takes a default.

    The defaults are JOINT moves that stop, without a tool, without a configuration
    string, at an unknown programmed speed and full override, from an unknown place; fly
    points are passed exactly.

    Raises:
        TypeError: A field that `Targets` does not have.
    """
    kind = np.asarray(kind, dtype=np.int64)
    n = len(kind)
    values: dict[str, object] = {
        "move": np.zeros(n, dtype=np.int64),
        "via": np.zeros(n, dtype=bool),
        "tcp": np.full((n, 4, 4), np.nan) if tcp is None else tcp,
        "distance": np.full(n, np.nan),
        "joints": np.full((n, 6), np.nan) if joints is None else joints,
        "tool": np.tile(np.eye(4), (n, 1, 1)),
        "slot": np.full(n, -1),
        "turns": np.full((n, 3), np.nan),
        "nearest_turn": np.zeros(n, dtype=bool),
        "fly": np.zeros(n, dtype=bool),
        "rounding": np.full(n, int(Fly.EXACT)),
        "fly_distance": np.zeros(n),
        "overlap": np.zeros(n),
        "linear_speed": np.full(n, np.nan),
        "rotary_speed": np.full(n, np.nan),
        "override": np.ones(n),
        "wrist_joint": np.zeros(n, dtype=bool),
        "block": np.full(n, -1),
        "curved": np.zeros(n, dtype=bool),
        "along": np.zeros(n, dtype=bool),
        "past_start": np.zeros(n, dtype=bool),
        "stops": np.zeros(n, dtype=bool),
        "pred_start": np.arange(n + 1),
        "pred": np.arange(n) - 1,
    }
    values.update(given)
    return Targets(kind=kind, **{k: np.array(v) for k, v in values.items()})
