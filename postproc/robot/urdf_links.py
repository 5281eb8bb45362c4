"""Masses and centres of a URDF as the links of an arm file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

SPREAD = 0.5  # of moments that come from a URDF: few are weighed, many are estimates
HEAVIEST = 0.01  # [kg] a robot whose links all weigh less has none stated
SPARE = 5  # number, from 0, of the link that may be a frame without a mass
TEMPLATE = """
[links]                       # from <inertial> of the URDF, in the D-H frames
mass_kg = [{mass}]
com_mm = [
{com},
]
spread = {spread}                  # share by which the true moments may differ
"""


@dataclass(frozen=True)
class Weight:
    """The <inertial> of one link of a URDF.

    Attributes:
        link: Name of the link.
        body: Number, from 0, of the moving joint that it hangs on.
        mass: [kg].
        centre: In the base frame where all joints are at 0, (3,) [m].
    """

    link: str
    body: int
    mass: float
    centre: Floats


def placeholder(weights: Sequence[Weight]) -> str | None:
    """Return why the masses of a URDF are none of an arm, None where they may be."""
    bodies = {w.body for w in weights if w.mass > 0.0}
    if not bodies:
        return "states no masses"
    missing = [str(k + 1) for k in range(SPARE) if k not in bodies]
    if missing:
        return f"states no mass behind joint {', '.join(missing)}"
    masses = [w.mass for w in weights if w.mass > 0.0]
    if len(set(masses)) == 1:
        return f"has placeholders for masses: {masses[0]:g} kg for every link"
    if max(masses) < HEAVIEST:
        return f"has placeholders for masses: none is above {HEAVIEST:g} kg"
    return None


def links_text(weights: Sequence[Weight], arm: Arm) -> str:
    """Write the section [links] of an arm file, empty where a URDF has no masses.

    Args:
        weights: What the URDF states.
        arm: The arm of the file's other sections, whose D-H frames count.
    """
    if placeholder(weights) is not None:
        return ""
    frames = arm.link_frames(np.zeros((1, 6)))[0, 1:]
    mass, first = np.zeros(6), np.zeros((6, 3))
    for w in weights:
        mass[w.body] += w.mass
        first[w.body] += w.mass * w.centre
    rows = []
    for frame, m, moment in zip(frames, mass, first, strict=True):
        place = moment / m - frame[:3, 3] if m else np.zeros(3)
        rows.append(_format_numbers(frame[:3, :3].T @ place / MM, 3))
    com = ",\n".join(f"    [{row}]" for row in rows)
    return TEMPLATE.format(mass=_format_numbers(mass, 6), com=com, spread=SPREAD)


def _format_numbers(values: Floats, digits: int) -> str:
    """Write numbers, without a sign of zero."""
    return ", ".join(repr(round(float(v), digits) + 0.0) for v in values)


def body_of(
    link: str, above: Mapping[str, tuple[str, str]], moving: Sequence[str]
) -> int | None:
    """Return the number, from 0, of the moving joint that a link hangs on.

    Args:
        link: The link.
        above: Joint and parent of every link that hangs on another.
        moving: Names of the moving joints, base to tip.

    Returns:
        None where the link hangs on the base.
    """
    while link in above:
        joint, link = above[link]
        if joint in moving:
            return list(moving).index(joint)
    return None
