"""What ``$config.dat`` and ``$machine.dat`` of an archive give."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.exceptions import ProgramError
from postproc.files import read_input
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.values import KnownRecord
from postproc.language.krl.files import SHARED_LIST
from postproc.language.krl.pose_encoding import KRL_DIALECT
from postproc.language.krl.program import read_krl
from postproc.language.krl.symbols import AXES, OUTSIDE, KrlTask
from postproc.language.language import Archive
from postproc.language.text.source import source_from_bytes
from postproc.robot.pose import record_from_pose

MACHINE = "$machine.dat"
TABLES = {"tool_data": "tools", "base_data": "bases", "load_data": "loads"}
_PLACE = "XYZABC"
_ROOT = re.compile(rb"(?im)^[^;\r\n]*\$ROBROOT[ \t]*=[ \t]*(\{[^}\r\n]*\})")
_AXES = re.compile(rb"(?im)^[^;\r\n]*\$EX_AX_NUM[ \t]*=[ \t]*(\d+)")
_PART = re.compile(rb"\b([XYZABC])[ \t]+([-+]?[\d.]+(?:E[-+]?\d+)?)", re.IGNORECASE)


def read_archive(folder: Path) -> Archive | None:
    """Read the lists of a controller's archive, None where a folder is none."""
    lists = [p for p in folder.rglob("*.dat") if p.is_file() and p.name[0] == "$"]
    named = {path.name.lower(): path for path in sorted(lists, reverse=True)}
    found, machine = named.get(SHARED_LIST), named.get(MACHINE)
    if found is None:
        return None
    try:
        task = KrlTask([read_krl(source_from_bytes(found.name, read_input(found)))])
        text = b"" if machine is None else read_input(machine)
    except ProgramError:
        return None  # it is told where a program reads it
    axes = _AXES.search(text)
    external = min(int(axes[1]), len(OUTSIDE)) if axes else 0
    loads = [_numbers_of_load(one) for _, one in _entries(task, "load_data")]
    return Archive(
        found.relative_to(folder).as_posix(),
        {
            plural: tuple(k for k, _ in _entries(task, table))
            for table, plural in TABLES.items()
        },
        next(iter(loads), ()),
        _home(task),
        _root(text),
        dict.fromkeys(range(1, 1 + external), ""),
    )


def _list_values(task: KrlTask, name: str) -> Iterator[tuple[int, KnownRecord]]:
    """Yield what data of a name are given, entries of a table with their number."""
    here = Scope(0, task.files[0].name, "")
    for datum in task.files[0].data:
        if datum.name == name and datum.value is not None:
            value = task.value(datum.value, here.at(datum.row))
            if isinstance(value, KnownRecord):
                yield (*datum.index, 0)[0], value


def _entries(task: KrlTask, table: str) -> Iterator[tuple[int, KnownRecord]]:
    """Yield the entries of a table that are set."""
    for number, value in _list_values(task, table):
        given = any(abs(value.number(name.lower())) > 0.0 for name in _PLACE)
        if value.get("m") is not None:
            given = value.number("m") > 0.0
        if number and given:
            yield number, value


def _numbers_of_load(value: KnownRecord) -> tuple[float, ...]:
    """Return mass [kg] and centre [mm]; zero where the centre is not known."""
    centre = value.get("cm")
    if not isinstance(centre, KnownRecord):
        centre = KnownRecord(())
    own = np.array([centre.number(name) for name in ("x", "y", "z")])
    return (value.number("m"), *np.nan_to_num(own).tolist())


def _home(task: KrlTask) -> tuple[float, ...]:
    """Return the joint angles of XHOME [deg], () where there are none."""
    for _, value in _list_values(task, "xhome"):
        found = tuple(value.number(axis) for axis in AXES)
        return () if np.isnan(found).any() else found
    return ()


def _root(text: bytes) -> tuple[float, ...]:
    """Return ``$ROBROOT`` as a position record, () where it is not there."""
    found = _ROOT.search(text)
    if found is None:
        return ()
    parts = {p[1].decode().upper(): float(p[2]) for p in _PART.finditer(found[1])}
    if set(parts) != set(_PLACE):
        return ()
    pose = KRL_DIALECT.poses(np.array([*(parts[name] for name in _PLACE), 0.0, 0.0]))
    return tuple(record_from_pose(pose[None])[0].tolist())
