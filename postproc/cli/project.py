"""The project file: what commands use of a folder where no option states it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from postproc.exceptions import FileError, PostprocError, ProjectError
from postproc.files import is_stream

NAME = "postproc.toml"
MAKE = "write a project file with `postproc init`"


@dataclass(frozen=True)
class Project:
    """The places that a project file names, None where it does not.

    Attributes:
        path: The project file.
    """

    path: Path
    cell: Path | None
    model: Path | None
    source: Path | None
    output: Path | None

    def output_of(self, program: Path) -> Path | None:
        """Return where a program goes, as it lies in the folder of programs."""
        if self.output is None:
            return None
        place = Path(program.name)
        if self.source is not None:
            source, whole = self.source.absolute(), program.absolute()
            if whole.is_relative_to(source):
                place = whole.relative_to(source)
        return self.output / place


def find_project(beside: str | Path | None = None) -> Project | None:
    """Return the project of a file or folder, else of the working folder.

    The nearest project file upwards counts. Standard input and pipes have none.

    Raises:
        ProjectError: The file is wrong, with line and cure.
    """
    if beside is not None and is_stream(beside):
        return None
    here = Path.cwd()
    folders = [here]
    if beside is not None:
        place = Path(beside).absolute()
        folders.insert(0, place if place.is_dir() else place.parent)
    for folder in folders:
        for one in (folder, *folder.parents):
            if (one / NAME).is_file():
                return _read_once(one / NAME, here, (one / NAME).stat().st_mtime_ns)
    return None


@lru_cache(maxsize=4)
def _read_once(path: Path, here: Path, changed: int) -> Project:
    """Read a project file once a command, though several of its keys are asked for.

    Args:
        path: The file.
        here: The working folder, which places are relative to.
        changed: When the file has changed last [ns].
    """
    return read_project(path)


def read_project(path: Path) -> Project:
    """Read a project file.

    Raises:
        ProjectError: It cannot be read, or a key or value is wrong.
    """
    from postproc.robot.arm_file import read_toml
    from postproc.robot.project_file import ProjectFile

    here = Path.cwd()
    path = path.relative_to(here) if path.is_relative_to(here) else path
    try:
        file = read_toml(path, ProjectFile, ProjectError)
    except ProjectError as exc:
        raise _with_line(path, exc) from None
    places = {
        name: None if text is None else path.parent / text
        for name, text in file.model_dump().items()
    }
    return Project(path, **places)


def _with_line(path: Path, error: FileError) -> ProjectError:
    """Add the line of the key that an error names."""
    key = error.place.removeprefix("$.").partition(".")[0]
    line, column = error.line, error.column
    if line is None and key and path.is_file():
        rows = path.read_text("utf-8", "replace").splitlines()
        named = re.compile(rf"\s*\[?\s*\"?{re.escape(key)}\b")
        line = next((k + 1 for k, row in enumerate(rows) if named.match(row)), None)
    return ProjectError(
        path, error.problem, error.cure, line=line, column=column, place=error.place
    )


def cell_file(given: Path | None, beside: str | Path | None = None) -> Path:
    """Return the cell of an option, else of the project.

    Args:
        given: Of the option.
        beside: The program, or the measurements.

    Raises:
        PostprocError: Neither names one, or the project file is wrong.
    """
    if given is not None:
        return given
    project = find_project(beside)
    if project is None or project.cell is None:
        raise PostprocError(_lacks("cell", "--cell CELL.toml", project, beside))
    return project.cell


def model_file(given: Path | None, beside: str | Path | None = None) -> Path:
    """Return the model of an option, else of the project.

    Raises:
        PostprocError: Neither names one, it is not fitted yet, or the project file is
            wrong.
    """
    if given is not None:
        return given
    project = find_project(beside)
    if project is None or project.model is None:
        raise PostprocError(_lacks("model", "--model MODEL.json", project, beside))
    if not project.model.exists():
        cure = "Fit it first: postproc fit MEASURED.csv"
        raise ProjectError(project.path, f"{project.model} does not exist", cure)
    return project.model


def model_to_write(
    given: Path | None, force: bool, beside: str | Path | None = None
) -> Path:
    """Return where a fitted model goes: the option, else the project.

    Raises:
        PostprocError: Neither names a place, or the project's model exists.
    """
    if given is not None:
        return given
    project = find_project(beside)
    if project is None or project.model is None:
        raise PostprocError(_lacks("model", "-o MODEL.json", project, beside))
    if project.model.exists() and not force:
        cure = "Overwrite it with --force, or name another place with -o"
        raise ProjectError(project.path, f"{project.model} exists already", cure)
    return project.model


def _lacks(
    what: str, option: str, project: Project | None, beside: str | Path | None
) -> str:
    """Say that nothing names a file, and what to do."""
    if beside is not None and is_stream(beside):
        return f"no {what}: standard input belongs to no project. Give {option}"
    if project is None:
        return f"no {what}: give {option}, or {MAKE}"
    return f"no {what}: give {option}, or name it in {project.path}: {what} = .."
