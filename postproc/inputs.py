"""Reading files and streams that somebody else has made."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from postproc.exceptions import ProgramError
from postproc.kinds import LARGEST


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
