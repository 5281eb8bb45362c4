"""Writing files so that nothing is ever half written."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from postproc.exceptions import DiskFullError, OutputError

TEMPORARY = ".postproc-tmp"  # end of the names of files that are being written


def write_all(files: Mapping[Path, bytes]) -> None:
    """Write several files, each to a temporary name, synced, then renamed.

    No file appears under its name before all of them are safely on the disk. They are
    renamed in the order given: name the one that users wait for last.

    Raises:
        OutputError: A folder is missing or cannot be written to, or the disk is full;
            no file has been changed then.
    """
    ready: list[tuple[str, Path]] = []
    try:
        for path, data in files.items():
            ready.append((_write_temporary(path, data), path))
        for temporary, path in ready:
            os.replace(temporary, path)
        for folder in {path.parent for path in files}:
            _sync_folder(folder)
    except OSError as exc:
        raise disk_error(exc, exc.filename or next(iter(files))) from None
    finally:
        for temporary, _ in ready:
            Path(temporary).unlink(missing_ok=True)


@contextmanager
def replace_file(path: Path) -> Iterator[IO[bytes]]:
    """Open a file for writing that takes its name when the block has ended well.

    Raises:
        OSError: It cannot be written; what was there is there still.
    """
    handle, name = tempfile.mkstemp(TEMPORARY, f".{path.name[:100]}.", path.parent)
    try:
        with os.fdopen(handle, "wb") as out:
            yield out
            out.flush()
            os.fsync(out.fileno())
        os.replace(name, path)
        _sync_folder(path.parent)
    finally:
        Path(name).unlink(missing_ok=True)


def disk_error(exc: OSError, path: str | Path) -> OutputError:
    """Say in our terms why a file cannot be written."""
    if exc.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return DiskFullError(path, "no room is left there", "Make room, then go on")
    cure = "Give an existing folder with room that may be written to"
    return OutputError(path, _reason(exc), cure)


def _write_temporary(path: Path, data: bytes) -> str:
    """Write and sync a temporary file in the folder of the final one."""
    mode = path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask()
    handle, name = tempfile.mkstemp(TEMPORARY, f".{path.name[:100]}.", path.parent)
    try:
        with os.fdopen(handle, "wb") as out:
            out.write(data)
            out.flush()
            os.fsync(out.fileno())
        os.chmod(name, mode)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return name


def _umask() -> int:
    """Read the process's file mode mask."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _sync_folder(folder: Path) -> None:
    """Make renames in a folder durable."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _reason(exc: OSError) -> str:
    """Say in plain words why writing failed."""
    if isinstance(exc, FileNotFoundError):
        return "the folder does not exist"
    if isinstance(exc, PermissionError) or exc.errno == errno.EROFS:
        return "the folder is read-only"
    return f"cannot be written ({exc.strerror})"
