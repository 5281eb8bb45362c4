"""Compensating files: which ones a program needs, and where the outputs go."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from postproc.batch.pages import (
    OUTPUT,
    group_pages,
    is_output,
    names_in,
    of_one_arm,
    program_arm,
    read_head,
)
from postproc.cli.common import write_stdout
from postproc.compensation.compensate import compensate, name_files
from postproc.compensation.options import Options, Progress, silent
from postproc.compensation.outcome import Outcome
from postproc.compensation.record import sidecar_path
from postproc.diagnostics import Code
from postproc.exceptions import OutputError, ProgramError
from postproc.files import (
    STREAM,
    Content,
    base_name,
    check_places,
    find_shared,
    find_variables,
    is_data_list,
    is_program,
    is_shared_list,
    is_stream,
    is_system_file,
    is_variables,
    name_read,
    program_key,
    program_of,
    read_input,
    read_stream,
    variables_of,
    write_all,
)
from postproc.language.languages import language_of, language_of_text
from postproc.language.stamp import read_stamp
from postproc.language.visits import Diagnostic
from postproc.model.model import Model, load_model
from postproc.report.json import report_pieces
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import record_from_pose

SAME_PLACE, SAME_TURN = 1e-4, 1e-5  # [m] and of the axes: two bases are one

# The pages of a program on the disk: programs beside it that only it names.


@dataclass(frozen=True)
class Pages:
    """What belongs to a program.

    Attributes:
        paths: Its pages, in the order in which they are named.
        notes: What it names and what is not followed, and why.
        reads: What it reads, and other programs too: it is not rewritten.
    """

    paths: tuple[Path, ...] = ()
    notes: tuple[Diagnostic, ...] = ()
    reads: tuple[Path, ...] = ()


def find_pages(program: Path) -> Pages:
    """Find the programs that IMPORT, CALL or EXPORTED FROM name, in the same folder.

    A program that others name too is theirs as well, and one with a variable file of
    its own or of another arm is a program by itself: none is followed. Symbolic links
    do not count, nor do earlier outputs, unless the program is one: what was changed
    of a job lies in its pages alone where those hold its points.
    """
    wanted, outside = names_in(program)
    notes = [
        _not_followed(program, line, f"{name!r} leads out of the folder: not followed")
        for name, line in outside.items()
    ]
    main = program_key(program.name)
    reads = (*find_shared(program), *_read_elsewhere(program))
    if not set(wanted) - {main} or not program.parent.is_dir():
        return Pages((), tuple(notes), reads)
    files = [p for p in sorted(program.parent.iterdir()) if not p.is_symlink()]
    values = {base_name(p.name) for p in files if is_variables(p.name)}
    outputs = _is_output(program)
    programs = {program_key(p.name): p for p in files if _is_page(p, outputs)}
    programs |= {main: program}
    named = {base: _named(path, main) for base, path in programs.items()}
    arms = {base: program_arm(read_head(path)) for base, path in programs.items()}
    apart = dict.fromkeys(values, "it has a variable file of its own")
    for base, arm in arms.items():
        if not of_one_arm(arms[main], arm):
            apart[base] = f"it is a program of arm {arm} (PROG_ARM)"
    alone = {
        base: [other for other in others if other not in apart]
        for base, others in named.items()
    }
    pages = group_pages(alone).get(main, ())
    notes += _left_out(programs, named, (main, *pages), apart)
    return Pages(tuple(programs[page] for page in pages), tuple(notes), reads)


def _read_elsewhere(program: Path) -> tuple[Path, ...]:
    """Return what a program of an archive reads in other folders."""
    return language_of(program.name).reads(program) if is_program(program.name) else ()


def archive_notes(program: Path, cell: Cell) -> tuple[Diagnostic, ...]:
    """Say what the backup of a program knows of the arm, and the cell does not."""
    notes: list[Diagnostic] = []
    if not is_program(program.name):
        return ()
    arms = language_of(program.name).placed_arms(program)
    for name, pose in arms[cell.arm_number - 1 : cell.arm_number]:
        apart = np.abs(pose - cell.base.pose)
        if apart[:3, 3].max() > SAME_PLACE or apart[:3, :3].max() > SAME_TURN:
            x, y, z, *turns = record_from_pose(pose).tolist()
            text = (
                f"MOC.cfg of this backup places {name} otherwise than the cell. "
                f"Paste into the cell: [base] xyz_mm = [{x:.3f}, {y:.3f}, {z:.3f}] "
                f"euler_zyz_deg = [{', '.join(f'{v:.4f}' for v in turns)}]"
            )
            notes.append(Diagnostic(program.name, 1, Code.ARCHIVE_BASE, text))
    return tuple(notes)


def _not_followed(program: Path, line: int, text: str) -> Diagnostic:
    return Diagnostic(program.name, line, Code.NOT_FOLLOWED, text)


def _is_page(path: Path, outputs: bool) -> bool:
    """Tell whether a file is a program or a data list, be it an output or not."""
    ours = is_program(path.name) or is_data_list(path.name)
    if not (ours and path.is_file()) or is_shared_list(path.name):
        return False
    if is_system_file(path):
        return False
    return outputs or is_data_list(path.name) or not is_output(path)


def _is_output(program: Path) -> bool:
    """Tell whether a program was written by a compensation, changed or not."""
    return read_stamp(read_head(program)) is not None or sidecar_path(program).is_file()


def _named(path: Path, main: str) -> dict[str, int]:
    """Return the programs that a program names, but for the main one, and the line."""
    return {name: line for name, line in names_in(path)[0].items() if name != main}


def _left_out(
    programs: Mapping[str, Path],
    named: Mapping[str, Mapping[str, int]],
    followed: Sequence[str],
    apart: Mapping[str, str],
) -> list[Diagnostic]:
    """Say which programs are there and named, and not followed, where they are named.

    Args:
        programs: The programs of the folder.
        named: Those that each of them names, and the line.
        followed: The main program and its pages.
        apart: Why some are programs by themselves.
    """
    first: dict[str, str] = {}
    for base in followed:
        for other in named[base]:
            first.setdefault(other, base)
    notes = []
    for other, base in first.items():
        if other in followed or other not in programs:
            continue
        why = apart.get(other, "")
        if not why:
            users = [base for base in named if other in named[base] and base != other]
            why = f"{' and '.join(programs[user].name for user in users)} name it"
        text = f"{programs[other].name} is not followed: {why}"
        notes.append(_not_followed(programs[base], named[base][other], text))
    return notes


# Compensating files: what is read, what is written, and in which order.


@dataclass(frozen=True)
class Job:
    """A program with all that its compensation needs.

    Attributes:
        path: The program, or None for one that passes by once: standard input, a pipe.
        name: The program's file name.
        source: Its bytes.
        variables: Path and bytes of its variable file, or None.
        pages: Paths and bytes of its pages.
        reads: .. of what it reads and other programs too.
        notes: What it or a page names and is not followed.
        cell: The cell.
        model: The model.
        inputs: Every file that was read.
    """

    path: Path | None
    name: str
    source: bytes
    variables: tuple[Path, bytes] | None
    pages: tuple[tuple[Path, bytes], ...]
    reads: tuple[tuple[Path, bytes], ...]
    notes: tuple[Diagnostic, ...]
    cell: Cell
    model: Model
    inputs: tuple[Path, ...]

    @classmethod
    def open(
        cls, program: str, cell: Path, model: Path, lsv: Path | None = None
    ) -> Job:
        """Read a program, its variable file, the cell and the model.

        Args:
            program: A path, or ``-`` for standard input; a pipe is read once, and
                nothing is looked for beside it.
            cell: The cell file.
            model: The model file.
            lsv: The variable file; default: the one of the program's base name.

        Raises:
            PostprocError: A file cannot be read or used.
        """
        loaded = load_cell(cell)
        fitted = load_model(model)
        fitted.check_arm(loaded.arm, model)
        path = None if is_stream(program) else Path(program)
        name = program_name(program, lsv)
        source = read_program_file(program)
        name = name_of_text(program, name, source)
        if lsv is not None and not variables_of(name):
            problem = f"a {language_of(name).name} program has no variable file"
            raise ProgramError(name, problem, "Leave --lsv out")
        lsv = lsv or (None if path is None else find_variables(path))
        values = None if lsv is None else (lsv, read_input(lsv))
        found = Pages() if path is None else find_pages(path)
        pages = tuple((page, read_input(page)) for page in found.paths)
        reads = tuple((page, read_input(page)) for page in found.reads)
        given = (path, lsv, cell, model, *found.paths, *found.reads)
        inputs = tuple(p for p in given if p is not None)
        notes = (*found.notes, *(() if path is None else archive_notes(path, loaded)))
        return cls(
            path, name, source, values, pages, reads, notes, loaded, fitted, inputs
        )

    @property
    def wants_opinion(self) -> bool:
        """Tell whether the cell asks for a second opinion."""
        return self.cell.file.verify.second_opinion

    def judged(self, outcome: Outcome, options: Options) -> Outcome:
        """Add a second opinion on what came of the program."""
        from postproc.compensation.program import prepared
        from postproc.compensation.second_opinion import second_opinion

        source = dict(outcome.sources)
        output = source | dict(outcome.outputs)
        cell = prepared(self.cell, self.model, options)
        opinion = second_opinion(source, output, cell, outcome.record)
        return replace(outcome, opinion=opinion)

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
            pages={
                **{p.name: data for p, data in self.pages},
                **{name_read(p): data for p, data in self.reads},
            },
            options=options,
            progress=progress,
            processes=processes,
        )
        return replace(outcome, diagnostics=(*outcome.diagnostics, *self.notes))

    def write(
        self,
        outcome: Outcome,
        output: Path | None = None,
        report: Path | None = None,
        html: Path | None = None,
        values: Path | None = None,
    ) -> list[Path]:
        """Write the program, its variable file, the record and the reports.

        A program from standard input or a pipe goes to standard output unless it is
        told where to. One that goes to standard output, a pipe or a device has no
        record, and files only where it is told to.

        Args:
            outcome: What came of the program.
            output: Where the program goes.
            report: Where the report goes, None for nowhere.
            html: Where the report for a browser goes.
            values: Where the variable file goes, changed or not; default: beside the
                program, if it has changed.

        Returns:
            The files written.

        Raises:
            OutputError: An output is an input, cannot be written, or a part of the
                program has no place to go to.
        """
        check_places([output, report, html, values], self.inputs)
        files: dict[Path, Content] = {}
        if report is not None and report != Path(STREAM):
            files[report] = report_pieces(outcome)
        if html is not None:
            from postproc.report.html import program_report

            files[html] = program_report(outcome).encode()
        place = output or (None if self.path is None else default_output(self.path))
        files |= self._results(outcome, place, values)
        check_places(files, self.inputs)
        write_all(files)
        if place is None:
            write_stdout(outcome.outputs[self.name])
        return list(files)

    def _results(
        self, outcome: Outcome, target: Path | None, values: Path | None
    ) -> dict[Path, Content]:
        """Name what a compensation gives, the file that users wait for last.

        Args:
            outcome: The compensation.
            target: Where the program goes, None for standard output.
            values: Where its variable file goes, None for beside it.

        Raises:
            OutputError: A part of the program has no place to go to.
        """
        files: dict[Path, Content] = {}
        for page, _ in reversed(self.pages):
            if page.name in outcome.outputs:
                place = _page_place(page, _file_of(target, page))
                files |= _with_record(outcome, {page.name: place}, place)
        own = self._own_places(outcome, target, values)
        if values and self.variables and variables_of(self.name) not in own:
            files[values] = self.variables[1]
        for places in _by_folder(own):
            files |= _with_record(outcome, places, list(places.values())[-1])
        if target is not None and is_stream(target):
            files[target] = outcome.outputs[self.name]
        return files

    def _own_places(
        self, outcome: Outcome, target: Path | None, values: Path | None
    ) -> dict[str, Path]:
        """Tell where the program and its values go, where those are files."""
        name = variables_of(self.name)
        own: dict[str, Path] = {}
        if name in outcome.outputs:
            changed = Path(name) if self.variables is None else self.variables[0]
            place = values or _file_of(target, changed)
            beside = place.with_name(variables_of(place.name))
            if place.suffix.isupper():  # JOB.PDL has JOB.LSV beside it
                beside = beside.with_suffix(beside.suffix.upper())
            own[name] = values or beside
        if target is not None and not is_stream(target):
            own[self.name] = target
        return own


def _file_of(target: Path | None, part: Path) -> Path:
    """Return the file of a program, beside which a part of it may go.

    Raises:
        OutputError: The program goes to standard output, a pipe or a device.
    """
    if target is None or is_stream(target):
        how = "--lsv-out FILE, or " if is_variables(part.name) else ""
        raise OutputError(
            part,
            "changes too, and nothing says where it goes",
            f"Give {how}the program a file with -o",
        )
    return target


def _by_folder(own: Mapping[str, Path]) -> list[dict[str, Path]]:
    """Group files by their folder, in order: a record speaks of files beside it."""
    found: dict[Path, dict[str, Path]] = {}
    for name, place in own.items():
        folder = place if is_stream(place) else place.parent.resolve()
        found.setdefault(folder, {})[name] = place
    return list(found.values())


def _with_record(
    outcome: Outcome, places: Mapping[str, Path], main: Path
) -> dict[Path, Content]:
    """Name the files of one program, behind the record that undoes them."""
    names = {name: place.name for name, place in places.items()}
    record = outcome.record.renamed(names).to_json()
    files = {place: outcome.outputs[name] for name, place in places.items()}
    return {**({} if is_stream(main) else {sidecar_path(main): record}), **files}


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
    return program.with_name(f"{program.stem}{OUTPUT}{program.suffix}")


def program_name(program: str, lsv: Path | None) -> str:
    """Name a program for messages, and for its variables: those share its base name.

    >>> program_name("cell/job.pdl", None), program_name("-", Path("values/weld.lsv"))
    ('job.pdl', 'weld.pdl')
    """
    name = Path(program).name
    if not is_stream(program) or is_program(name):
        return name
    return program_of("stdin" if lsv is None else lsv.name)


def name_of_text(program: str, name: str, source: bytes) -> str:
    """Name a program without a name of its own by the language that it is written in.

    >>> name_of_text("-", "stdin.pdl", b"MODULE weld")
    'stdin.mod'
    """
    if not is_stream(program) or is_program(Path(program).name):
        return name
    return Path(name).stem + language_of_text(source).suffixes[0]


def read_program_file(program: str) -> bytes:
    """Read a program, ``-`` for standard input.

    Raises:
        ProgramError: It cannot be read.
    """
    if program == STREAM:
        return read_stream(sys.stdin.buffer, STREAM)
    return read_input(Path(program))


def read_files(program: Path, lsv: Path | None = None) -> dict[str, bytes]:
    """Read a program with its pages and its variable file, the program first.

    Beside a pipe nothing is looked for.

    Raises:
        ProgramError: A file cannot be read.
    """
    passing = is_stream(program)
    source = read_program_file(str(program))
    name = name_of_text(str(program), program_name(str(program), lsv), source)
    values = lsv or (None if passing else find_variables(program))
    found = Pages() if passing else find_pages(program)
    return name_files(
        name,
        source,
        None if values is None else read_input(values),
        {path.name: read_input(path) for path in found.paths}
        | {name_read(path): read_input(path) for path in found.reads},
    )
