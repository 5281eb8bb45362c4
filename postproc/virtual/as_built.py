"""The arm as it was really built: numbers of the chain that differ from the drawing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.gravity import Body
from postproc.virtual.kinematics import Chain


@dataclass(frozen=True)
class AsBuilt:
    """Geometry of one arm.

    Attributes:
        chain: The chain with its D-H errors.
        base: Twist of the arm on its foundation, (6,) [m, rad].
        mount: Twist of the mounting plate on the flange, (6,) [m, rad]. It belongs to
            the arm: every tool that is put on stands on the same plate.
    """

    chain: Chain
    base: Floats
    mount: Floats


def draw_as_built(
    rng: np.random.Generator, nominal: Chain, geometry: bool, tool: bool
) -> AsBuilt:
    """Draw the errors of one arm.

    Lengths are off by 0.1 to 0.6 mm, angles by 0.1 to 0.6 mrad, the mounting plate by
    0.3 to 1 mm along each axis: 1 to 3 mm at the TCP, as arms come from the factory.

    Args:
        rng: Random numbers of the geometry alone.
        nominal: The arm of the drawing.
        geometry: Whether the chain and the base are off.
        tool: Whether the mounting plate is off.
    """
    length, angle = _off(rng, 0.1e-3, 0.6e-3, (2, 6)), _off(rng, 1e-4, 6e-4, (2, 6))
    beta = np.zeros(6)
    beta[1] = _off(rng, 1e-4, 6e-4, ())  # axes 2 and 3 should be parallel
    base = _twist(rng, (0.1e-3, 0.4e-3), (0.5e-4, 2e-4))
    mount = _twist(rng, (0.3e-3, 1e-3), (2e-4, 6e-4))
    if not geometry:
        length, angle, beta, base = 0 * length, 0 * angle, 0 * beta, 0 * base
    chain = replace(
        nominal,
        a=nominal.a + length[0],
        d=nominal.d + length[1],
        alpha=nominal.alpha + angle[0],
        offset=nominal.offset + angle[1],
        beta=nominal.beta + beta,
    )
    return AsBuilt(chain, base, mount if tool else 0 * mount)


def draw_body(rng: np.random.Generator, chain: Chain) -> Body:
    """Draw the weights of one arm: 10 % and 20 mm off the estimates."""
    mass = chain.mass * rng.uniform(0.9, 1.1, 6)
    centre = chain.centre + rng.uniform(-0.02, 0.02, (6, 3))
    return Body(chain, mass, centre)


def _off(
    rng: np.random.Generator, low: float, high: float, shape: tuple[int, ...]
) -> Floats:
    """Draw sizes between low and high with either sign."""
    size = rng.uniform(low, high, shape)
    return np.asarray(size * rng.choice([-1.0, 1.0], shape))


def _twist(
    rng: np.random.Generator, shift: tuple[float, float], turn: tuple[float, float]
) -> Floats:
    return np.concatenate([_off(rng, *shift, (3,)), _off(rng, *turn, (3,))])
