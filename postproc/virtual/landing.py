"""Where the tool really lands when a program runs, against what was wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.exceptions import PostprocError
from postproc.language.visits import Visits
from postproc.virtual.arm import VirtualArm
from postproc.virtual.program import run_program
from postproc.virtual.setup import Setup


@dataclass(frozen=True)
class Landing:
    """The landing of an executed program at the visits that both programs reach.

    Attributes:
        visit: Index of the visit, (k,).
        wanted: TCP that the original program asks for, (k, 3) [m] in the arm base.
        landed: TCP where the executed program really lands, (k, 3), without noise.
    """

    visit: Ints
    wanted: Floats
    landed: Floats

    @property
    def error(self) -> Floats:
        """Landed minus wanted, (k, 3) [m]."""
        return np.asarray(self.landed - self.wanted)


def land(
    arm: VirtualArm, setup: Setup, original: Visits, executed: Visits | None = None
) -> Landing:
    """Run a program and compare it with what the original asks for, visit by visit.

    Args:
        arm: The arm that runs it.
        setup: Its cell.
        original: The program as it came from the drawing.
        executed: The compensated program; default the original itself.

    Raises:
        PostprocError: The two programs do not have the same visits.
    """
    asked = run_program(arm, setup, original)
    if executed is None or executed is original:
        done = asked
    else:
        if len(executed) != len(original):
            raise PostprocError(
                f"the executed program makes {len(executed)} visits, the original "
                f"{len(original)}: they are not two versions of one program"
            )
        done = run_program(arm, setup, executed)
    visit, here, there = np.intersect1d(asked.visit, done.visit, return_indices=True)
    wanted = arm.nominal_tcp(asked.arrivals)[here]
    landed = arm.tcp(done.arrivals)[there]
    return Landing(visit, wanted, landed)
