"""Words that programs and plans share: how an arm moves from target to target."""

from __future__ import annotations

from enum import IntEnum


class Motion(IntEnum):
    """How the arm moves between two targets."""

    JOINT = 0
    LINEAR = 1
    CIRCULAR = 2
