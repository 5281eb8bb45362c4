"""Files as this program reads and writes them: bounded, whole, never half written."""

from __future__ import annotations

import errno
import os
import re
import secrets
import signal
import stat
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import IO, Any, BinaryIO, NoReturn, Self, TypeVar

from postproc.exceptions import DiskFullError, OutputError, ProgramError
from postproc.operating_system import ENDING, set_mode, sync_folder

# Writing files so that nothing is ever half written.

TEMPORARY = ".postproc-tmp"  # end of the names of files that are being written
NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
Content = bytes | Iterable[bytes]  # of a file, whole or in pieces
AHEAD = 3  # pieces of a file that are made before they are written
T = TypeVar("T")
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


def _ahead(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Make pieces while those before them are written: a few, so that none waits."""
    source = iter(pieces)
    with ThreadPoolExecutor(1) as pool:
        coming = deque(pool.submit(next, source, None) for _ in range(AHEAD))
        while (piece := coming.popleft().result()) is not None:
            coming.append(pool.submit(next, source, None))
            yield piece


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
        """Open a temporary file for a place.

        Its name is noted before it is there: a signal may end the process in between.
        """
        start = f".{place.name[:100]}.{secrets.token_hex(8)}"
        name = str(place.parent / f"{start}{TEMPORARY}")
        with self._shield.hold():
            _unfinished.add(name)
            try:
                handle = os.open(name, NEW, 0o600)
            except OSError:
                _unfinished.discard(name)
                raise
            self._ready.append((name, place))
        return os.fdopen(handle, "wb")

    def write(self, place: Path, data: Content) -> None:
        """Write and sync a file that has the rights of the one in its place."""
        mask = os.umask(0)  # it cannot be read without being set
        os.umask(mask)
        mode = place.stat().st_mode & 0o777 if place.exists() else 0o666 & ~mask
        with self.open(place) as out:
            out.writelines([data] if isinstance(data, bytes) else _ahead(data))
            _sync(out)
            set_mode(out, mode)

    def rename(self) -> None:
        """Give all files their names; make that durable."""
        with self._shield.hold():
            for name, place in self._ready:
                os.replace(name, place)
        for folder in {place.parent for _, place in self._ready}:
            sync_folder(folder)


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


# Names of files, and what folders hold.

LARGEST = 500_000_000  # bytes of a program or variable file; a longer one is neither


def base_name(place: str) -> str:
    r"""Return a file's name without folders and suffix, in lower case.

    >>> base_name("a/JOB.PDL"), base_name(r"UD:\\USR\\Page2.cod")
    ('job', 'page2')
    """
    name = place.replace("\\", "/").rpartition("/")[2]
    return os.path.splitext(name)[0].lower()


def path_in(folder: Path, text: str) -> Path:
    r"""Return the path that a file states, from a folder on; ``\`` separates as ``/``.

    >>> path_in(Path("line"), r"cells\\r1.toml").as_posix()
    'line/cells/r1.toml'
    """
    return folder / text.replace("\\", "/")


def toml_text(text: str) -> str:
    r"""Write a text as TOML has it.

    >>> print(toml_text(r'C:\cell "7"'))
    "C:\\cell \"7\""
    """
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def find_beside(place: Path, name: str) -> Path | None:
    """Find a file of a name, in any case, in the folder of another."""
    if not name or not place.parent.is_dir():
        return None
    found = [p for p in place.parent.iterdir() if p.name.lower() == name.lower()]
    return min(found, default=None)


class FolderListing:
    """What folders hold; each is read once, so that many programs of one are cheap.

    Attributes:
        root: A folder that nothing outside of is looked for, None for any place.
    """

    def __init__(self, root: Path | None = None) -> None:
        """Begin without any folder."""
        self.root = root
        self._entries: dict[Path, tuple[Path, ...]] = {}
        self._named: dict[Path, dict[str, Path]] = {}
        self._ending: dict[tuple[Path, tuple[str, ...], bool], tuple[Path, ...]] = {}
        self._found: dict[tuple[Path, object], Any] = {}

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

    def ending(
        self, folder: Path, suffixes: tuple[str, ...], below: bool = False
    ) -> tuple[Path, ...]:
        """Return the files of a folder that have one of some suffixes.

        Args:
            folder: Where they are.
            suffixes: In lower case.
            below: Those of all folders below it, too.
        """
        key = folder, suffixes, below
        if key not in self._ending:
            every = sorted(folder.rglob("*.*")) if below else self.entries(folder)
            found = (path for path in every if path.suffix.lower() in suffixes)
            self._ending[key] = tuple(filter(Path.is_file, found))
        return self._ending[key]

    def once(self, folder: Path, find: Callable[[Path, FolderListing], T]) -> T:
        """Return what is found for all programs of a folder alike.

        Args:
            folder: The folder.
            find: Finds it; it is asked once for a folder.
        """
        return self._keep((folder, find), lambda: find(folder, self))

    def beside(self, program: Path, find: Callable[[Path, FolderListing, str], T]) -> T:
        """Find something beside a program, once for all programs of a tree.

        Args:
            program: The program.
            find: Finds it in a folder. Last, it is given the name of a file that need
                not be read, in lower case: of a program alone, which may be a long one.
        """
        folder = program.absolute().parent
        if self.root is None:
            return find(folder, self, program.name.lower())
        return self._keep((folder, find), lambda: find(folder, self, ""))

    def _keep(self, key: tuple[Path, object], find: Callable[[], T]) -> T:
        """Return what was found for a key; find it first where nothing was."""
        if key not in self._found:
            self._found[key] = find()
        found: T = self._found[key]
        return found


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


def read_if_readable(path: Path, size: int = -1) -> bytes:
    """Read a file or its first bytes, nothing where it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError:
        return b""


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
    "iso9283": 1,
    "report": 2,
    "robot-check": 1,
    "simulation": 1,
    "tree": 1,
}


def schema(kind: str) -> dict[str, Any]:
    """Return the keys that a JSON output begins with.

    >>> schema("report")
    {'schema': 'postproc-report', 'version': 2}
    """
    return {"schema": f"postproc-{kind}", "version": SCHEMAS[kind]}
