"""A second opinion on every program of a compensated tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any

from postproc.batch.plan import BatchPlan, JobSetup, Unit
from postproc.batch.tree import scan
from postproc.compensation.findings.second_opinion import second_opinion
from postproc.compensation.options import Options
from postproc.compensation.output.sidecar import (
    SUFFIX,
    FileRecord,
    Sidecar,
    read_sidecar,
    restore,
    sidecar_path,
)
from postproc.compensation.program import prepare_cell
from postproc.exceptions import PostprocError
from postproc.files import read_input
from postproc.language.languages import file_named
from postproc.verify.extra import require
from postproc.verify.opinion import ENOUGH, Allowance, Opinion


@dataclass(frozen=True)
class TreeOpinion:
    """What the second opinion says of a tree.

    Attributes:
        opinion: One table of all programs.
        programs: How many were judged.
        skipped: Programs that were not judged, and why.
    """

    opinion: Opinion
    programs: int
    skipped: tuple[tuple[str, str], ...]

    @property
    def exit_code(self) -> int:
        """Return 1 where a difference is beyond its bound."""
        return 0 if self.opinion.agrees else 1

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        skipped = [{"place": place, "why": why} for place, why in self.skipped]
        told = self.opinion.to_dict() | {"programs": self.programs, "skipped": skipped}
        keys = "programs", "agrees", "seconds", "rows", "skipped"
        return {key: told[key] for key in keys}


def judge_tree(folder: Path, plan: BatchPlan) -> TreeOpinion:
    """Judge all programs of a tree, each with its pages.

    Args:
        folder: The tree.
        plan: Cells and models of its programs.

    Raises:
        PostprocError: A library is not installed, or a folder cannot be read.
    """
    require()
    opinions: list[Opinion] = []
    skipped, left = [], ENOUGH
    with TemporaryDirectory(prefix="postproc-") as place:
        _restore_sources(folder, Path(place))
        for unit in sorted(scan(Path(place), plan).units, key=lambda u: u.program):
            setup = plan.setups[unit.setup]
            try:
                opinions.append(_judge_program(folder, Path(place), unit, setup, left))
                left = left.less(opinions[-1])
            except PostprocError as exc:
                skipped.append((unit.program, str(exc)))
    table = Opinion.join(str(folder), opinions)
    return TreeOpinion(table, len(opinions), tuple(skipped))


def _restore_sources(folder: Path, target: Path) -> None:
    """Write the sources of a tree, and all else as it is; what cannot be is absent."""
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        if path.name.endswith(SUFFIX) or path.is_symlink():
            continue
        place = target / path.relative_to(folder)
        place.parent.mkdir(parents=True, exist_ok=True)
        record = _records(path).get(path.name)
        if record is None:
            copyfile(path, place)
            continue
        try:
            place.write_bytes(restore(read_input(path), record, path.name))
        except PostprocError:
            continue  # `check` says so: it was changed


def _records(path: Path) -> Mapping[str, FileRecord]:
    """Return the records beside a file that tell of it: its own, its program's."""
    found: dict[str, FileRecord] = {}
    program = Path(file_named(path).program)  # whose record tells of variables too
    for other in (path, program, program.with_suffix(program.suffix.upper())):
        record = sidecar_path(other)
        if record.is_file():
            try:
                found |= read_sidecar(record).files
            except PostprocError:
                continue
    return found


def _judge_program(
    folder: Path, sources: Path, unit: Unit, setup: JobSetup, left: Allowance
) -> Opinion:
    """Judge one program with its pages.

    Raises:
        PostprocError: It has no record or one of another model, or cannot be read.
    """
    record = _record(folder, unit)
    if record.model != setup.model.id:
        problem = f"it was made with model {record.model}, not with {setup.model.id}"
        raise PostprocError(problem)
    source, output = dict(_files(sources, unit)), dict(_files(folder, unit))
    names = ("assume_motion", "strict_calls")  # now, and in records of before 0.2
    assumed = any(record.options.get(name) for name in names)
    own = Options(assume_motion=assumed)
    cell = prepare_cell(setup.cell, setup.model, own)
    return second_opinion(source, output, cell, record, left)


def _record(folder: Path, unit: Unit) -> Sidecar:
    """Join the record of a program and those of its pages.

    Raises:
        ProgramError: It has none.
    """
    main = read_sidecar(sidecar_path(folder / unit.program))
    files = dict(main.files)
    for page in unit.pages:
        path = sidecar_path(folder / page)
        files |= read_sidecar(path).files if path.is_file() else {}
    return replace(main, files=files)


def _files(root: Path, unit: Unit) -> Iterator[tuple[str, bytes]]:
    """Read the files of a program, the program first, its variable file last.

    Raises:
        ProgramError: One cannot be read.
    """
    for place in unit.programs:
        yield Path(place).name, read_input(root / place)
    for place in unit.reads:
        name = file_named(place).name_for(PurePosixPath(unit.program))
        yield name, read_input(root / place)
    if unit.variables is not None:
        name = file_named(Path(unit.program).name).variables
        yield name, read_input(root / unit.variables)
