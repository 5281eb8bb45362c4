"""Pose accuracy over many poses, in one line of figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.robot.pose import MM


@dataclass(frozen=True)
class ErrorStatistics:
    """Pose accuracy over a set of visits: distances between two points [mm]."""

    mean_mm: float
    std_mm: float
    p95_mm: float
    max_mm: float
    n: int

    @classmethod
    def of(cls, error: Floats) -> ErrorStatistics:
        """Summarise error vectors (n, 3) [m]; NaN figures where there are none."""
        return cls.of_sizes(np.linalg.norm(error, axis=1))

    @classmethod
    def of_sizes(cls, size: Floats) -> ErrorStatistics:
        """Summarise lengths of error vectors (n,) [m], as `of` does."""
        size = size / MM
        if len(size) == 0:
            return cls(np.nan, np.nan, np.nan, np.nan, 0)
        p95 = float(np.percentile(size, 95))
        return cls(
            float(size.mean()), float(size.std()), p95, float(size.max()), len(size)
        )

    def tell(self) -> str:
        """Say it in one line."""
        return (
            f"mean {self.mean_mm:.4f} mm, std {self.std_mm:.4f}, "
            f"95 % {self.p95_mm:.4f}, max {self.max_mm:.4f} ({self.n} rows)"
        )

    __str__ = tell
