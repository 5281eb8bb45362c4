"""Compensating files: which ones a program needs, and where the outputs go."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from postproc.arrays import Map
from postproc.batch.tree import group_pages, names_in, read_head
from postproc.compensation.compensate import compensate, name_files
from postproc.compensation.options import Options, Progress, silent
from postproc.compensation.outcome import Outcome
from postproc.compensation.parallel import map_with
from postproc.compensation.record import sidecar_path
from postproc.files import (
    STREAM,
    Content,
    base_name,
    check_places,
    is_program,
    is_variables,
    program_of,
    read_input,
    read_stream,
    variables_of,
    write_all,
)
from postproc.language.stamp import read_stamp
from postproc.language.visits import Diagnostic
from postproc.model.model import Model, load_model
from postproc.report.json import report_pieces
from postproc.robot.cell import Cell, load_cell

# The pages of a program on the disk: programs beside it that only it names.


@dataclass(frozen=True)
class Pages:
    """What belongs to a program.

    Attributes:
        paths: Its pages, in the order in which they are named.
        notes: What it names and what is not followed, and why.
    """

    paths: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()


def find_pages(program: Path) -> Pages:
    """Find the programs that IMPORT, CALL or EXPORTED FROM name, in the same folder.

    A program that others name too is theirs as well, and one with a variable file of
    its own is a program by itself: neither is followed. Earlier outputs and symbolic
    links do not count.
    """
    wanted, outside = names_in(program)
    notes = [f"{name!r} leads out of the folder: not followed" for name in outside]
    main = base_name(program.name)
    if not set(wanted) - {main} or not program.parent.is_dir():
        return Pages((), tuple(notes))
    files = [p for p in sorted(program.parent.iterdir()) if not p.is_symlink()]
    values = {base_name(p.name) for p in files if is_variables(p.name)}
    programs = {base_name(p.name): p for p in files if _is_source(p)} | {main: program}
    named = {base: _named(path, main) for base, path in programs.items()}
    alone = {
        base: [other for other in others if other not in values]
        for base, others in named.items()
    }
    pages = group_pages(alone).get(main, ())
    notes += _left_out(programs, named, (main, *pages), values)
    return Pages(tuple(programs[page] for page in pages), tuple(notes))


def _is_source(path: Path) -> bool:
    """Tell whether a file is a program, and no output of ours."""
    if not (is_program(path.name) and path.is_file()):
        return False
    return read_stamp(read_head(path)) is None


def _named(path: Path, main: str) -> list[str]:
    """List the programs that a program names, but for the main one."""
    return [name for name in names_in(path)[0] if name != main]


def _left_out(
    programs: Mapping[str, Path],
    named: Mapping[str, Sequence[str]],
    followed: Sequence[str],
    values: set[str],
) -> list[str]:
    """Say which programs are there and named, and not followed."""
    notes = []
    for other in dict.fromkeys(name for base in followed for name in named[base]):
        if other in followed or other not in programs:
            continue
        why = "it has a variable file of its own"
        if other not in values:
            users = [base for base in named if other in named[base] and base != other]
            why = f"{' and '.join(programs[user].name for user in users)} name it"
        notes.append(f"{programs[other].name} is not followed: {why}")
    return notes


# Compensating files: what is read, what is written, and in which order.


@dataclass(frozen=True)
class Job:
    """A program with all that its compensation needs.

    Attributes:
        path: The program, or None for standard input.
        name: The program's file name.
        source: Its bytes.
        variables: Path and bytes of its variable file, or None.
        pages: Paths and bytes of its pages.
        notes: What it names and is not followed.
        cell: The cell.
        model: The model.
        inputs: Every file that was read.
    """

    path: Path | None
    name: str
    source: bytes
    variables: tuple[Path, bytes] | None
    pages: tuple[tuple[Path, bytes], ...]
    notes: tuple[str, ...]
    cell: Cell
    model: Model
    inputs: tuple[Path, ...]

    @classmethod
    def open(
        cls, program: str, cell: Path, model: Path, lsv: Path | None = None
    ) -> Job:
        """Read a program, its variable file, the cell and the model.

        Args:
            program: A path, or ``-`` for standard input.
            cell: The cell file.
            model: The model file.
            lsv: The variable file; default: the one of the program's base name.

        Raises:
            PostprocError: A file cannot be read or used.
        """
        loaded = load_cell(cell)
        fitted = load_model(model)
        fitted.check_arm(loaded.arm, model)
        path = None if program == STREAM else Path(program)
        if path is None:
            name = program_of("stdin" if lsv is None else lsv.name)
            source = read_stream(sys.stdin.buffer, STREAM)
        else:
            name, source = path.name, read_input(path)
            lsv = lsv or find_variables(path)
        values = None if lsv is None else (lsv, read_input(lsv))
        found = Pages() if path is None else find_pages(path)
        pages = tuple((page, read_input(page)) for page in found.paths)
        given = (path, lsv, cell, model, *found.paths)
        inputs = tuple(p for p in given if p is not None)
        return cls(
            path, name, source, values, pages, found.notes, loaded, fitted, inputs
        )

    def run(
        self, options: Options, progress: Progress = silent, processes: int = 1
    ) -> Outcome:
        """Compensate the program, with so many processes at the most."""
        variables = None if self.variables is None else self.variables[1]
        outcome = compensate(
            self.source,
            self.cell,
            self.model,
            name=self.name,
            variables=variables,
            pages={page.name: data for page, data in self.pages},
            options=options,
            progress=progress,
            processes=processes,
        )
        left = (Diagnostic(self.name, 1, "not-followed", text) for text in self.notes)
        return replace(outcome, diagnostics=(*outcome.diagnostics, *left))

    def write(
        self,
        outcome: Outcome,
        output: Path | None = None,
        report: Path | None = None,
        html: Path | None = None,
        processes: int = 1,
    ) -> list[Path]:
        """Write the program, its variable file, the record and the reports.

        A program from standard input goes to standard output unless it is told where
        to; values that change go to a file in any case.

        Args:
            outcome: What came of the program.
            output: Where the program goes.
            report: Where the report goes, None for nowhere.
            html: Where the report for a browser goes.
            processes: How many may work at once on long texts.

        Returns:
            The files written.

        Raises:
            OutputError: The output is the input, or cannot be written.
        """
        check_places([output, report, html], self.inputs)
        each = map_with(processes)
        files: dict[Path, Content] = {}
        if report is not None and report != Path(STREAM):
            files[report] = map(str.encode, report_pieces(outcome, each))
        if html is not None:
            from postproc.report.html import program_report

            files[html] = program_report(outcome).encode()
        piped = self.path is None and output is None
        place = output or default_output(self._beside())
        files |= self._results(outcome, place, piped, each)
        check_places(files, self.inputs)
        write_all(files)
        if piped:
            sys.stdout.buffer.write(outcome.outputs[self.name])
            sys.stdout.buffer.flush()
        return list(files)

    def _beside(self) -> Path:
        """Name the file that outputs lie beside, unless the user says where."""
        if self.path is None and self.variables is not None:
            return self.variables[0].with_name(self.name)
        return self.path or Path(self.name)

    def _results(
        self, outcome: Outcome, target: Path, piped: bool, each: Map
    ) -> dict[Path, Content]:
        """Name what a compensation gives, the file that users wait for last.

        Args:
            outcome: The compensation.
            target: Where the program goes.
            piped: The program goes elsewhere; only values get a file.
            each: How pieces of long texts are made.
        """
        values = target.with_name(variables_of(target.name))
        files: dict[Path, Content] = {}
        for page, _ in reversed(self.pages):
            if page.name in outcome.outputs:
                place = _page_place(page, target)
                files |= _with_record(outcome, {page.name: place}, place, each)
        own = {
            name: target if name == self.name else values
            for name in reversed(list(outcome.outputs))
            if name not in {page.name for page, _ in self.pages}
            and not (piped and name == self.name)
        }
        main = values if piped else target
        return files | _with_record(outcome, own, main, each)


def _with_record(
    outcome: Outcome, places: Mapping[str, Path], main: Path, each: Map
) -> dict[Path, Content]:
    """Name the files of one program, behind the record that undoes them."""
    if not places:
        return {}
    names = {name: place.name for name, place in places.items()}
    record = map(str.encode, outcome.record.renamed(names).to_json(each))
    files = {place: outcome.outputs[name] for name, place in places.items()}
    return {sidecar_path(main): record, **files}


def _page_place(page: Path, target: Path) -> Path:
    """Name the output of a page: beside that of its program."""
    if target.parent.resolve() == page.parent.resolve():
        return default_output(page)
    return target.with_name(page.name)


def default_output(program: Path) -> Path:
    """Name the output of a program.

    >>> default_output(Path("cell/job.pdl")).name
    'job.compensated.pdl'
    """
    return program.with_name(f"{program.stem}.compensated{program.suffix}")


def find_variables(program: Path) -> Path | None:
    """Find the variable file of a program: same base name, in any case."""
    if not program.parent.is_dir():
        return None
    wanted = variables_of(program.name).lower()
    found = [p for p in program.parent.iterdir() if p.name.lower() == wanted]
    return min(found, default=None)


def read_files(program: Path, lsv: Path | None = None) -> dict[str, bytes]:
    """Read a program with its pages and its variable file, the program first.

    Raises:
        ProgramError: A file cannot be read.
    """
    values = lsv or find_variables(program)
    return name_files(
        program.name,
        read_input(program),
        None if values is None else read_input(values),
        {path.name: read_input(path) for path in find_pages(program).paths},
    )
