"""One base exception; its leaves carry the place and the cure."""

from __future__ import annotations

from pathlib import Path

# Text from outside, made safe to print.


def printable(text: str) -> str:
    r"""Escape control characters, so that a name cannot steer the terminal.

    >>> printable("a\x1b[31m")
    'a\\x1b[31m'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


# One base exception; the leaves carry the place and the cure.


class PostprocError(Exception):
    """Something the user must change before the work can be done (exit code 2)."""


class FileError(PostprocError):
    """A file that cannot be used, with the place and the cure.

    Attributes:
        path: The file as the user named it (``-`` for standard input).
        line: 1-based line, or None where no line is to blame.
        column: 1-based column in that line, or None where it is not known.
        place: A place inside a structured file, for instance ``$.tool.xyz_mm``.
        problem: What is wrong.
        cure: What the user can do about it.
    """

    def __init__(
        self,
        path: str | Path,
        problem: str,
        cure: str = "",
        *,
        line: int | None = None,
        column: int | None = None,
        place: str = "",
    ) -> None:
        self.path, self.line, self.column = str(path), line, column
        self.place = place
        self.problem, self.cure = problem, cure
        shown = printable(str(path))  # a line break in a name would forge a message
        where = f"{shown}:{line}" if line is not None else shown
        text = f"{where}: {problem}"
        text += f" @ {place}" if place else ""
        text += f". {cure}" if cure else ""
        super().__init__(text)

    def __reduce__(self) -> tuple[object, ...]:
        """Be the same in another process: `args` hold the text, not what made it."""
        return Exception.__new__, (type(self), *self.args), vars(self)


class ProgramError(FileError):
    """A robot program or variable file that cannot be read or must be refused."""


class CellError(FileError):
    """A cell file with a wrong key, unit or value."""


class ProjectError(FileError):
    """A project file with a wrong key or value, or one that names no file."""


class ArmError(FileError):
    """An arm file with a wrong key, unit or value."""


class MeasurementError(FileError):
    """A measurement file that cannot be read or cannot determine what is asked."""


class ModelError(FileError):
    """A model file that cannot be read or does not fit the arm or the tool."""


class OutputError(FileError):
    """A place that cannot be written to."""


class DiskFullError(OutputError):
    """No room is left: nothing else can be written there either."""


class PlanError(PostprocError):
    """A motion that cannot be planned: no time law, no inverse kinematics."""


class RecordError(FileError):
    """A record of robots that cannot be used, or does not hold what is asked for."""
