"""The solutions at the samples of a path: all branches, or only those asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from postproc.arrays import Floats
from postproc.robot.arm import Arm


class Ways(Protocol):
    """Solutions of the inverse kinematics at k samples."""

    def __len__(self) -> int:
        """Return the number of samples."""
        ...

    def all(self, i: int) -> Floats:
        """Return all branches at sample i, (8, 6) [rad], NaN where none."""
        ...

    def on(self, slot: int, first: int, most: int) -> Floats:
        """Return one branch at samples from `first` on, (.., 6) [rad], on any turn.

        Args:
            slot: The branch.
            first: The first sample.
            most: How many are enough for the moment: a path that breaks off again and
                again must not be looked through to its end every time.
        """
        ...


@dataclass(frozen=True)
class Solved:
    """Ways of samples that were solved beforehand, (k, 8, 6) [rad]."""

    branches: Floats

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.branches)

    def all(self, i: int) -> Floats:
        """Look all branches up."""
        branches: Floats = self.branches[i]
        return branches

    def on(self, slot: int, first: int, most: int) -> Floats:
        """Look one branch up."""
        branch: Floats = self.branches[first : first + most, slot]
        return branch


@dataclass(frozen=True)
class OnDemand:
    """Ways of a long path, which keeps to one branch: the others are hardly needed.

    Attributes:
        arm: The arm.
        flange: Flange poses, (k, 4, 4) [m].
    """

    arm: Arm
    flange: Floats

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.flange)

    def all(self, i: int) -> Floats:
        """Solve for all branches at one sample."""
        branches: Floats = self.arm.inverse(self.flange[i : i + 1]).q[0]
        return branches

    def on(self, slot: int, first: int, most: int) -> Floats:
        """Solve for one branch."""
        ahead = self.flange[first : first + most]
        return self.arm.on_branch(ahead, np.full(len(ahead), slot))
