"""Files of RAPID: modules of a task, and what a backup holds beside it."""

from __future__ import annotations

import re
from pathlib import Path, PurePath
from typing import ClassVar

from postproc.exceptions import ProgramError
from postproc.files import FolderListing, read_if_readable
from postproc.language.file_name import FileName, Named, Skip
from postproc.language.measuring_program import is_measuring_program
from postproc.language.rapid.settings import UNKNOWN, arm_of_task

SYSTEM_MODULES, SYSTEM_SUFFIXES = "SYSMOD/", (".sys", ".sysx")
OTHER_TASKS, OTHER_MODULES = "TASKS/", "MODULES/"
_MAIN = re.compile(
    rb"^[ \t]*(?:LOCAL[ \t]+)?PROC[ \t]+main[ \t]*\(", re.IGNORECASE | re.MULTILINE
)


class RapidFileName(FileName):
    """A file by its name, as RAPID takes it: every module belongs to those beside it.

    Files that a job has from elsewhere have names with a folder: system modules of a
    backup, modules of other tasks, and modules beside it that do not belong to it.
    """

    programs: ClassVar = (".mod", ".modx", ".prg", *SYSTEM_SUFFIXES)

    @property
    def is_from_elsewhere(self) -> bool:
        """Tell by the folder that its name begins with."""
        return self.place.startswith((SYSTEM_MODULES, OTHER_TASKS, OTHER_MODULES))

    @property
    def is_apart(self) -> bool:
        """Tell whether it is read for what it changes, and is no part of the task.

        >>> RapidFileName("MODULES/job.mod").is_apart
        True
        """
        return self.place.startswith((OTHER_TASKS, OTHER_MODULES))

    @property
    def is_named_as_system(self) -> bool:
        """Tell whether it is a system module by its place or its suffix.

        >>> RapidFileName("SYSMOD/a.mod").is_named_as_system
        True
        >>> RapidFileName("BASE.SYS").is_named_as_system
        True
        >>> RapidFileName("job.mod").is_named_as_system
        False
        """
        return self.place.startswith(SYSTEM_MODULES) or self.suffix in SYSTEM_SUFFIXES

    @property
    def task_beside(self) -> str:
        """Return the other task that a file of a job belongs to, "" for its own.

        >>> RapidFileName("TASKS/TASK2/PROGMOD/plc.mod").task_beside
        'TASK2'
        >>> RapidFileName("SYSMOD/user.sys").task_beside
        ''
        """
        other = self.place.startswith(OTHER_TASKS)
        return self.place.split("/")[1] if other else ""

    @property
    def job(self) -> str:
        """Return its folder: the modules of a task are one job."""
        return self.place.rpartition("/")[0]

    def find_named(
        self, text: bytes, skip: Skip, listing: FolderListing
    ) -> tuple[Named, Named]:
        """Name all modules beside the one with the main routine of a task.

        A survey is a task by itself, wherever it stands.
        """
        found = _MAIN.search(text)
        if found is None or is_measuring_program(text):
            return {}, {}
        line = text.count(b"\n", 0, found.start()) + 1
        place = Path(self.place)
        modules = listing.once(place.parent, _list_parts)
        beside = (one for one in modules if one.name != place.name and not skip(one))
        return {RapidFileName(other.name).key: line for other in beside}, {}

    def name_for(self, program: PurePath) -> str:
        """Return its name in a job, with the folder of a backup that it is from.

        >>> job = PurePath("RAPID/TASK1/PROGMOD/job.mod")
        >>> RapidFileName("RAPID/TASK1/SYSMOD/user.sys").name_for(job)
        'SYSMOD/user.sys'
        >>> RapidFileName("RAPID/TASK2/PROGMOD/plc.mod").name_for(job)
        'TASKS/TASK2/PROGMOD/plc.mod'
        >>> RapidFileName("RAPID/TASK1/PROGMOD/set.mod").name_for(job)
        'MODULES/set.mod'
        """
        path = PurePath(self.place)
        if path.parent.parent != program.parent.parent:
            return OTHER_TASKS + "/".join(path.parts[-3:])
        if path.parent == program.parent:
            return f"{OTHER_MODULES}{path.name}"
        return f"{SYSTEM_MODULES}{path.name}"

    def arm(self, head: bytes) -> int:
        """Return the arm of a backup that the task of the module moves.

        It is 0 where there is one arm at most, -1 where it is one of several and not
        known which.
        """
        return arm_of_task(Path(self.place)).number

    def refuse_other_arm(self, arm: int, cell: str) -> None:
        """Refuse a module of a backup whose task moves another arm than the cell's.

        Raises:
            ProgramError: It does, or it is not known which of several it moves.
        """
        found = arm_of_task(Path(self.place))
        if found.number in (0, arm):
            return
        if found.number == UNKNOWN:
            names = ", ".join(found.arms)
            problem = f"its backup has the arms {names}: which it moves is not known"
            cure = (
                "Add SYSPAR/SYS.cfg and BACKINFO/backinfo.txt to the backup, or take "
                "the module out of it and give the cell of its arm"
            )
            raise ProgramError(self.name, problem, cure)
        name, number = found.arms[found.number - 1], found.number
        raise ProgramError(
            self.name,
            f"its task {found.task} moves {name}, arm {number} of its backup, and the "
            f"cell ({cell}) is of arm {arm}",
            f"Give the cell of that arm, with arm_number = {number} under [robot], and "
            "its model",
        )


FILES = RapidFileName


def _list_parts(folder: Path, listing: FolderListing) -> list[Path]:
    """List the modules of a folder that have no main routine of a task."""
    modules = listing.ending(folder, RapidFileName.programs)
    return [
        one for one in modules
        if not (one.is_symlink() or _MAIN.search(read_if_readable(one)))
    ]  # fmt: skip
