"""What an error may depend on: every quantity recorded or planned, by name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.batch import Batch

Array = NDArray[np.float64]

JOINT_KINDS = ("joint", "travel", "torque")
PLAIN = ("speed", "payload", "temperature", "time", "order")


def covariate(batch: Batch, name: str) -> Array:
    """Look up a covariate by its name, (n,), NaN where it is not known.

    Names are ``joint 5`` (its angle [rad]), ``travel 5`` (since its last reversal
    [log rad]), ``torque 5`` (of gravity about it [N m]), ``speed``, ``payload``,
    ``temperature``, ``time`` and ``order`` (SI units).

    Raises:
        ValueError: There is no such covariate.
    """
    kind, _, number = name.partition(" ")
    if kind in PLAIN and not number:
        return np.asarray(getattr(batch.states, kind), dtype=float)
    if kind in JOINT_KINDS and number in set("123456"):
        j = int(number) - 1
        if kind == "joint":
            return np.asarray(batch.states.q[:, j])
        if kind == "travel":
            return np.log(np.maximum(batch.states.travel[:, j], 1e-4))
        return np.asarray((batch.loads.gravity + batch.loads.payload)[:, j])
    raise ValueError(f"there is no covariate {name!r}")


def unit(name: str) -> str:
    """Name the unit of a covariate in SI."""
    kind = name.partition(" ")[0]
    return {
        "joint": "rad", "travel": "log rad", "torque": "N m", "speed": "m/s",
        "payload": "kg", "temperature": "deg C", "time": "s", "order": "rows",
    }[kind]  # fmt: skip
