"""Time laws and ways that were found before, for tests that judge a program again.

Both depend on their arguments alone, so that a program with one claim changed, which is
judged in full, does not ask toppra and Pinocchio again for all that is the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest

from postproc.verify import directions
from postproc.verify.pinocchio_arm import PinocchioArm
from postproc.verify.ways import WayMaker


def key_of(*given: Any) -> tuple[Any, ...]:
    """Return what tells arguments apart: arrays by their shape and bytes."""
    return tuple(
        (x.shape, x.tobytes()) if isinstance(x, np.ndarray) else x for x in given
    )


def remember(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compute a function of arrays once for the same arguments."""
    found: dict[tuple[Any, ...], Any] = {}

    def once(*given: Any) -> Any:
        key = key_of(*given)
        if key not in found:
            found[key] = function(*given)
        return found[key]

    return once


def remember_all(patch: pytest.MonkeyPatch) -> None:
    """Remember time laws of runs, and the ways that an arm of the same facts goes."""
    patch.setattr(directions, "run_in_time", remember(directions.run_in_time))
    patch.setattr(directions, "move_in_time", remember(directions.move_in_time))
    build, follow = PinocchioArm.build, WayMaker._follow
    facts: dict[int, tuple[PinocchioArm, str]] = {}  # an arm is kept: ids stay its own
    ways: dict[tuple[Any, ...], Any] = {}

    def built(own: Any, load: Any = None) -> PinocchioArm:
        arm = build(own, load)
        facts[id(arm)] = arm, f"{own.file!r} {own.weight.tolist()}"
        return arm

    def followed(maker: WayMaker, begin: Any, course: Any) -> Any:
        key = facts[id(maker.arm)][1], *key_of(begin, *astuple(course))
        if key not in ways:
            ways[key] = follow(maker, begin, course)
        return ways[key]

    patch.setattr(PinocchioArm, "build", built)
    patch.setattr(WayMaker, "_follow", followed)
