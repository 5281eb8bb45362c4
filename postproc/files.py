"""Files as this program reads and writes them: bounded, whole, never half written."""

from __future__ import annotations

import errno
import os
import re
import signal
import stat
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePath
from types import FrameType
from typing import IO, Any, BinaryIO, NoReturn, Self

from postproc.exceptions import DiskFullError, OutputError, ProgramError

# Writing files so that nothing is ever half written.

TEMPORARY = ".postproc-tmp"  # end of the names of files that are being written
Content = bytes | Iterable[bytes]  # of a file, whole or in pieces
STREAM = "-"  # stands for standard input or output

_PASSING = (stat.S_ISFIFO, stat.S_ISCHR)  # kinds that bytes pass through
_DESCRIPTORS = re.compile(r"/proc/[^/]+(?:/task/\d+)?/fd")
_LINKS = 40  # that lead on to each other; Linux follows no more


def is_stream(place: str | Path) -> bool:
    """Tell whether bytes pass by here once, with no name that could be replaced.

    That is ``-``, a pipe, a device, and an open file of a process (``/dev/stdout``,
    ``/dev/fd/3``, ``<(command)`` of a shell). What is not there yet is none.

    >>> is_stream("-"), is_stream("job.pdl")
    (True, False)
    """
    if str(place) == STREAM or _is_descriptor(Path(place)):
        return True
    try:
        mode = os.stat(place).st_mode
    except OSError:
        return False
    return any(kind(mode) for kind in _PASSING)


def _is_descriptor(path: Path) -> bool:
    """Tell whether a path names an open file of a process, maybe through links."""
    for _ in range(_LINKS):
        if not path.is_symlink():
            return False
        path = Path(os.path.realpath(path.parent), path.name)
        if _DESCRIPTORS.fullmatch(str(path.parent)):
            return True
        path = path.parent / os.readlink(path)
    return False


