"""A RobotWare backup: the system modules of a task, and where the arm stands."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import ProgramError
from postproc.files import FolderListing, read_input
from postproc.language.language import Archive
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.pose_encoding import RAPID_DIALECT
from postproc.language.rapid.program import read_rapid
from postproc.language.rapid.settings import (
    find_settings,
    list_entries,
    number_arms,
    settings_above,
)
from postproc.language.text.source import source_from_bytes
from postproc.robot.pose import record_from_pose

PROGRAMS, SYSTEM = "progmod", "sysmod"  # folders of a task
ARM_AXES = 6
READ_BEFORE = 4096  # modules of which is known whether they can be read
_PLACE = tuple(f"base_frame_pos_{axis}" for axis in "xyz")
_TURN = tuple(f"base_frame_orient_u{k}" for k in range(4))


@dataclass(frozen=True)
class MountedArm:
    """An arm as ``MOC.cfg`` describes it.

    Attributes:
        name: Of the mechanical unit.
        kind: Its robot type.
        position: Of its base in the world [mm].
        quaternion: Its orientation there, scalar first.
    """

    name: str
    kind: str
    position: tuple[float, ...]
    quaternion: tuple[float, ...]

    @property
    def pose(self) -> Floats:
        """Return where the arm stands in the world, (4, 4) [m]."""
        numbers = (*self.position, *self.quaternion)
        pose: Floats = RAPID_DIALECT.poses(np.array([numbers]))[0]
        return pose


def system_modules(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return the system modules of the task of a program in a backup.

    They are read and never rewritten. What is no module that can be read is left out.
    """
    task = _task_of(program)
    return () if task is None else _modules(task, (SYSTEM,), listing)


def modules_beside(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return the modules of all other tasks of the backup that a program stands in.

    They run at the same time, and may change data that several tasks declare.
    """
    own = _task_of(program)
    tasks = () if own is None else listing.entries(own.parent)
    folders = (task for task in tasks if task.is_dir() and task != own)
    found = (_modules(task, (PROGRAMS, SYSTEM), listing) for task in folders)
    return tuple(itertools.chain.from_iterable(found))


def _task_of(program: Path) -> Path | None:
    """Return the folder of the task that a program belongs to, None for no backup."""
    folder = program.absolute().parent
    in_task = folder.name.lower() == PROGRAMS and folder.parent.is_dir()
    return folder.parent if in_task else None


def _modules(
    task: Path, names: Iterable[str], listing: FolderListing
) -> tuple[Path, ...]:
    """Return the modules in some folders of a task that can be read."""
    folders = filter(None, (listing.named(task, name) for name in names))
    every = (
        path
        for folder in folders
        for path in listing.ending(folder, RapidFileName.programs)
    )
    stats = ((path, path.stat()) for path in every)  # system modules may be encoded
    return tuple(p for p, at in stats if _is_text(p, at.st_mtime_ns, at.st_size))


def read_mounted_arms(program: Path) -> tuple[MountedArm, ...]:
    """Return the arms of the backup that a program stands in, none where none is."""
    file = settings_above(program)
    return () if file is None else read_arms(file.read_text(encoding="latin-1"))


def read_arms(text: str) -> tuple[MountedArm, ...]:
    """Read the arms of ``MOC.cfg``, by their numbers."""
    arms = []
    for said in number_arms(list_entries(text, "ROBOT")):
        try:
            place = tuple(1000.0 * float(said.get(key) or 0.0) for key in _PLACE)
            turn = tuple(float(said.get(k) or k == _TURN[0]) for k in _TURN)
        except ValueError:
            continue
        kind = said.get("use_robot_type", "")
        arms.append(MountedArm(said["name"], kind, place, turn))
    return tuple(arms)


def read_axes(text: str) -> dict[int, str]:
    """Read the external axes of ``MOC.cfg``: their numbers, and the units they move.

    ``SINGLE`` names them; ``JOINT`` gives their logical axes, of which the seventh is
    the first external one. Those that it does not give are counted in their order.
    """
    joints = {
        one["name"]: one.get("logical_axis", "") for one in list_entries(text, "JOINT")
    }
    found: dict[int, str] = {}
    for unit in list_entries(text, "SINGLE"):
        logical = joints.get(unit.get("use_joint", ""), "")
        axis = int(logical) - ARM_AXES if logical.isdigit() else 0
        if axis < 1 or axis in found:
            axis = next(k for k in itertools.count(1) if k not in found)
        found[axis] = unit["name"]
    return dict(sorted(found.items()))


@lru_cache(maxsize=READ_BEFORE)
def _is_text(path: Path, changed: int, size: int) -> bool:
    """Read a module, as it is at a time, to see whether it can be read."""
    try:
        data = read_input(path)
        read_rapid(source_from_bytes(path.name, data))
    except ProgramError:
        return False
    return True


def read_backup(folder: Path) -> Archive | None:
    """Read what ``MOC.cfg`` of a backup gives, None without a backup.

    That is where it places its arm, and the external axes.

    The backup is the folder, or lies in it. Of several arms no place is given.
    """
    inside = folder.iterdir() if folder.is_dir() else ()
    file = find_settings((folder, *sorted(p for p in inside if p.is_dir())))
    if file is None:
        return None
    text, base = file.read_text(encoding="latin-1"), tuple[float, ...]()
    arms = read_arms(text)
    if len(arms) == 1:
        base = tuple(record_from_pose(arms[0].pose[None])[0].tolist())
    shown = file.relative_to(folder).as_posix()
    kinds = {"arms": tuple(range(1, len(arms) + 1))}
    return Archive(shown, kinds, (), (), base, read_axes(text))
