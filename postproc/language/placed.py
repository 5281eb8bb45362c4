"""Frames as languages of statements find them: tools, bases, work objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.robot.pose import pose_from_record

Pose = tuple[float, ...]  # the rows of (4, 4) [m] one after the other, () if not known
IDENTITY: Pose = (1.0, *(0.0,) * 4, 1.0, *(0.0,) * 4, 1.0, *(0.0,) * 4, 1.0)


@dataclass(frozen=True)
class PlacedFrame:
    """A frame.

    Attributes:
        pose: Where it is, empty where that is not known.
        taught: It was taught with the arm, and contains its error.
    """

    pose: Pose
    taught: bool = False


def flat(pose: Floats) -> Pose:
    """Write the rows of a pose, (4, 4) [m], one after the other."""
    return tuple(pose.ravel().tolist())


def matrix(pose: Pose) -> Floats:
    """Return a pose that is known, (4, 4) [m]."""
    return np.array(pose).reshape(4, 4)


def composed(first: Pose, second: Pose) -> Pose:
    """Compose two poses that are known."""
    return flat(matrix(first) @ matrix(second))


def from_record(record: Sequence[float] | None) -> Pose:
    """Convert a position record [mm, deg] of the cell, if there is one."""
    return flat(pose_from_record(np.array(record, float))) if record else ()
