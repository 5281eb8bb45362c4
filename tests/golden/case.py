"""What a case is, and the files it starts with."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
OUTPUTS = ("out", "back")  # folders that every case has


@dataclass(frozen=True)
class Case:
    """Commands run one after the other in a folder.

    Attributes:
        name: Name, unique among all.
        commands: Command lines behind `postproc`; `< FILE` gives one its stdin.
        files: What lies in the folder at first: place -> kept input.
        texts: The same, written out.
        quick: Belongs to the set that the tests run.
        fitted: A model is made: all its numbers are compared as numbers, ids are not.
    """

    name: str
    commands: tuple[str, ...]
    files: Mapping[str, str] = field(default_factory=dict)
    texts: Mapping[str, bytes] = field(default_factory=dict)
    quick: bool = False
    fitted: bool = False

    def stage(self, folder: Path) -> dict[str, bytes]:
        """Write the files it starts with, and return them; make folders to write to."""
        for place in OUTPUTS:
            (folder / place).mkdir()
        files = {place: kept()[name] for place, name in self.files.items()}
        files |= self.texts
        for place, data in files.items():
            path = folder / place
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return files


@cache
def kept() -> Mapping[str, bytes]:
    """Return all inputs by name: those of the archives, and the shipped programs."""
    found = {}
    for path in sorted(HERE.glob("inputs*.zip")):
        with zipfile.ZipFile(path) as archive:
            found |= {name: archive.read(name) for name in archive.namelist()}
    for path in sorted((ROOT / "programs").iterdir()):
        if path.suffix in (".pdl", ".lsv", ".toml"):
            found[f"programs/{path.name}"] = path.read_bytes()
    return found


def below(folder: str) -> dict[str, str]:
    """Return the inputs in a folder: place in it -> name."""
    start = f"{folder}/"
    return {n.removeprefix(start): n for n in kept() if n.startswith(start)}


def folders(above: str) -> list[str]:
    """Return the names of the folders right below one."""
    start = f"{above}/"
    found = {n.removeprefix(start).split("/")[0] for n in kept() if n.startswith(start)}
    return sorted(found)
