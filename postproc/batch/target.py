"""The target tree: what is written to it, and what must not stay in it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from postproc.batch.task import Unit
from postproc.compensation.record import SUFFIX, file_sha256, sha256
from postproc.exceptions import OutputError
from postproc.files import disk_error, replace_file, write_all


@dataclass(frozen=True)
class Target:
    """A tree that mirrors a source tree; paths below it are written with ``/``."""

    root: Path

    def write(self, outputs: Mapping[str, bytes]) -> dict[str, str]:
        """Write files, none before all are on the disk.

        Returns:
            Their SHA-256 by path.

        Raises:
            OutputError: They cannot be written.
        """
        for place in outputs:
            self._make_folder(place)
        write_all({self.root / place: data for place, data in outputs.items()})
        return {place: sha256(data) for place, data in outputs.items()}

    def copy(self, source: Path, place: str) -> dict[str, str]:
        """Copy a file with its times and rights.

        Returns:
            Its SHA-256 by path.

        Raises:
            OutputError: It cannot be read or written.
        """
        self._make_folder(place)
        try:
            with source.open("rb") as data, replace_file(self.root / place) as out:
                shutil.copyfileobj(data, out, 1 << 20)
            shutil.copystat(source, self.root / place)
        except OSError as exc:
            read = exc.filename == str(source)
            raise disk_error(exc, source if read else self.root / place) from None
        return {place: file_hash(self.root / place)}

    def holds(self, outputs: Mapping[str, str]) -> bool:
        """Tell whether files lie in the tree with the contents that they had."""
        try:
            return bool(outputs) and all(
                file_hash(self.root / place) == digest
                for place, digest in outputs.items()
            )
        except OSError:
            return False

    def remove(self, places: Iterable[str]) -> list[str]:
        """Remove files, and return those that were there.

        Raises:
            OutputError: One cannot be removed.
        """
        removed = []
        for place in places:
            try:
                (self.root / place).unlink()
            except (FileNotFoundError, NotADirectoryError):
                continue
            except OSError as exc:
                problem = f"cannot be removed ({exc.strerror})"
                cure = "Remove it: it is no output of this run"
                raise OutputError(self.root / place, problem, cure) from None
            removed.append(place)
        return removed

    def remove_untouched(self, outputs: Mapping[str, str]) -> list[str]:
        """Remove files of an earlier run that nobody has changed since."""
        same = {p: d for p, d in outputs.items() if self.holds({p: d})}
        return self.remove(same)

    def _make_folder(self, place: str) -> None:
        try:
            (self.root / place).parent.mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            raise disk_error(exc, (self.root / place).parent) from None


def places_of(unit: Unit) -> tuple[str, ...]:
    """Name all that a unit may have in the target tree."""
    return (*unit.files, *(program + SUFFIX for program in unit.programs))


def file_hash(path: str | Path) -> str:
    """Hash a file's content.

    Raises:
        OSError: It cannot be read, or is no regular file.
    """
    if os.path.islink(path):
        raise OSError(f"{path} is a symbolic link")
    return file_sha256(path)
