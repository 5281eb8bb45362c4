"""Settings of a RobotWare backup: entries of its files, the arm that a task moves."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from postproc.files import read_if_readable

SETTINGS, MOTION, SYSTEM = "syspar", "moc.cfg", "sys.cfg"
CONTENTS = ("backinfo", "backinfo.txt")
DEPTH = 4  # folders above a program in which the settings of its backup may lie
READ_BEFORE = 4096  # folders and backups of which the settings are known
UNKNOWN = -1  # the number of an arm of which nobody can tell which it is
Entry = Mapping[str, str]
_ENTRY = re.compile(r'-(\w+)(?:\s+("[^"]*"|(?!-[A-Za-z_])[^\s\\]+))?')
_TASK = re.compile(r"^>>(\w+): *\(([^,)\r\n]*)", re.MULTILINE)
_NUMBER = re.compile(r"ROB_(\d+)", re.IGNORECASE)


@dataclass(frozen=True)
class TaskArm:
    """The arm that the task of a program moves.

    Attributes:
        arms: Names of all arms of the backup; none where there is no backup.
        number: Which of them it is, from 1; 0 where there is one at most, or the task
            moves none, and `UNKNOWN`.
        task: The task.
    """

    arms: tuple[str, ...] = ()
    number: int = 0
    task: str = ""


def find_settings(places: Iterable[Path]) -> Path | None:
    """Find ``MOC.cfg`` in the first of some folders that is a backup."""
    folders = filter(None, (_entry(place, SETTINGS) for place in places))
    files = filter(None, (_entry(folder, MOTION) for folder in folders))
    return next(filter(Path.is_file, files), None)


def settings_above(program: Path) -> Path | None:
    """Find ``MOC.cfg`` of the backup that a program stands in."""
    return find_settings([*program.absolute().parents][:DEPTH])


def list_entries(text: str, kind: str) -> list[dict[str, str]]:
    r"""Return the entries of one kind, each with what it says, by keys in lower case.

    >>> list_entries('TASKS:\n -Name "a" -Moves \n -Name "b" -X -1.5\n#', "TASKS")
    [{'name': 'a', 'moves': ''}, {'name': 'b', 'x': '-1.5'}]
    """
    body = re.split(rf"^{kind}:", text, maxsplit=1, flags=re.MULTILINE)
    own = re.split(r"^#", body[-1], maxsplit=1, flags=re.MULTILINE)[0]
    parts = re.split(r"(?=-name\s)", own, flags=re.I)[1:] if len(body) > 1 else []
    return [
        {key.lower(): value.strip('"') for key, value in _ENTRY.findall(part)}
        for part in parts
    ]


def number_arms(robots: Iterable[Entry]) -> list[Entry]:
    """Return the entries of arms in the order of their numbers.

    ``ROB_1`` is the first, wherever it stands; other names count as they stand.
    """
    found = list(robots)
    numbers = [_NUMBER.fullmatch(one["name"]) for one in found]
    if not all(numbers):
        return found
    return sorted(found, key=lambda one: int(one["name"].rpartition("_")[2]))


def arm_of_task(program: Path) -> TaskArm:
    """Tell which arm of a backup the task of a program moves.

    ``backinfo.txt`` names the task of a folder, ``SYS.cfg`` the group of units of a
    task and the arm of that, and ``MOC.cfg`` all arms.
    """
    motion = settings_above(program)
    if motion is None:
        return TaskArm()
    root = motion.parent.parent
    folder = [part.lower() for part in program.absolute().relative_to(root).parts]
    system, contents = _entry(motion.parent, SYSTEM), _entry(root, CONTENTS[0])
    contents = None if contents is None else _entry(contents, CONTENTS[1])
    versions = (_version(file) for file in (motion, system, contents))
    own = folder[1] if folder[0] == "rapid" and len(folder) > 2 else ""
    return _find_arm(own, *versions)


Version = tuple[Path | None, int, int]


def _version(file: Path | None) -> Version:
    """Return a file, and what tells it from what it was before."""
    if file is None:
        return None, 0, 0
    status = file.stat()
    return file, status.st_mtime_ns, status.st_size


@lru_cache(READ_BEFORE)
def _find_arm(
    folder: str, motion: Version, system: Version, contents: Version
) -> TaskArm:
    """Tell which arm the task in a folder moves."""
    robots = number_arms(list_entries(_text(motion), "ROBOT"))
    arms = tuple(one["name"] for one in robots)
    tasks = {key.lower(): name for key, name in _TASK.findall(_text(contents))}
    task = tasks.get(folder, folder) if folder else ""
    if len(arms) < 2:
        return TaskArm(arms, 0, task)
    return TaskArm(arms, _number(_text(system), task, arms), task)


def _number(text: str, task: str, arms: tuple[str, ...]) -> int:
    """Return the number of the arm that a task moves, as ``SYS.cfg`` tells it."""
    own = _find_named(list_entries(text, "CAB_TASKS"), task)
    group = own.get("usemechanicalunitgroup", "")
    if own and not group and "motiontask" not in own:
        return 0
    units = _find_named(list_entries(text, "MECHANICAL_UNIT_GROUP"), group)
    names, robot = [name.lower() for name in arms], units.get("robot", "").lower()
    return 1 + names.index(robot) if robot in names else UNKNOWN


def _find_named(entries: Iterable[Entry], name: str) -> Entry:
    """Return the entry of a name, an empty one where there is none."""
    found = (one for one in entries if name and one["name"].lower() == name.lower())
    return next(found, {})


def _text(version: Version) -> str:
    file, _, _ = version
    return "" if file is None else read_if_readable(file).decode("latin-1")


def _entry(folder: Path, name: str) -> Path | None:
    """Find an entry of a folder, whatever its case."""
    try:
        return _list_entries(folder, folder.stat().st_mtime_ns).get(name)
    except OSError:
        return None


@lru_cache(READ_BEFORE)
def _list_entries(folder: Path, changed: int) -> dict[str, Path]:
    """Return the entries of a folder by their names in lower case, as it is now."""
    return {path.name.lower(): path for path in folder.iterdir()}