def check_places(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """Refuse, before any work is done, places that must or can not be written to.

    Args:
        outputs: Files to be written; None and "-" stand for no file.
        inputs: Files that are read, likewise.

    Raises:
        OutputError: An output is an input, another output or a folder, or lies in a
            folder that does not exist.
    """
    read = [p for p in inputs if p is not None and str(p) != STREAM and p.exists()]
    taken: set[Path] = set()
    for place in outputs:
        if place is None or str(place) == STREAM:
            continue
        if any(place.exists() and place.samefile(source) for source in read):
            cure = "Give another output with -o; inputs are never overwritten"
            raise OutputError(place, "is an input", cure)
        if is_stream(place):
            continue
        if place.resolve() in taken:
            raise OutputError(place, "is named twice", "Give each output its own name")
        taken.add(place.resolve())
        _check_folder(place)


def _check_folder(place: Path) -> None:
    """Refuse a place that is no file, or that lies in no folder.

    Raises:
        OutputError: It does; or it is a socket or a disk, which nothing writes through.
    """
    if place.is_dir():
        raise OutputError(place, "is a folder", "Name the file to write in it")
    if is_stream(place):
        return
    place = _follow_link(place)
    if place.exists() and not place.is_file():
        cure = "Give a file, a pipe or a terminal"
        raise OutputError(place, "is neither a file nor a pipe", cure)
    if not place.parent.exists():
        cure = f"Make the folder {place.parent} first, or give another place"
        raise OutputError(place, "the folder does not exist", cure)
    if not place.parent.is_dir():
        cure = f"{place.parent} is a file: give a folder"
        raise OutputError(place, "there is no such folder", cure)


# What a signal that ends the process leaves behind: nothing.
#
# Commands leave such signals to the system, which ends them at once wherever they are,
# in a long sum as well as while modules are loaded. Only what is being written asks for
# more: temporary files are to be gone, and several files are renamed all or none.

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_unfinished: set[str] = set()  # temporary files of this process


def end_process(number: int) -> NoReturn:
    """Remove what is not finished, and end as shells tell of a signal: 128 + number."""
    for name in list(_unfinished):
        with suppress(OSError):
            os.unlink(name)
    os._exit(128 + number)


class _Shield:
    """Signals that would end the process at once let it tidy up first.

    Handlers that somebody else has set stay: they decide. Without a handler to set, in
    a thread, nothing is changed.
    """

    def __init__(self) -> None:
        self._taken: list[int] = []
        self._held, self._asked = False, 0

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            all_ = (n for n in ENDING if signal.getsignal(n) is signal.SIG_DFL)
            for number in all_:
                self._taken.append(number)
                signal.signal(number, self._end)
        return self

    def __exit__(self, *_: object) -> None:
        for number in self._taken:
            signal.signal(number, signal.SIG_DFL)

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Let the block come to its end first."""
        self._held = True
        try:
            yield
        finally:
            self._held = False
            if self._asked:
                end_process(self._asked)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self._asked = number
        if not self._held:
            end_process(number)


def write_all(files: Mapping[Path, Content]) -> None:
    """Write several files, each to a temporary name, synced, then renamed.

    No file appears under its name before all of them are safely on the disk. They are
    renamed in the order given: name the one that users wait for last. Only regular
    files are replaced: a link stays, and the file that it leads to is replaced; into a
    pipe, a device or an open file (`is_stream`) the bytes are written, before any
    rename.

    Raises:
        OutputError: A folder is missing or cannot be written to, or the disk is full;
            no file has been changed then.
    """
    for path in files:
        _check_folder(path)
    path = Path()
    try:
        with _Shield() as shield, _Temporaries(shield) as ready:
            for path, data in files.items():
                if not is_stream(path):
                    ready.write(_follow_link(path), data)
            for path, data in files.items():
                if is_stream(path):
                    # What is open elsewhere: nothing that it holds is cut off.
                    handle = os.open(path, os.O_WRONLY | os.O_APPEND)
                    with os.fdopen(handle, "wb") as out:
                        out.writelines([data] if isinstance(data, bytes) else data)
            ready.rename()
    except OSError as exc:
        raise disk_error(exc, path) from None


def make_folder(folder: Path) -> None:
    """Make a folder with those above it, unless it is there.

    Raises:
        OutputError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise OutputError(folder, _reason(exc), "Name a folder") from None


@dataclass(frozen=True)
class NamedText:
    """Text of a file that is given as bytes, with a name for messages."""

    name: str
    data: bytes


def open_text(file: str | Path | bytes, name: str) -> Path | NamedText:
    """Take a file as it is given: by its path, or as bytes with a name."""
    return NamedText(name, file) if isinstance(file, bytes) else Path(file)


class _Temporaries:
    """Files under temporary names, in the folders of the final ones."""

    def __init__(self, shield: _Shield) -> None:
        self._shield = shield
        self._ready: list[tuple[str, Path]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for name, _place in self._ready:
            Path(name).unlink(missing_ok=True)
            _unfinished.discard(name)

    def open(self, place: Path) -> IO[bytes]:
        """Open a temporary file for a place."""
        with self._shield.hold():
            start = f".{place.name[:100]}."
            handle, name = tempfile.mkstemp(TEMPORARY, start, place.parent)
            _unfinished.add(name)
            self._ready.append((name, place))
        return os.fdopen(handle, "wb")

    def write(self, place: Path, data: Content) -> None:
        """Write and sync a file that has the rights of the one in its place."""
        mask = os.umask(0)  # it cannot be read without being set
        os.umask(mask)
        mode = place.stat().st_mode & 0o777 if place.exists() else 0o666 & ~mask
        with self.open(place) as out:
            out.writelines([data] if isinstance(data, bytes) else data)
            _sync(out)
            os.fchmod(out.fileno(), mode)

    def rename(self) -> None:
        """Give all files their names; make that durable."""
        with self._shield.hold():
            for name, place in self._ready:
                os.replace(name, place)
        for folder in {place.parent for _, place in self._ready}:
            # Renames become durable with their folder.
            handle = os.open(folder, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)


@contextmanager
def replace_file(path: Path) -> Iterator[IO[bytes]]:
    """Open a file for writing that takes its name when the block has ended well.

    Raises:
        OSError: It cannot be written; what was there is there still.
    """
    with _Shield() as shield, _Temporaries(shield) as ready:
        with ready.open(path) as out:
            yield out
            _sync(out)
        ready.rename()


def _sync(out: IO[bytes]) -> None:
    """Bring what was written to the disk."""
    out.flush()
    os.fsync(out.fileno())


def disk_error(exc: OSError, path: str | Path) -> OutputError:
    """Say in our terms why a file cannot be written."""
    if exc.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return DiskFullError(path, "the disk is full", "Free some space, then resume")
    cure = "Give an existing folder with room that may be written to"
    return OutputError(path, _reason(exc), cure)


def _follow_link(path: Path) -> Path:
    """Return the file that a link leads to, whether it is there yet or not."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _reason(exc: OSError) -> str:
    """Say in plain words why writing failed."""
    if isinstance(exc, FileNotFoundError):
        return "the folder does not exist"
    if isinstance(exc, BrokenPipeError):
        return "nobody reads it any more"
    if isinstance(exc, PermissionError) or exc.errno == errno.EROFS:
        return "the folder is read-only"
    return f"cannot be written ({exc.strerror})"


# Kinds of files in a tree of programs, told by their names and contents.

_PROGRAM, _VARIABLES, _COMPILED = ".pdl", ".lsv", (".cod", ".var")
MODULES = (".mod", ".modx", ".prg", ".sys", ".sysx")  # programs that hold their values
KRL_PROGRAMS, KRL_DATA = (".src",), ".dat"  # sources, and the lists of their data
KRL_SUBMITS = (".sub",)  # programs that run beside the one that moves the arm
SHARED_LIST, ARCHIVE_DEPTH = "$config.dat", 4
# Sources of a controller and its packages, and routines that tell them from others.
_SYSTEM_SOURCES = {
    "bas": ("bas", "initmov", "frames"),
    "ir_stopm": ("ir_stopm",),
    "msglib": ("msgnotify",),
    "p00": ("p00",),
    "h50": ("h50",),
    "user_grp": ("user_grp",),
    "userspot": ("userspot",),
}
LARGEST = 500_000_000  # bytes of a program or variable file; a longer one is neither

_TARGETS = re.compile(
    rb"^[ \t]*\w+[ \t]+A?(?:POS|XTND|JNTP|PATH)\b", re.IGNORECASE | re.MULTILINE
)


def is_program(place: str) -> bool:
    """Tell whether a file is a program.

    >>> is_program("a/JOB.PDL"), is_program("Welding.mod"), is_program("a.txt")
    (True, True, False)
    >>> is_program("job.src"), is_program("job.dat")
    (True, False)
    """
    return _suffix(place) in (_PROGRAM, *MODULES, *KRL_PROGRAMS)


def is_module(place: str) -> bool:
    """Tell whether a file is a program that belongs to the modules beside it."""
    return _suffix(place) in MODULES


def is_data_list(place: str) -> bool:
    """Tell whether a file may be the data list of a source beside it, or is a system's.

    >>> is_data_list("a/Job.dat"), is_data_list("$config.dat")
    (True, True)
    """
    return _suffix(place) == KRL_DATA


def is_shared_list(place: str) -> bool:
    """Tell whether a file is a list that all programs of a controller share.

    >>> is_shared_list("R1/System/$config.dat"), is_shared_list("a/Job.dat")
    (True, False)
    """
    return is_data_list(place) and base_name(place).startswith("$")


def is_submit(place: str) -> bool:
    """Tell whether a file is a program that runs beside the one that moves the arm.

    >>> is_submit("R1/System/sps.sub"), is_submit("job.src")
    (True, False)
    """
    return _suffix(place) in KRL_SUBMITS


def is_system_source(place: str, text: bytes) -> bool:
    """Tell whether a source is one of the controller or of its packages.

    >>> is_system_source("IR_STOPM.src", b"DEF  IR_STOPM ( )")
    True
    >>> is_system_source("bas.src", b"DEF bas( )")
    False
    """
    names = _SYSTEM_SOURCES.get(base_name(place), ())
    if not names or _suffix(place) not in KRL_PROGRAMS:
        return False
    begin = rb"(?im)^[ \t]*(?:GLOBAL[ \t]+)?DEF[ \t]+"
    own = (begin + name.encode() + rb"\b" for name in names)
    return all(re.search(pattern, text) for pattern in own)


def is_system_file(path: Path) -> bool:
    """Tell whether a file on the disk is a source of the controller."""
    if base_name(path.name) not in _SYSTEM_SOURCES:
        return False
    try:
        return is_system_source(path.name, path.read_bytes())
    except OSError:
        return False


def data_list_of(program: str) -> str:
    """Name the data list of a source, "" where programs have none.

    >>> data_list_of("a/Job.src"), data_list_of("a/job.pdl")
    ('a/Job.dat', '')
    """
    stem, suffix = os.path.splitext(program)
    return stem + KRL_DATA if suffix.lower() in KRL_PROGRAMS else ""


def find_data_list(program: Path) -> Path | None:
    """Find the data list of a source: same base name, in any case."""
    return _beside(program, data_list_of(program.name))


def find_source(data_list: Path) -> Path | None:
    """Find the source of a data list: same base name, in any case."""
    return _beside(data_list, data_list.stem + KRL_PROGRAMS[0])


class FolderListing:
    """What folders hold; each is read once, so that many programs of one are cheap."""

    def __init__(self) -> None:
        """Begin without any folder."""
        self._entries: dict[Path, tuple[Path, ...]] = {}
        self._named: dict[Path, dict[str, Path]] = {}
        self._submits: dict[Path, tuple[Path, ...]] = {}

    def entries(self, folder: Path) -> tuple[Path, ...]:
        """Return what a folder holds, in order; nothing where it is none."""
        if folder not in self._entries:
            found = sorted(folder.iterdir()) if folder.is_dir() else []
            self._entries[folder] = tuple(found)
        return self._entries[folder]

    def named(self, folder: Path, name: str) -> Path | None:
        """Find a file of a name, in any case, in a folder."""
        if folder not in self._named:
            entries = reversed(self.entries(folder))
            self._named[folder] = {path.name.lower(): path for path in entries}
        return self._named[folder].get(name.lower())

    def submits(self, folder: Path, below: bool = False) -> tuple[Path, ...]:
        """Return the submit programs of a folder, or of all folders below it, too."""
        if not below:
            own = (p for p in self.entries(folder) if is_submit(p.name))
            return tuple(p for p in own if p.is_file())
        if folder not in self._submits:
            found = sorted(p for p in folder.rglob("*.*") if is_submit(p.name))
            self._submits[folder] = tuple(p for p in found if p.is_file())
        return self._submits[folder]


def find_shared_list(
    program: Path, within: Path | None = None, listing: FolderListing | None = None
) -> Path | None:
    """Find ``$config.dat``: beside a source, or where a controller keeps it.

    In an archive programs stand in ``R1/Program``, at any depth, and the list in
    ``R1/System``.

    Args:
        program: The source.
        within: A folder that nothing outside of is looked at.
        listing: What folders hold; default: they are read.
    """
    if not data_list_of(program.name):
        return None
    folder, listing = program.absolute().parent, listing or FolderListing()
    found = listing.named(folder, SHARED_LIST)
    for above in list(folder.parents)[:ARCHIVE_DEPTH]:
        outside = within is not None and within not in (above, *above.parents)
        if found is not None or outside:
            break
        found = listing.named(above / "System", SHARED_LIST)
    return found


def find_shared(
    program: Path, within: Path | None = None, listing: FolderListing | None = None
) -> tuple[Path, ...]:
    """Find what a source shares with others: ``$config.dat``, and submit programs.

    Submit programs stand beside either, or anywhere in the archive that the list
    belongs to; they may change what programs read.

    Args:
        program: The source.
        within: A folder that nothing outside of is looked at.
        listing: What folders hold; default: they are read.
    """
    folder, listing = program.absolute().parent, listing or FolderListing()
    if not data_list_of(program.name) or not folder.is_dir():
        return ()
    found = find_shared_list(program, within, listing)
    submits: list[Path] = []
    if found is not None and found.parent.name.lower() == "system":
        submits += listing.submits(found.parent.parent, below=True)
    for place in dict.fromkeys([folder] if found is None else [found.parent, folder]):
        submits += listing.submits(place)
    names = {path.name.lower(): path for path in submits}
    return (*(() if found is None else (found,)), *names.values())


def _beside(place: Path, name: str) -> Path | None:
    """Find a file of a name, in any case, in the folder of another."""
    if not name or not place.parent.is_dir():
        return None
    found = [p for p in place.parent.iterdir() if p.name.lower() == name.lower()]
    return min(found, default=None)


def holds_values(place: str) -> bool:
    """Tell whether a file is of a language that has no variable files."""
    return _suffix(place) in (*MODULES, *KRL_PROGRAMS, KRL_DATA)


def program_key(place: str) -> str:
    """Return what tells the programs of one folder apart, whatever their case.

    >>> program_key("a/JOB.PDL"), program_key("a/Job.mod")
    ('job', 'job.mod')
    """
    if not holds_values(place):
        return base_name(place)
    return place.replace("\\", "/").rpartition("/")[2].lower()


def is_variables(place: str) -> bool:
    """Tell whether a file is a variable file."""
    return _suffix(place) == _VARIABLES


def is_compiled(place: str) -> bool:
    """Tell whether a file is a program or a variable file as controllers load it."""
    return _suffix(place) in _COMPILED


def variables_of(program: str) -> str:
    """Name the variable file of a program, "" where programs hold their values.

    >>> variables_of("a/JOB.PDL"), variables_of("a/job.mod")
    ('a/JOB.lsv', '')
    """
    if holds_values(program):
        return ""
    return os.path.splitext(program)[0] + _VARIABLES


def find_variables(program: Path) -> Path | None:
    """Find the variable file of a program: same base name, in any case."""
    return _beside(program, variables_of(program.name))


def program_of(place: str) -> str:
    """Name the program that a variable file, or a compiled one, belongs to."""
    return os.path.splitext(place)[0] + _PROGRAM


def _suffix(place: str) -> str:
    return os.path.splitext(place)[1].lower()


def base_name(place: str) -> str:
    r"""Return a file's name without folders and suffix, in lower case.

    >>> base_name("a/JOB.PDL"), base_name(r"UD:\\USR\\Page2.cod")
    ('job', 'page2')
    """
    name = place.replace("\\", "/").rpartition("/")[2]
    return os.path.splitext(name)[0].lower()


def holds_targets(data: bytes) -> bool:
    r"""Tell whether a variable file holds positions.

    >>> holds_targets(b"p1 POS Priv\n X: 1 ..")
    True
    """
    return _TARGETS.search(data) is not None


# Reading files and streams that somebody else has made.


def read_input(path: Path, cure: str = "Check the path") -> bytes:
    """Read a program, a variable file or a record.

    Args:
        path: The file.
        cure: What to do where it cannot be read.

    Raises:
        ProgramError: It cannot be read, or is too long.
    """
    try:
        with path.open("rb") as stream:
            return read_stream(stream, path)
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise ProgramError(path, problem, cure) from None


def read_stream(stream: BinaryIO, name: str | Path) -> bytes:
    """Read a stream to its end.

    Raises:
        ProgramError: It is too long: no more than its beginning has been read then.
    """
    data = stream.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise ProgramError(name, f"is longer than {LARGEST} bytes", "Is it a program?")
    return data


def spreadsheet_text(text: str) -> str:
    """Return a cell of a table that no spreadsheet takes for a formula.

    >>> print(spreadsheet_text("=1+1"), spreadsheet_text("-1.5"), spreadsheet_text("W"))
    '=1+1 -1.5 W
    """
    if not text.startswith(("=", "+", "-", "@", "\t", "\r")):
        return text
    try:
        float(text.replace(",", "."))
    except ValueError:
        return f"'{text}"
    return text


# Of every JSON output the version of its keys: it grows where a reader must change.
SCHEMAS = {
    "check": 2,
    "comparison": 1,
    "diagnosis": 2,
    "difference": 2,
    "explanation": 2,
    "fit": 1,
    "history": 1,
    "report": 2,
    "simulation": 1,
    "tree": 1,
}


def schema(kind: str) -> dict[str, Any]:
    """Return the keys that a JSON output begins with.

    >>> schema("report")
    {'schema': 'postproc-report', 'version': 2}
    """
    return {"schema": f"postproc-{kind}", "version": SCHEMAS[kind]}


SYSTEM_MODULES, SYSTEM_SUFFIXES = "SYSMOD/", (".sys", ".sysx")
OTHER_TASKS = "TASKS/"


def name_read(path: PurePath, program: PurePath) -> str:
    """Return the name of a file that a job reads and never rewrites.

    Args:
        path: The file.
        program: The program of the job.

    >>> job = Path("RAPID/TASK1/PROGMOD/job.mod")
    >>> name_read(Path("RAPID/TASK1/SYSMOD/user.sys"), job)
    'SYSMOD/user.sys'
    >>> name_read(Path("RAPID/TASK2/PROGMOD/plc.mod"), job)
    'TASKS/TASK2/PROGMOD/plc.mod'
    >>> name_read(Path("System/$config.dat"), Path("Program/job.src"))
    '$config.dat'
    """
    if not is_module(path.name):
        return path.name
    if is_beside(path, program):
        return OTHER_TASKS + "/".join(path.parts[-3:])
    return f"{SYSTEM_MODULES}{path.name}"


def is_beside(path: PurePath, program: PurePath) -> bool:
    """Return True if a module belongs to another task of a backup than a program."""
    return is_module(path.name) and path.parent.parent != program.parent.parent


def task_beside(name: str) -> str:
    """Return the other task that a file of a job belongs to, "" for its own.

    >>> task_beside("TASKS/TASK2/PROGMOD/plc.mod"), task_beside("SYSMOD/user.sys")
    ('TASK2', '')
    """
    return name.split("/")[1] if name.startswith(OTHER_TASKS) else ""


def is_named_as_system(name: str) -> bool:
    """Return True if a module is a system module by its place or its suffix.

    >>> is_named_as_system("SYSMOD/a.mod") and is_named_as_system("BASE.SYS")
    True
    >>> is_named_as_system("job.mod")
    False
    """
    return name.startswith(SYSTEM_MODULES) or _suffix(name) in SYSTEM_SUFFIXES


def is_from_elsewhere(name: str) -> bool:
    """Return True if a file of a job was found in another folder of a backup."""
    return name.startswith((SYSTEM_MODULES, OTHER_TASKS))
