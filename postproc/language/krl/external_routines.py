"""Routines of KUKA's packages: which of them neither move the arm nor set frames."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

_LIST = Path(__file__).with_name("still_routines.txt")
AHEAD = "ahead"
ASSUMED = (
    "is not in the available files: it is on the list of routines known neither to "
    "move the arm nor to set frames (docs/routines.md). If it does, say so under "
    "[routines] in the cell file, or set assume_motion"
)


@cache
def package_routines() -> Mapping[str, str]:
    """Return the shipped list: lower-case names, and what stands behind them.

    >>> package_routines()["set_cd_params"], package_routines()["h50"]
    ('ahead', '')
    """
    lines = (line.partition("#")[0] for line in _LIST.read_text("ascii").splitlines())
    words = (line.split() for line in lines if line.strip())
    return {name: " ".join(rest) for name, *rest in words}
