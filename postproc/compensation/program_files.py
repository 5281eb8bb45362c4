"""A program with all that belongs to it: on the disk, or as its bytes."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from postproc.compensation.output.sidecar import (
    path_between,
    sha256,
    sidecar_path,
)
from postproc.compensation.pages import (
    group_pages,
    is_output,
    names_in,
    of_one_arm,
    program_arm,
    read_head,
)
from postproc.diagnostics import Code
from postproc.exceptions import ProgramError
from postproc.files import (
    STREAM,
    FolderListing,
    base_name,
    is_stream,
    read_input,
    read_stream,
)
from postproc.language.languages import (
    UNNAMED,
    file_named,
    language_of,
    language_of_text,
)
from postproc.language.text.stamp import read_stamp
from postproc.language.visits import Diagnostic
from postproc.robot.cell import Cell
from postproc.robot.pose import record_from_pose

SAME_PLACE, SAME_TURN = 1e-4, 1e-5  # [m] and of the axes: two bases are one
NO_PAGES: Mapping[str, bytes] = MappingProxyType({})

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
    listing = FolderListing()
    wanted, outside = names_in(program, listing)
    notes = [
        _not_followed(program, line, f"{name!r} leads out of the folder: not followed")
        for name, line in outside.items()
    ]
    main = file_named(program).key
    reads = language_of(program.name).reads(program, listing)
    if not set(wanted) - {main} or not program.parent.is_dir():
        return Pages((), tuple(notes), reads)
    files = [p for p in sorted(program.parent.iterdir()) if not p.is_symlink()]
    values = {base_name(p.name) for p in files if file_named(p).is_variables}
    stamped = read_stamp(read_head(program)) is not None
    outputs = stamped or sidecar_path(program).is_file()
    programs = {file_named(p).key: p for p in files if _is_page(p, outputs)}
    programs |= {main: program}
    named = {
        base: {
            name: k for name, k in names_in(path, listing)[0].items() if name != main
        }
        for base, path in programs.items()
    }
    arms = {base: program_arm(path) for base, path in programs.items()}
    apart = dict.fromkeys(values, "it has a variable file of its own")
    for base, arm in arms.items():
        if not of_one_arm(arms[main], arm):
            apart[base] = f"it is a program of arm {arm} (PROG_ARM)"
    alone = {
        base: [other for other in others if other not in apart]
        for base, others in named.items()
    }
    pages = group_pages(alone).get(main, ())
    notes += _list_omitted(programs, named, (main, *pages), apart)
    found = tuple(programs[page] for page in pages)
    own = {path.absolute() for path in found}
    reads = tuple(path for path in reads if path.absolute() not in own)
    return Pages(found, tuple(notes), reads)


def archive_notes(program: Path, cell: Cell) -> tuple[Diagnostic, ...]:
    """Say what the backup of a program knows of the arm, and the cell does not."""
    notes: list[Diagnostic] = []
    arms = language_of(program.name).list_placed_arms(program)
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
    file = file_named(path)
    ours = file.is_program or file.is_data_list
    if not (ours and path.is_file()) or file.is_shared or file.is_system():
        return False
    return outputs or file.is_data_list or not is_output(path)


def _list_omitted(
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


# What is given: a program, its variable file, its pages, and what it reads.


@dataclass(frozen=True)
class ProgramFiles:
    """A program with all that its compensation reads of it.

    Attributes:
        name: The program's file name.
        source: Its bytes.
        variables: The bytes of its variable file, or None.
        pages: Bytes of its pages by name, and of what it reads and other programs too.
        path: Where it is, or None for one that passes by once: standard input, a pipe,
            bytes.
        variables_path: Where its variable file is, or None.
        page_paths: Where its pages are.
        read_paths: .. and what it reads and other programs too: that is not rewritten.
        notes: What it or a page names and is not followed.
    """

    name: str
    source: bytes
    variables: bytes | None = None
    pages: Mapping[str, bytes] = field(default_factory=dict)
    path: Path | None = None
    variables_path: Path | None = None
    page_paths: tuple[Path, ...] = ()
    read_paths: tuple[Path, ...] = ()
    notes: tuple[Diagnostic, ...] = ()

    @classmethod
    def open(cls, program: str | Path, lsv: Path | None = None) -> ProgramFiles:
        """Read a program, its pages and its variable file.

        Args:
            program: A path, or ``-`` for standard input; a pipe is read once, and
                nothing is looked for beside it.
            lsv: The variable file; default: the one of the program's base name.

        Raises:
            ProgramError: A file cannot be read, or the language knows no such file.
        """
        program = str(program)
        path = None if is_stream(program) else Path(program)
        name = program_name(program, lsv)
        source = read_program_file(program)
        name = name_of_text(program, name, source)
        if lsv is not None and not file_named(name).variables:
            problem = f"a {language_of(name).name} program has no variable file"
            raise ProgramError(name, problem, "Leave --variables out")
        lsv = lsv or (None if path is None else file_named(path).find_variables())
        values = None if lsv is None else read_input(lsv)
        found = Pages() if path is None else find_pages(path)
        pages = {page.name: read_input(page) for page in found.paths}
        here = Path() if path is None else path.absolute()
        pages |= {
            file_named(page).name_for(here): read_input(page) for page in found.reads
        }
        return cls(
            name, source, values, pages, path, lsv, found.paths, found.reads,
            found.notes,
        )  # fmt: skip

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Every file that was read."""
        given = (self.path, self.variables_path, *self.page_paths, *self.read_paths)
        return tuple(path for path in given if path is not None)

    @property
    def by_name(self) -> dict[str, bytes]:
        """All bytes by name: the program first, its variable file last."""
        return name_files(self.name, self.source, self.variables, self.pages)

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of all bytes, by name; of what is only read by the path to it.

        What is given as bytes, and stands in another folder, is not among them.
        """
        here = Path() if self.path is None else self.path.absolute()
        paths = {
            file_named(path).name_for(here): path_between(here.parent, path.absolute())
            for path in self.read_paths
        }
        return {
            paths.get(name, name): sha256(data)
            for name, data in self.by_name.items()
            if name in paths or not _is_elsewhere(name)
        }

    def report_omissions(self, cell: Cell) -> tuple[Diagnostic, ...]:
        """Say what is not followed, and what the program's backup knows of the arm."""
        if self.path is None:
            return self.notes
        return (*self.notes, *archive_notes(self.path, cell))


