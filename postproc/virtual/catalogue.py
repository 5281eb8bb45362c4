"""All imperfections by name, and the text that asks for them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from postproc.exceptions import PostprocError
from postproc.virtual import direction_laws, frame_laws, joint_laws
from postproc.virtual.law import Draw, Law

DEFAULT = ("geometry", "tool", "backlash")
AS_BUILT = ("geometry", "tool")  # drawn as numbers of the chain, not as laws


@dataclass(frozen=True)
class Kind:
    """A law by name: how it is drawn, and its usual peak size on the TCP [mm]."""

    draw: Callable[[Draw], Law]
    low_mm: float
    high_mm: float


KINDS = {
    "compliance": Kind(joint_laws.compliance, 0.1, 1.0),
    "payload": Kind(joint_laws.payload, 0.2, 2.0),
    "counterbalance": Kind(joint_laws.counterbalance, 0.1, 0.5),
    "transmission": Kind(joint_laws.transmission, 0.05, 0.3),
    "transmission_free": Kind(joint_laws.transmission_free, 0.05, 0.3),
    "scale": Kind(joint_laws.scale, 0.05, 0.3),
    "coupling": Kind(joint_laws.coupling, 0.05, 0.3),
    "load_backlash": Kind(direction_laws.load_backlash, 0.05, 0.3),
    "gravity_side": Kind(direction_laws.gravity_side, 0.05, 0.3),
    "thermal": Kind(frame_laws.thermal, 0.1, 1.0),
    "warmup": Kind(frame_laws.warmup, 0.1, 1.0),
    "windup": Kind(direction_laws.windup, 0.03, 0.15),
    "lag": Kind(direction_laws.lag, 0.03, 0.25),
    "base_shift": Kind(frame_laws.base_shift, 0.05, 0.5),
    "tool_shift": Kind(frame_laws.tool_shift, 0.05, 0.5),
    "tracker_drift": Kind(frame_laws.tracker_drift, 0.03, 0.1),
    "worn_spot": Kind(joint_laws.worn_spot, 0.05, 0.5),
    "joint_product": Kind(joint_laws.joint_product, 0.05, 0.3),
    "hysteresis": Kind(direction_laws.hysteresis, 0.05, 0.3),
}
NAMES = (*DEFAULT, *KINDS)


@dataclass(frozen=True)
class Planted:
    """One imperfection asked for.

    Attributes:
        name: One of `NAMES`.
        joint: From 1, or 0: drawn.
        peak_mm: Largest displacement of the TCP, or 0: drawn from the usual sizes.
    """

    name: str
    joint: int = 0
    peak_mm: float = 0.0


def parse_effects(text: str | Sequence[str | Planted]) -> tuple[Planted, ...]:
    """Read a list of effects: ``name``, ``name@joint``, ``name=mm``, ``name@joint=mm``.

    ``all`` stands for every name.

    >>> parse_effects("geometry,compliance@2=0.4")[1]
    Planted(name='compliance', joint=2, peak_mm=0.4)

    Raises:
        PostprocError: A name, joint or size that does not exist.
    """
    items = text.split(",") if isinstance(text, str) else text
    found: list[Planted] = []
    for item in items:
        if isinstance(item, Planted):
            found.append(item)
        elif item.strip() == "all":
            found += [Planted(name) for name in NAMES]
        elif item.strip():
            found.append(_read(item.strip()))
    return tuple(found)


def _read(item: str) -> Planted:
    match = re.fullmatch(r"(\w+)(?:@([1-6]))?(?:=([0-9.]+(?:e-?\d+)?))?", item)
    if match is None or match[1] not in NAMES:
        raise PostprocError(
            f"the virtual arm has no effect '{item}'. Write name, name@joint, name=mm "
            f"or name@joint=mm with one of: {', '.join(NAMES)}"
        )
    return Planted(match[1], int(match[2] or 0), float(match[3] or 0.0))
