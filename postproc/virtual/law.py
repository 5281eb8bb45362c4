"""A physical law of the virtual arm: what one imperfection does on every arrival."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.arrivals import Arrivals
from postproc.virtual.gravity import Body

Shape = Callable[[Arrivals], Floats]


class Where(Enum):
    """What a law changes; always six numbers an arrival."""

    JOINTS = "joints"  # joint angles [rad]
    LENGTHS = "lengths"  # relative growth of every link
    BASE = "base"  # twist of the arm on its foundation [m, rad]
    TOOL = "tool"  # twist of the tool on the flange [m, rad]
    TRACKER = "tracker"  # twist of what the tracker reads [m, rad]; nothing moves


@dataclass(frozen=True)
class Law:
    """One imperfection.

    Attributes:
        effect: The name an engineer would give it; "" where no name fits.
        where: What it changes.
        joints: Joints that are moved, from 1; empty for lengths and frames.
        source: The joint that drives another joint's error, from 1, or 0.
        parameters: The law's own numbers, SI units, for the record.
        shape: (n,) arrivals -> (n, 6) per unit of `scale`.
        scale: Size of the law.
        peak_mm: Largest TCP displacement over the reference campaign.
    """

    effect: str
    where: Where
    joints: tuple[int, ...]
    source: int
    parameters: dict[str, float]
    shape: Shape
    scale: float = 1.0
    peak_mm: float = float("nan")

    def __call__(self, arrivals: Arrivals) -> Floats:
        """Return the change (n, 6) that the law makes on each arrival."""
        return np.asarray(self.scale * self.shape(arrivals))

    def scaled(self, factor: float, peak_mm: float) -> Law:
        """Return the law with another size."""
        return replace(self, scale=self.scale * factor, peak_mm=peak_mm)


@dataclass(frozen=True)
class Draw:
    """What the drawing of a law may use.

    Attributes:
        rng: Random numbers of this law alone.
        body: The weights of this arm (not the nominal ones).
        joint: The joint asked for, from 1, or 0: draw one.
        rows: How many rows the campaign has, for laws that start at one of them.
    """

    rng: np.random.Generator
    body: Body
    joint: int
    rows: int

    def pick(self, joints: Sequence[int]) -> int:
        """Return the joint asked for, or one of the given joints."""
        return self.joint or int(self.rng.choice(joints))

    def sign(self) -> float:
        """Return +1 or -1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def phase(self) -> float:
        """Return an angle [rad]."""
        return float(self.rng.uniform(0.0, 2 * np.pi))


def on_joint(joint: int, values: Floats) -> Floats:
    """Put values (n,) [rad] into the column of a joint (from 1) of an (n, 6) array."""
    out = np.zeros((len(values), 6))
    out[:, joint - 1] = values
    return out


def total(laws: Sequence[Law], where: Where, arrivals: Arrivals) -> Floats:
    """Sum the changes (n, 6) of all laws that act at one place."""
    parts = [law(arrivals) for law in laws if law.where is where]
    return np.asarray(sum(parts, np.zeros((len(arrivals), 6))))
