"""What the arm is doing at the moment it arrives at a target."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, read_only, take_rows


@dataclass(frozen=True)
class States:
    """States of the arm at n visits, in visit order (structure of arrays).

    NaN in an optional covariate means that it is not known. SI units.

    Attributes:
        q: Commanded joint angles as the controller shows them, (n, 6) [rad].
        direction: Arrival direction of every joint, (n, 6) in [-1, 1]; 0 is unknown.
        tool: TCP in the flange frame, (n, 3) [m].
        tool_id: Which tool or probe point, (n,) integers from 0.
        travel: Travel of every joint since its last reversal, (n, 6) [rad].
        speed: TCP speed on arrival, (n,) [m/s].
        time: Time since the first visit, (n,) [s].
        temperature: Arm or ambient temperature, (n,) [deg C].
        payload: Payload mass, (n,) [kg].
        payload_com: Payload centre of mass in the flange frame, (n, 3) [m].
        order: Position in the visit order, (n,); equal for rows of one stop.
        heading: Direction in which the TCP moves, (n, 3), unit vectors in the base
            frame, where it was read in motion: then nothing is known of its place along
            that direction. NaN where the arm stands still.
        readings: Number of readings that a row's position is the mean of, (n,).
        scatter: Sum of their squared distances from it, (n,) [m^2].
        station: Which place of the tracker a reading was taken from, (n,) integers from
            0; of a survey in the base frame: which file it stands in.
    """

    q: Floats
    direction: Floats
    tool: Floats
    tool_id: NDArray[np.int64]
    travel: Floats
    speed: Floats
    time: Floats
    temperature: Floats
    payload: Floats
    payload_com: Floats
    order: Floats
    heading: Floats
    readings: Floats
    scatter: Floats
    station: NDArray[np.int64]

    def __post_init__(self) -> None:
        read_only(self)

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.q)

    def __getitem__(
        self, rows: NDArray[np.int64] | NDArray[np.bool_] | slice
    ) -> States:
        """Return the states of the given rows."""
        return replace(
            self,
            **{f.name: take_rows(getattr(self, f.name), rows) for f in fields(self)},
        )

    def across(self, vectors: Floats) -> Floats:
        """Leave out what lies along the direction of motion, of vectors (n, 3)."""
        heading = np.nan_to_num(self.heading)
        along = np.einsum("ni,ni->n", vectors, heading)[:, None]
        return np.asarray(vectors - along * heading)

    def with_(self, **changes: NDArray[np.generic]) -> States:
        """Return a copy with some arrays replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]


def make_states(
    q: Floats,
    direction: Floats | None = None,
    tool: Floats | None = None,
    **covariates: NDArray[np.generic] | float,
) -> States:
    """Build states from joint angles, with unknown covariates as NaN.

    Args:
        q: Joint angles, (n, 6) [rad].
        direction: (n, 6), default 0 (unknown).
        tool: TCP in the flange frame, (3,) or (n, 3) [m], default the flange.
        covariates: Any other field of `States`, as an array or one value for all.

    Raises:
        TypeError: A covariate that `States` does not have.
    """
    q = np.array(q, dtype=float)
    n = len(q)
    shapes: dict[str, tuple[int, ...]] = {
        "travel": (n, 6), "speed": (n,), "time": (n,), "temperature": (n,),
        "payload": (n,), "payload_com": (n, 3), "heading": (n, 3),
    }  # fmt: skip
    values: dict[str, NDArray[np.generic]] = {
        name: np.broadcast_to(
            np.array(covariates.pop(name, np.nan), dtype=float), shape
        )
        for name, shape in shapes.items()
    }
    tool_id, station = covariates.pop("tool_id", 0), covariates.pop("station", 0)
    for name, value in (("readings", 1.0), ("scatter", 0.0)):
        given = np.array(covariates.pop(name, value), dtype=float)
        values[name] = np.broadcast_to(given, (n,))
    order = covariates.pop("order", np.arange(n))
    if covariates:
        raise TypeError(f"states have no {', '.join(covariates)}")
    return States(
        q=q,
        direction=np.zeros((n, 6)) if direction is None else np.array(direction, float),
        tool=np.broadcast_to(np.zeros(3) if tool is None else tool, (n, 3)),
        tool_id=np.broadcast_to(np.array(tool_id, dtype=np.int64), (n,)),
        order=np.broadcast_to(np.array(order, dtype=float), (n,)),
        station=np.broadcast_to(np.array(station, dtype=np.int64), (n,)),
        **values,  # type: ignore[arg-type]
    )
