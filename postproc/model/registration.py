"""A registration: where a survey's tracker stood, and where its probe points sat."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.robot.state import States


@dataclass(frozen=True, eq=False)
class Registration:
    """A tracker's places and the probe points, as fitted.

    Attributes:
        transforms: Of tracker coordinates into the base frame, one for each station of
            the tracker, (s, 4, 4).
        probes: Probe points in the flange frame, (k, 3) [m].
        tool_ids: The `tool_id` of every probe point, ascending, (k,).
        stations: Names of the s stations; the first holds where a file names none.
    """

    transforms: Floats
    probes: Floats
    tool_ids: NDArray[np.int64]
    stations: tuple[str, ...] = ("",)

    @property
    def tracker(self) -> Floats:
        """Position of the tracker at the first station, base frame, (3,) [m]."""
        return np.asarray(self.transforms[0, :3, 3])

    @property
    def origin(self) -> Floats | None:
        """Position of the tracker, (3,) [m], None where it stood at several places."""
        return self.tracker if len(self.transforms) == 1 else None

    def at_station(self, number: int) -> Registration:
        """Return the registration of one station alone."""
        return Registration(
            self.transforms[number : number + 1], self.probes, self.tool_ids,
            self.stations[number : number + 1],
        )  # fmt: skip

    def to_base(
        self, position: Floats, station: NDArray[np.int64] | None = None
    ) -> Floats:
        """Convert positions (n, 3) [m] from the tracker's to the base frame.

        Args:
            position: In the tracker's frame.
            station: Of every position, (n,); None: the first.
        """
        T = self._of(position, station)
        converted: Floats = np.einsum("nij,nj->ni", T[:, :3, :3], position)
        return converted + T[:, :3, 3]

    def rotations(self, station: NDArray[np.int64]) -> Floats:
        """Return the rotation into the base frame for stations (n,), (n, 3, 3)."""
        return np.asarray(self.transforms[station, :3, :3])

    def _of(self, position: Floats, station: NDArray[np.int64] | None) -> Floats:
        """Return the transform of every position, (n, 4, 4)."""
        if station is None or len(self.transforms) == 1:
            return np.broadcast_to(self.transforms[0], (len(position), 4, 4))
        return np.asarray(self.transforms[station])

    def on_probes(self, states: States) -> States:
        """Put the tool of every state where its probe point was found.

        Raises:
            KeyError: A `tool_id` that the survey did not have.
        """
        missing = np.setdiff1d(states.tool_id, self.tool_ids)
        if len(missing):
            raise KeyError(int(missing[0]))
        which = np.searchsorted(self.tool_ids, states.tool_id)
        return states.with_(tool=self.probes[which])


def rigid_fit(a: Floats, b: Floats, weight: Floats | None = None) -> Floats:
    """Find the rigid transform (4, 4) that takes points a (n, 3) to b best.

    Args:
        a: Points.
        b: Where they should lie.
        weight: Of the points, (n,); None: all alike.
    """
    from scipy.spatial.transform import Rotation  # slow to load, and for fits alone

    weight = np.ones(len(a)) if weight is None else weight
    total = weight.sum()
    ca, cb = weight @ a / total, weight @ b / total
    with warnings.catch_warnings():  # of points on a line any turn about it will do
        warnings.simplefilter("ignore", UserWarning)
        turn, _ = Rotation.align_vectors(b - cb, a - ca, weights=weight)
    T = np.eye(4)
    T[:3, :3] = turn.as_matrix()
    T[:3, 3] = cb - T[:3, :3] @ ca
    return T
