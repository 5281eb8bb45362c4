"""A program that stands still at joint angles to be measured, in no language."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import ProgramError

SLOW = 200.0  # [mm/s] of the tool, where a move must say how fast it is
CORNER_MM = 5  # from a corner that is flown through, where a language says how far
SHARE = 20  # [%] of the speed of the axes, where the program says it once
GENTLY = 50  # [%] of their acceleration
NAME = 24  # letters that every controller takes
TITLE = "Laser-tracker survey of"  # begins the first comment
NEAR_ITS_BEGINNING = 200  # bytes in which the title stands


@dataclass(frozen=True)
class MountedProbe:
    """The probe point that is measured from here on is another one.

    Attributes:
        number: Of the probe point, from 1.
        xyz_mm: Where it is in the flange frame.
    """

    number: int
    xyz_mm: tuple[float, ...]


@dataclass(frozen=True)
class MeasuringMove:
    """A joint move to a stop.

    Attributes:
        joints_deg: Joint angles as the controller counts them.
        measured: Id under which the place is measured, "" where the arm goes on.
    """

    joints_deg: tuple[float, ...]
    measured: str = ""


@dataclass(frozen=True, eq=False)
class MeasuringLine:
    """A straight move of the mounted probe point at `SLOW`.

    Attributes:
        pose: Where it ends: the probe point, turned like the flange, in the world,
            (4, 4) [m].
        joints_deg: Joint angles at its end.
        slot: Their branch, 4 W + 2 S + E.
        flown: It goes on into the next line without a stop, within `CORNER_MM`.
    """

    pose: Floats
    joints_deg: tuple[float, ...]
    slot: int
    flown: bool = False

    @property
    def q(self) -> Floats:
        """Return the joint angles at its end, (1, 6) [rad]."""
        return np.deg2rad([self.joints_deg])


MeasuringStep = MountedProbe | MeasuringMove | MeasuringLine


@dataclass(frozen=True)
class MeasuringProgram:
    """What a survey does.

    Attributes:
        name: Of the program: letters, digits, ``_``.
        heading: Comments that it begins with.
        steps: What it does, one behind the other; first a probe point is mounted. A
            line begins where a joint move or a line ended.
        settle_s: How long it stands still to be measured [s].
        mass_kg: What the arm carries, NaN where that is not known.
        centre_mm: Centre of that mass in the flange frame.
    """

    name: str
    heading: tuple[str, ...]
    steps: tuple[MeasuringStep, ...]
    settle_s: float
    mass_kg: float
    centre_mm: tuple[float, ...]

    @property
    def probes(self) -> tuple[MountedProbe, ...]:
        """Return the probe points in their order."""
        return tuple(one for one in self.steps if isinstance(one, MountedProbe))

    @property
    def has_lines(self) -> bool:
        """Whether any of its moves is straight."""
        return any(isinstance(one, MeasuringLine) for one in self.steps)


def is_measuring_program(text: bytes) -> bool:
    """Tell whether a program is one of these: it is whole, and part of no job."""
    return TITLE.encode() in text[:NEAR_ITS_BEGINNING]


def name_of_file(stem: str) -> str:
    """Name a program like its file, in letters that every controller takes.

    >>> name_of_file("Survey 2"), name_of_file("20-poses"), name_of_file("Prüfung")
    ('Survey_2', 's20_poses', 'Pr_fung')
    """
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in stem)[:NAME]
    return name if name[:1].isalpha() else f"s{name}"[:NAME]


def refuse_other_name(program: MeasuringProgram, file: str, stem: str) -> None:
    """Refuse a program that cannot be named as its file, where it must be.

    Args:
        program: The program.
        file: Its file.
        stem: The file's name without suffix.

    Raises:
        ProgramError: They differ.
    """
    if program.name != stem:
        problem = f"the program in it must be called {stem!r}, which is no name"
        cure = f"Take letters, digits and _, at most {NAME}: {program.name}"
        raise ProgramError(file, problem, cure)


def number_list(numbers: tuple[float, ...], digits: int, separator: str = ",") -> str:
    """Write numbers with so many digits.

    >>> number_list((1.0, -2.5), 2)
    '1.00,-2.50'
    """
    return separator.join(f"{v:.{digits}f}" for v in numbers)