def _is_elsewhere(name: str) -> bool:
    """Return True if a file of a job need not stand beside the program."""
    file = file_named(name)
    return file.is_shared or file.is_from_elsewhere


def program_files(
    program: str | Path | bytes | ProgramFiles,
    name: str = UNNAMED,
    variables: bytes | str | Path | None = None,
    pages: Mapping[str, bytes] = NO_PAGES,
) -> ProgramFiles:
    """Take a program as it is given: a path, bytes with a name, or read already.

    Args:
        program: The program. Beside a path its pages and its variable file are found.
        name: File name of bytes.
        variables: The variable file, a path or bytes; default: as found.
        pages: Further programs by name, for bytes.

    Raises:
        ProgramError: A file cannot be read, or bytes are given for a part of a path.
    """
    if isinstance(program, ProgramFiles):
        return program
    if not isinstance(program, bytes):
        if isinstance(variables, bytes) or pages:
            problem = "variables and pages are given as bytes, and the program is not"
            raise ProgramError(str(program), problem, "Give all of them in one way")
        return ProgramFiles.open(
            program, None if variables is None else Path(variables)
        )
    if isinstance(variables, str | Path):
        variables = read_input(Path(variables))
    return ProgramFiles(name, program, variables, pages)


def name_files(
    name: str,
    source: bytes,
    variables: bytes | None,
    pages: Mapping[str, bytes] = NO_PAGES,
) -> dict[str, bytes]:
    """Name a program, its pages and its variable file, in this order.

    Raises:
        ProgramError: There are two variable files.
    """
    files = {name: source, **pages}
    lists = {page: files.pop(page) for page in pages if file_named(page).is_variables}
    if variables is not None:
        lists[file_named(name).variables] = variables
    if len(lists) > 1:
        problem = "a program has one variable file, and there are two"
        raise ProgramError([*lists][1], problem, "Leave one of them out")
    return files | lists


def program_name(program: str, lsv: Path | None) -> str:
    """Name a program for messages, and for its variables: those share its base name.

    >>> program_name("cell/job.pdl", None), program_name("-", Path("values/weld.lsv"))
    ('job.pdl', 'weld.pdl')
    """
    name = Path(program).name
    if not is_stream(program) or file_named(name).is_program:
        return name
    return file_named("stdin" if lsv is None else lsv.name).program


def name_of_text(program: str, name: str, source: bytes) -> str:
    """Name a program without a name of its own by the language that it is written in.

    >>> name_of_text("-", "stdin.pdl", b"MODULE weld")
    'stdin.mod'
    """
    if not is_stream(program) or file_named(program).is_program:
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
    return ProgramFiles.open(program, lsv).by_name
