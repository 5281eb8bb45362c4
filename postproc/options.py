"""What the user asked for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """What the user asked for.

    Attributes:
        clone: Give moves whose arrivals at one variable disagree one each.
        shared: Edit variables that other programs may read too.
        orientation: Correct the orientation of targets as well as their position.
        temperature: Arm temperature [deg C]; default: the cell's.
    """

    clone: bool = False
    shared: bool = False
    temperature: float | None = None
    orientation: bool = False


AS_USUAL = Options()
