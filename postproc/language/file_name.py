"""What a file is to a language, by its name: a program, its values, its companions."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import ClassVar

from postproc.files import FolderListing, base_name, find_beside, read_if_readable

Named = dict[str, int]  # names of programs, and the lines that name them first
Skip = Callable[[Path], bool]  # files that belong to no program


@dataclass(frozen=True)
class FileName:
    """A file by its name, as one language takes it; files of no language are no part.

    Attributes:
        place: Its name, with folders or without.
        programs: Suffixes of programs, in lower case, the usual one first.
        variable_files: Suffix of files that hold the values of a program and share its
            record, "" where programs hold their values.
        data_lists: Suffix of lists that hold values of a program and have a record of
            their own, "" where there are none.
        background: Suffixes of programs that run beside the one that moves the arm.
        compiled: Suffixes of programs and variables as controllers load them.
    """

    place: str
    programs: ClassVar[tuple[str, ...]]
    variable_files: ClassVar[str] = ""
    data_lists: ClassVar[str] = ""
    background: ClassVar[tuple[str, ...]] = ()
    compiled: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def suffixes(cls) -> tuple[str, ...]:
        """Return the suffixes of all files of the language."""
        values = (cls.variable_files, cls.data_lists)
        return (*cls.programs, *filter(None, values), *cls.background, *cls.compiled)

    @property
    def suffix(self) -> str:
        """Return its suffix in lower case."""
        return os.path.splitext(self.place)[1].lower()

    @property
    def name(self) -> str:
        """Return its name without folders."""
        return self.place.replace("\\", "/").rpartition("/")[2]

    @property
    def is_program(self) -> bool:
        """Tell whether it is a program that may move the arm."""
        return self.suffix in self.programs

    @property
    def is_variables(self) -> bool:
        """Tell whether it is a variable file."""
        return self.suffix == self.variable_files != ""

    @property
    def is_data_list(self) -> bool:
        """Tell whether it may be the data list of a program, or is a system's."""
        return self.suffix == self.data_lists != ""

    @property
    def is_compiled(self) -> bool:
        """Tell whether it is a program or its variables as controllers load them."""
        return self.suffix in self.compiled

    @property
    def is_shared(self) -> bool:
        """Tell whether all programs of a controller read it: it is never written."""
        return False

    @property
    def is_from_elsewhere(self) -> bool:
        """Tell whether it is the name of a file that a job has from another folder."""
        return self.is_apart

    def is_system(self) -> bool:
        """Tell whether the file on the disk is one of the controller or a package."""
        return False

    @property
    def key(self) -> str:
        """Return what tells the programs of one folder apart, whatever their case."""
        return base_name(self.place) if self.variable_files else self.name.lower()

    @property
    def job(self) -> str:
        """Return what the files that are written together have in common."""
        return f"{self.place.rpartition('/')[0]}/{self.name.rpartition('.')[0]}"

    @property
    def variables(self) -> str:
        """Name the variable file of the program, "" where programs hold their values.

        What is no file of any language may have one as well.
        """
        if not self.variable_files:
            return ""
        return os.path.splitext(self.place)[0] + self.variable_files

    @property
    def data_list(self) -> str:
        """Name the data list of the program, "" where it has none."""
        if not (self.data_lists and self.is_program):
            return ""
        return os.path.splitext(self.place)[0] + self.data_lists

    @property
    def program(self) -> str:
        """Name the program that a file of values, or a compiled one, belongs to."""
        if self.is_program or not (self.variable_files or self.is_data_list):
            return self.place
        return os.path.splitext(self.place)[0] + self.programs[0]

    def find_variables(self) -> Path | None:
        """Find the variable file of the program: same base name, in any case."""
        return find_beside(Path(self.place), Path(self.variables).name)

    def find_values(self) -> Path | None:
        """Find the variable file or the data list of the program, likewise."""
        place = Path(self.place)
        return find_beside(place, Path(self.variables or self.data_list).name)

    def holds_targets(self, data: bytes) -> bool:
        """Tell whether the content of a variable file has positions."""
        return False

    def find_named(
        self, text: bytes, skip: Skip, listing: FolderListing
    ) -> tuple[Named, Named]:
        """Find the programs that a program or a data list names.

        Args:
            text: All of it.
            skip: Files beside it that belong to no program.
            listing: What its folder holds.

        Returns:
            Keys of programs of its folder, in order, each with the line that names it
            first; and likewise the names, as written, that lead out of the folder.
        """
        return {}, {}

    def arm(self, head: bytes) -> int:
        """Return the arm that a program says it is for, 0 where it says none.

        Args:
            head: Its first bytes.
        """
        return 0

    def refuse_other_arm(self, arm: int, cell: str) -> None:
        """Refuse a program on the disk that its archive gives to another arm.

        Args:
            arm: The number of the cell's arm.
            cell: The cell, for the message.

        Raises:
            ProgramError: It is another's, or one of several, and not known whose.
        """

    def name_for(self, program: PurePath) -> str:
        """Return its name in a job that reads it and never rewrites it.

        Args:
            program: The program of the job.
        """
        return PurePath(self.place).name

    @property
    def is_apart(self) -> bool:
        """Tell by its name in a job whether it is a program by itself.

        A job may read such a one for what it does to shared data.
        """
        return False


def list_led(program: FileName, listing: FolderListing) -> list[Path]:
    """List a program, those of its folder that it names, and those that these name.

    Args:
        program: A file, by its path.
        listing: What its folder holds.
    """
    folder = Path(program.place).absolute().parent
    found, waiting = dict[Path, None](), [Path(program.place).absolute()]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found[path] = None
            named, _ = type(program)(str(path)).find_named(
                read_if_readable(path), lambda _: False, listing
            )
            names = (k if k.endswith(program.programs) else k + program.programs[0]
                     for k in named)  # fmt: skip
            waiting += filter(None, (listing.named(folder, k) for k in names))
    return [*found]
