"""What the virtual arm knows about itself each time it arrives somewhere."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, read_only
from postproc.simulation.kinematics import pose

LONG_TRAVEL = 1.0  # [rad] travel since a reversal that nobody recorded
REST_TEMPERATURE = 20.0  # [deg C] where the arm has its nominal lengths (ISO 1)
USUAL_SPEED = 0.1  # [m/s]


@dataclass(frozen=True)
class VirtualArrivals:
    """n arrivals in the order they happen (structure of arrays, SI units).

    Attributes:
        q: Commanded joint angles as the controller shows them, (n, 6) [rad].
        side: Where each gear would lie in its gap by the way alone, (n, 6), +1 driven
            forward, -1 backward.
        flank: Where it really lies, (n, 6); not so where a moving arm braked.
        travel: Way of each joint since its last reversal, (n, 6) [rad].
        loop: Way between its last two reversals, (n, 6) [rad].
        speed: Speed of the TCP on the way there, (n,) [m/s].
        time: (n,) [s].
        temperature: Of the arm, (n,) [deg C].
        payload: (n,) [kg].
        payload_com: In the flange frame, (n, 3) [m].
        order: Place in the sequence of measured visits, (n,).
        tool: The nominal tool, flange to TCP, (n, 4, 4) [m].
    """

    q: Floats
    side: Floats
    flank: Floats
    travel: Floats
    loop: Floats
    speed: Floats
    time: Floats
    temperature: Floats
    payload: Floats
    payload_com: Floats
    order: Floats
    tool: Floats

    def __post_init__(self) -> None:
        read_only(self)

    def __len__(self) -> int:
        """Return the number of arrivals."""
        return len(self.q)

    def __getitem__(
        self, rows: NDArray[np.int64] | NDArray[np.bool_] | slice
    ) -> VirtualArrivals:
        """Return some of the arrivals."""
        return replace(
            self, **{f.name: getattr(self, f.name)[rows] for f in fields(self)}
        )


_DEFAULTS: dict[str, tuple[float, tuple[int, ...]]] = {
    "side": (0.0, (6,)),
    "flank": (0.0, (6,)),
    "travel": (LONG_TRAVEL, (6,)),
    "loop": (LONG_TRAVEL, (6,)),
    "speed": (USUAL_SPEED, ()),
    "time": (0.0, ()),
    "temperature": (REST_TEMPERATURE, ()),
    "payload": (0.0, ()),
    "payload_com": (0.0, (3,)),
}


def make_arrivals(
    q: Floats,
    side: Floats | float = 0.0,
    tool: Floats | None = None,
    **covariates: Floats | float,
) -> VirtualArrivals:
    """Build arrivals from joint angles; what is not given or NaN takes a default.

    Args:
        q: Joint angles, (n, 6) [rad].
        side: Arrival directions, (n, 6) or one value.
        tool: TCP (3,) or (n, 3), or tool pose (4, 4) or (n, 4, 4) [m]; default flange.
        covariates: Any other field of `VirtualArrivals`.

    Raises:
        TypeError: A covariate that `VirtualArrivals` does not have.
    """
    q = np.array(q, dtype=float).reshape(-1, 6)
    n = len(q)
    given: dict[str, Floats | float] = {"side": side, "flank": side, **covariates}
    order = np.array(np.broadcast_to(given.pop("order", np.arange(n)), n), dtype=float)
    if unknown := sorted(set(given) - set(_DEFAULTS)):
        raise TypeError(f"arrivals have no {', '.join(unknown)}")
    values = {}
    for name, (default, shape) in _DEFAULTS.items():
        value = np.broadcast_to(given.get(name, default), (n, *shape)).astype(float)
        values[name] = np.where(np.isnan(value), default, value)
    tool = np.zeros(3) if tool is None else np.asarray(tool, dtype=float)
    if tool.shape[-2:] != (4, 4):
        tool = pose(np.eye(3), tool)
    return VirtualArrivals(
        q=q, order=order, tool=np.array(np.broadcast_to(tool, (n, 4, 4))), **values
    )


class StatesLike(Protocol):
    """The fields of the model's states that mean something to a real arm."""

    q: Floats
    direction: Floats
    tool: Floats
    travel: Floats
    speed: Floats
    time: Floats
    temperature: Floats
    payload: Floats
    payload_com: Floats
    order: Floats


def arrivals_of_states(states: StatesLike) -> VirtualArrivals:
    """Translate the model's states; what they do not know takes a default."""
    names = "travel speed time temperature payload payload_com order".split()
    covariates = {name: getattr(states, name) for name in names}
    return make_arrivals(states.q, states.direction, states.tool, **covariates)
