"""A robot takes another one's place: its programs, compensated for the new arm."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Outcome
from postproc.compensation.output.sidecar import file_sha256, restore_file
from postproc.exceptions import PostprocError, RecordError
from postproc.record.database import Record
from postproc.record.life import Life
from postproc.record.robots import Release, note_releases
from postproc.record.rows import ProgramRow
from postproc.record.stale import newest


@dataclass(frozen=True)
class ReplacedProgram:
    """A program of the old robot, as the new one gets it.

    Attributes:
        row: As it was released for the old robot.
        files: What was written for the new one.
        uncorrected: Targets that keep their values: why, and how many each.
        why: Why nothing was written, "" where it was.
    """

    row: ProgramRow
    files: tuple[Path, ...] = ()
    uncorrected: tuple[tuple[str, int], ...] = ()
    why: str = ""


def replace_robot(
    record: Record, old: str, new: str, folder: Path
) -> list[ReplacedProgram]:
    """Compensate the programs of one robot for another that takes its place.

    What a program says without any compensation is its original, or what the record
    beside the compensated one gives back.

    Args:
        record: The record.
        old: Serial number of the robot that goes.
        new: .. and of the one that comes.
        folder: Where the programs go, as they lay.

    Raises:
        RecordError: A robot is not there, or has no model.
    """
    before, after = Life.of(record, old), Life.of(record, new)
    if before.robot.state != "in use":
        problem = f"{old} is {before.robot.state} already"
        raise RecordError(record.path, problem, "Name the robot that stands there now")
    done = [
        _replace(record, row, after, folder)
        for row in newest(record.rows(ProgramRow, old))
    ]
    with record.writing():
        record.set_state(before.robot, state=f"replaced by {new}")
    return done


def _replace(
    record: Record, row: ProgramRow, life: Life, folder: Path
) -> ReplacedProgram:
    home = record.path.parent
    cell, model = life.cell(), life.model(life.current)
    try:
        with tempfile.TemporaryDirectory() as spare:
            nominal = _find_nominal(home / row.path, home / row.output, Path(spare))
            outcome = compensate(nominal, cell, model)
        place = folder / Path(row.output).name
        folder.mkdir(parents=True, exist_ok=True)
        files = outcome.save(folder)
        release = Release(
            life.robot.serial, home / row.path, place, model.id, file_sha256(place)
        )
        note_releases(record, [release])
    except (PostprocError, OSError) as exc:
        return ReplacedProgram(row, why=str(exc))
    return ReplacedProgram(row, tuple(files), _count_uncorrected(outcome))


def _find_nominal(original: Path, output: Path, spare: Path) -> Path:
    """Return a program without compensation: its original, or what its record gives."""
    if original.exists():
        return original
    return restore_file(output, spare / output.name)[0]


def _count_uncorrected(outcome: Outcome) -> tuple[tuple[str, int], ...]:
    """Count targets that keep their values by why."""
    found = dict[str, int]()
    told = outcome.decisions
    for row in outcome.list_uncorrected_rows():
        code = str(told.reasons[int(told.why[row])].code)
        found[code] = found.get(code, 0) + 1
    return tuple(sorted(found.items()))
