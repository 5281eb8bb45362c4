"""What the archive of a controller gives, in no language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Archive:
    """What the archive of a controller gives.

    Attributes:
        place: Of the list of frames, below the folder that was asked for.
        entries: Numbers of what is set, by the plural that names it.
        load: The first load: mass [kg] and centre [mm], () for none.
        home: Joint angles of the home position [deg], () where there is none.
        root: Base of the arm as a position record, () where it is not known.
        external: Its external axes by number, and what the archive calls them, if
            anything.
    """

    place: str
    entries: Mapping[str, tuple[int, ...]]
    load: tuple[float, ...]
    home: tuple[float, ...]
    root: tuple[float, ...]
    external: Mapping[int, str]
