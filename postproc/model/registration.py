"""A registration: where a survey's tracker stood, and where its probe points sat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.robot.state import States


@dataclass(frozen=True, eq=False)
class Registration:
    """A tracker's place and the probe points, as fitted.

    Attributes:
        base_from_tracker: Transform of tracker coordinates into the base frame, (4, 4).
        probes: Probe points in the flange frame, (k, 3) [m].
        tool_ids: The `tool_id` of every probe point, ascending, (k,).
    """

    base_from_tracker: Floats
    probes: Floats
    tool_ids: NDArray[np.int64]

    @property
    def tracker(self) -> Floats:
        """Position of the tracker in the base frame, (3,) [m]."""
        place: Floats = self.base_from_tracker[:3, 3]
        return place

    def to_base(self, position: Floats) -> Floats:
        """Convert positions (n, 3) [m] from the tracker's to the base frame."""
        T = self.base_from_tracker
        converted: Floats = position @ T[:3, :3].T + T[:3, 3]
        return converted

    def to_tracker(self, position: Floats) -> Floats:
        """Convert positions (n, 3) [m] from the base to the tracker's frame."""
        T = self.base_from_tracker
        converted: Floats = (position - T[:3, 3]) @ T[:3, :3]
        return converted

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
