"""Compensating files: what is read, what is written, and in which order."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from postproc.accuracy.model import Model, load_model
from postproc.clock import Progress, silent
from postproc.compensate import compensate
from postproc.exceptions import OutputError, ProgramError
from postproc.files import write_all
from postproc.options import Options
from postproc.report import Outcome
from postproc.robot.cell import Cell, load_cell
from postproc.sidecar import sidecar_path

STDIN = "-"


@dataclass(frozen=True)
class Job:
    """A program with all that its compensation needs.

    Attributes:
        path: The program, or None for standard input.
        name: The program's file name.
        source: Its bytes.
        variables: Path and bytes of its variable file, or None.
        cell: The cell.
        model: The model.
    """

    path: Path | None
    name: str
    source: bytes
    variables: tuple[Path, bytes] | None
    cell: Cell
    model: Model

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
        if program == STDIN:
            given = None if lsv is None else (lsv, read_bytes(lsv))
            name = "stdin.pdl" if lsv is None else lsv.with_suffix(".pdl").name
            return cls(None, name, sys.stdin.buffer.read(), given, loaded, fitted)
        path = Path(program)
        source = read_bytes(path)
        lsv = lsv or find_variables(path)
        values = None if lsv is None else (lsv, read_bytes(lsv))
        return cls(path, path.name, source, values, loaded, fitted)

    def run(self, options: Options, progress: Progress = silent) -> Outcome:
        """Compensate the program."""
        variables = None if self.variables is None else self.variables[1]
        return compensate(
            self.source,
            self.cell,
            self.model,
            name=self.name,
            variables=variables,
            options=options,
            progress=progress,
        )

    def write(
        self,
        outcome: Outcome,
        output: Path | None = None,
        report: Path | None = None,
        html: Path | None = None,
    ) -> None:
        """Write the program, its variable file, the record and the reports.

        Raises:
            OutputError: The output is the input, or cannot be written.
        """
        files: dict[Path, bytes] = {}
        if report is not None:
            files[report] = outcome.to_json().encode()
        if html is not None:
            from postproc.html import program_report

            files[html] = program_report(outcome).encode()
        program = outcome.outputs[self.name]
        values = next((v for k, v in outcome.outputs.items() if k != self.name), None)
        if self.path is None and output is None:
            write_all(files)
            sys.stdout.buffer.write(program)
            sys.stdout.buffer.flush()
            return
        target = output or default_output(self.path or Path(self.name))
        files[sidecar_path(target)] = outcome.sidecar.encode()
        if values is not None:
            files[target.with_suffix(".lsv")] = values
        files[target] = program
        self._refuse_overwriting(list(files))
        write_all(files)

    def _refuse_overwriting(self, outputs: list[Path]) -> None:
        """Refuse an output that is one of the inputs."""
        values = None if self.variables is None else self.variables[0]
        for source in (self.path, values, self.cell.path):
            for place in outputs:
                if source is not None and place.exists() and place.samefile(source):
                    raise OutputError(
                        place,
                        "is an input",
                        "Give another output with -o; inputs are never overwritten",
                    )


def default_output(program: Path) -> Path:
    """Name the output of a program.

    >>> default_output(Path("cell/job.pdl")).name
    'job.compensated.pdl'
    """
    return program.with_name(f"{program.stem}.compensated{program.suffix}")


def find_variables(program: Path) -> Path | None:
    """Find the variable file of a program: same base name, any case of .lsv."""
    if not program.parent.is_dir():
        return None
    wanted = f"{program.stem}.lsv".lower()
    found = [p for p in program.parent.iterdir() if p.name.lower() == wanted]
    return min(found, default=None)


def read_bytes(path: Path) -> bytes:
    """Read a file.

    Raises:
        ProgramError: It cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise ProgramError(path, problem, "Check the path") from None
