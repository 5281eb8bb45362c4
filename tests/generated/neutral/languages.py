"""The languages that drawn programs are written in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from postproc.robot.cell import Cell
from tests.generated.neutral import in_krl, in_pdl2, in_rapid, traits
from tests.generated.neutral.text import Printed
from tests.generated.neutral.traits import Traits
from tests.generated.neutral.tree import Program

Numbers = dict[int, list[float]]


@dataclass(frozen=True)
class Language:
    """One of them.

    Attributes:
        traits: What it cannot say, and how it runs.
        write: Writes a program.
        poses: What the numbers of literals say: poses [m], or joint angles [rad].
    """

    traits: Traits
    write: Callable[[Program, Cell], Printed]
    poses: Callable[[Numbers, Program], dict[int, np.ndarray]]


LANGUAGES = {
    "pdl2": Language(traits.PDL2, in_pdl2.pdl2, in_pdl2.poses),
    "rapid": Language(traits.RAPID, in_rapid.rapid, in_rapid.poses),
    "krl": Language(traits.KRL, in_krl.krl, in_krl.poses),
}
