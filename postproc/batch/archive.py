"""What a cell file lacks that the archive of its controller gives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.language.language import Archive
from postproc.robot.cell import Cell
from postproc.robot.pose import record_from_pose

NEAR = 1e-3  # [mm] and [deg]; frames that are nearer are the same
NO_SHIFT = (0.0,) * 6


def missing_in_cell(archive: Archive, cell: Cell) -> list[str]:
    """Return what an archive gives, and lines to paste into the cell file.

    Args:
        archive: What its lists say.
        cell: The cell of its programs.
    """
    given = [
        f"{plural} {', '.join(map(str, numbers))}"
        for plural, numbers in archive.entries.items()
        if numbers
    ]
    found = [f"{archive.place} gives {'; '.join(given) or 'no frames and no loads'}"]
    lines = list(_lines(archive, cell))
    if lines:
        found.append(f"{cell.path} lacks what no program shows. Paste, and check:")
        found += [f"    {line}" for line in lines]
    return found


def _lines(archive: Archive, cell: Cell) -> Iterator[str]:
    """Yield lines for the cell file."""
    file = cell.file
    if "absolute_accuracy" not in file.robot.model_fields_set:
        yield "absolute_accuracy = false   # under [robot], if it is off on this arm"
    base = record_from_pose(cell.base.pose[None])[0] if archive.root else NO_SHIFT
    apart = np.abs(np.subtract(archive.root or NO_SHIFT, base))
    if apart.max() > NEAR:
        numbers = [round(v, 4) for v in archive.root]
        yield "[base]   # of the arm, by the archive"
        yield f"xyz_mm = {numbers[:3]}"
        yield f"euler_zyz_deg = {numbers[3:]}"
    if file.home is None and archive.home:
        yield "[home]   # by the archive"
        yield f"joints_deg = {list(archive.home)}"
    if file.payload is None and archive.load:
        mass, *centre = archive.load
        yield "[payload]   # the first of the archive; that of the survey belongs here"
        yield f"mass_kg = {mass:g}"
        yield f"com_mm = {centre}"
    yield from _axes(archive, cell)


def _axes(archive: Archive, cell: Cell) -> Iterator[str]:
    """Yield lines for the external axes that the cell does not declare."""
    missing = {k: name for k, name in archive.external.items() if k not in cell.aux}
    if missing:
        head = "# under [aux]:" if cell.aux else "[aux]   #"
        yield f"{head} {len(missing)} external axes: gun, track or positioner"
    for axis, name in missing.items():
        yield f'{axis} = "track"' + (f"   # {name}" if name else "")
