"""The place where the virtual arm works, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.virtual.kinematics import NJ220, Chain

# Where a tracker stands when nobody says so: to the right in front of the arm.
USUAL_TRACKER = np.array([4.0, -3.0, 1.5])  # [m] in the arm base frame
SAME_POINT = 1e-6  # [m]


def _identity() -> Floats:
    return np.eye(4)


@dataclass(frozen=True)
class Setup:
    """What the cell tells: SI units, poses in the frames of the controller.

    Attributes:
        chain: The nominal arm.
        coupling: Motor angles = coupling @ joint angles, (6, 6).
        tool: Flange to TCP, (4, 4) [m].
        base: World to arm base, (4, 4).
        uframe: World to user frame, (4, 4).
        tools: Tools that `tool_id` columns count, (k, 4, 4); empty: always `tool`.
        home: $HOME and where programs start, (6,) [rad], or None.
        calibration: $CAL_SYS, (6,) [rad], or None.
        payload: [kg].
        payload_com: In the flange frame, (3,) [m].
        temperature: At the start, [deg C].
        tracker: Where the tracker stands, (3,) [m] in the arm base frame.
    """

    chain: Chain = NJ220
    coupling: Floats = field(default_factory=lambda: np.eye(6))
    tool: Floats = field(default_factory=_identity)
    base: Floats = field(default_factory=_identity)
    uframe: Floats = field(default_factory=_identity)
    tools: Floats = field(default_factory=lambda: np.zeros((0, 4, 4)))
    home: Floats | None = None
    calibration: Floats | None = None
    payload: float = 0.0
    payload_com: Floats = field(default_factory=lambda: np.zeros(3))
    temperature: float = 22.0
    tracker: Floats = field(default_factory=lambda: USUAL_TRACKER.copy())

    def tool_of(self, tool_id: NDArray[np.int64]) -> Floats:
        """Return the tool poses (n, 4, 4) of tool numbers (n,) from 0.

        Numbers that count from 1 to the number of tools are understood too.

        Raises:
            PostprocError: A number that belongs to no tool.
        """
        if not len(self.tools):
            return np.broadcast_to(self.tool, (len(tool_id), 4, 4))
        lowest, highest = (int(f(tool_id)) for f in (np.min, np.max))
        if lowest > 0 and highest == len(self.tools):
            tool_id, lowest, highest = tool_id - 1, lowest - 1, highest - 1
        if lowest < 0 or highest >= len(self.tools):
            raise PostprocError(
                f"the rows name tools {lowest} to {highest}, the cell has "
                f"{len(self.tools)} probe points. Add them to [survey] points_mm"
            )
        return np.asarray(self.tools[tool_id])

    def number_of(self, tool: Floats) -> int:
        """Return the number from 0 of the probe point at a tool's TCP, or -1."""
        away = np.linalg.norm(self.tools[:, :3, 3] - tool[:3, 3], axis=1)
        same = np.flatnonzero(away < SAME_POINT)
        return int(same[0]) if len(same) else -1
