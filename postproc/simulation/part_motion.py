"""Any small motion of any link by anything that drives it, planted by its text.

``rotation:link3:x by temperature linear`` turns all behind the frame before joint 3
about its x axis; ``shift:tool:z by lambda 4 * joint 5 harmonic 2`` shifts the tool.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.simulation.kinematics import LinkMasses, bending_moment, total_torque
from postproc.simulation.state import VirtualArrivals

MOTIONS = {"shift": 0, "rotation": 3}  # where their three numbers stand in a twist
DRIVERS = "payload", "temperature", "time", "order", "speed"
KNOTS = 6  # of a spline law
SHARP = 0.3  # of half a driver's range, over which a saturating law bends
HARDLY = 1e-6  # a range of a driver that is rounding
MIDDLE = 0.3, 0.7  # part of a driver's range in which a step lies

TEXT = re.compile(
    r"(rotation|shift):(base|tool|link[1-6]):([xyz]) by "
    r"([a-z0-9 *]+?) (constant|linear|sign|step|harmonic \d+|saturating|spline)"
)
DRIVER = re.compile(
    r"(?:joint|lambda|travel|torque) [1-6]|moment [1-6][xy]|"
    r"payload|temperature|time|order|speed"
)

Drive = Callable[[VirtualArrivals], Floats]
Bend = Callable[[Floats], Floats]
HOW = (
    "Write (rotation|shift):(base|link1..link6|tool):(x|y|z) by DRIVER LAW [mm], with "
    "drivers joint K, lambda K, travel K, torque K, moment Kx, moment Ky, payload, "
    "temperature, time, order, speed, products of them (lambda 3 * joint 4), and laws "
    "constant, linear, sign, step, harmonic N, saturating, spline"
)


@dataclass(frozen=True)
class PlantedMotion:
    """One small motion of a link as a function of what drives it.

    Attributes:
        motion: "rotation" or "shift".
        body: "base", "link1" .. "link6" or "tool".
        axis: "x", "y" or "z" of the frame before the link's joint; of the flange for
            the tool.
        drivers: Their product drives it; the law is of the last of them.
        law: One of `LAWS`, "harmonic" with its order.
    """

    motion: str
    body: str
    axis: str
    drivers: tuple[str, ...]
    law: str

    @classmethod
    def parse(cls, text: str) -> PlantedMotion:
        """Read its text.

        >>> PlantedMotion.parse("rotation:link3:x by temperature linear").drivers
        ('temperature',)

        Raises:
            PostprocError: No such motion, body, axis, driver or law.
        """
        match = TEXT.fullmatch(text)
        drivers = () if match is None else tuple(match[4].split(" * "))
        if match is None or not all(map(DRIVER.fullmatch, drivers)):
            raise PostprocError(f"the virtual arm has no motion '{text}'. {HOW}")
        return cls(match[1], match[2], match[3], drivers, match[5])

    def __str__(self) -> str:
        by = " * ".join(self.drivers)
        return f"{self.motion}:{self.body}:{self.axis} by {by} {self.law}"

    @property
    def place(self) -> int:
        """Which of the six numbers of a twist it is."""
        return MOTIONS[self.motion] + "xyz".index(self.axis)

    @property
    def link(self) -> int:
        """Number of the link, from 1; 0 for the base and the tool."""
        return int(self.body[4:]) if self.body.startswith("link") else 0

    def draw(
        self, rng: np.random.Generator, body: LinkMasses, reference: VirtualArrivals
    ) -> Drive:
        """Draw what its law leaves open, a phase or a place, and give its size.

        Args:
            rng: Random numbers of this law.
            body: The weights of the arm.
            reference: Arrivals over which the drivers vary as they usually do.

        Raises:
            PostprocError: The driver hardly varies, as no weight turns a vertical axis.
        """
        *factors, last = (_driver(name, body) for name in self.drivers)
        seen = last(reference)
        if self.law != "constant" and np.ptp(seen) < HARDLY:
            raise PostprocError(f"{self.drivers[-1]} does not vary on this arm")
        bends = _law(self.law, rng, float(seen.min()), float(seen.max()))

        def drive(arrivals: VirtualArrivals) -> Floats:
            value = bends(last(arrivals))
            for factor in factors:
                value = value * factor(arrivals)
            return value

        return drive


def _driver(name: str, body: LinkMasses) -> Drive:
    """Find what a driver's name stands for: angles [rad], moments [kN m], SI units."""
    kind, _, which = name.partition(" ")
    if kind in DRIVERS:
        return lambda a: np.asarray(getattr(a, kind), dtype=float)
    k = int(which[0]) - 1
    if kind == "moment":
        across = "xy".index(which[1])
        return lambda a: (
            bending_moment(body, a.q, a.payload, a.payload_com)[:, k, across] / 1e3
        )
    if kind == "torque":
        return lambda a: total_torque(body, a.q, a.payload, a.payload_com)[:, k] / 1e3
    field = {"joint": "q", "lambda": "side", "travel": "travel"}[kind]
    return lambda a: np.asarray(getattr(a, field)[:, k])


def _law(law: str, rng: np.random.Generator, low: float, high: float) -> Bend:
    """Draw a law of a driver that usually lies between two values."""
    kind, _, order = law.partition(" ")
    middle, half = (low + high) / 2, max((high - low) / 2, 1e-12)
    phase = rng.uniform(0.0, 2 * np.pi)
    at = low + rng.uniform(*MIDDLE) * (high - low)
    heights = rng.normal(size=KNOTS)
    smooth = CubicSpline(np.linspace(low, high, KNOTS), heights - heights.mean())
    laws: dict[str, Bend] = {
        "constant": np.ones_like,
        "linear": lambda x: x,
        "sign": lambda x: np.where(x > middle, 1.0, -1.0),
        "step": lambda x: np.where(x > at, 1.0, 0.0),
        "harmonic": lambda x: np.cos(int(order or 1) * x + phase),
        "saturating": lambda x: np.tanh((x - middle) / (SHARP * half)),
        "spline": lambda x: smooth(np.clip(x, low, high)),
    }
    return laws[kind]
