"""Small programs, and the command line run on them, for tests of whole jobs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from typer.testing import CliRunner, Result

from postproc.arrays import Floats, Ints
from postproc.cli.commands import app
from postproc.compensation.output.rewrite import Output, write_edits
from postproc.compensation.program import ParsedProgram
from postproc.language.text.number_edits import edits as number_edits

FIRST = "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 50.0, 30.0}"
POSE = "MOVE LINEAR TO POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"
NEXT = "MOVE LINEAR TO POS( 100.0 ,200.0,50.00, 0.0, 175.0, 0.0, '')  -- \xe4 's"
LISTED = "--$$  ARM: 1 AXES: 8 AUX: 1 MASK: 191\r\n"


def program(*lines: str, declared: str = "p, r : POSITION") -> bytes:
    """Write a program as its users' files look: CRLF, Latin-1."""
    head = ["PROGRAM job", "VAR", f"  {declared}", "BEGIN"]
    text = [*head, *(f"  {line}" for line in lines), "END job", ""]
    return "\r\n".join(text).encode("latin-1")


def entry(name: str, x: float = 100.0, aux: str = "1: 90", arm: int = 1) -> str:
    """Write an XTNDPOS of a variable file in the controller's two decimals."""
    numbers = f" X: {x:.2f}  Y: 200.00  Z: 150.00  A: 0.000  E: 175.000  R: 0.000"
    return f"{name} XTND Arm: {arm} Ax:1 Priv\r\n{numbers}  {aux}\r\n CNFG: ''\r\n"


def cli(*arguments: object, stdin: bytes | None = None) -> Result:
    """Run a command; a defect of ours fails the test instead of being told."""
    texts = [str(argument) for argument in arguments]
    found = CliRunner().invoke(app, texts, input=stdin)
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    return found


@dataclass(frozen=True)
class Desk:
    """A folder to work in, with the cell and the model of the job folder.

    Attributes:
        folder: Where programs are written.
        cell, model: The files of the fixture `job_folder`.
    """

    folder: Path
    cell: Path
    model: Path

    def put(self, name: str, data: bytes | str) -> Path:
        """Write a file."""
        path = self.folder / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode("latin-1"))
        return path

    def compensate(self, source: object, *options: object, **more: bytes) -> Result:
        """Run postproc compensate."""
        given = ["--cell", self.cell, "--model", self.model]
        if not {"--cell", "--model"}.isdisjoint(map(str, options)):
            given = [] if "--cell" in map(str, options) else given[:2]
        return cli("compensate", source, *given, *options, **more)

    def report(self, source: object, *options: object) -> dict:
        """Compensate, and return the report."""
        path = self.folder / "report.json"
        found = self.compensate(source, "--report", path, *options)
        assert found.exit_code in (0, 1), found.stderr
        return json.loads(path.read_bytes())

    def names(self) -> set[str]:
        """List the folder."""
        return {path.name for path in self.folder.iterdir()}


def write_numbers(
    reading: ParsedProgram, literals: Ints, values: Floats, model: str
) -> Output:
    """Write new numbers (m, w), in the file's units, for literals (m,) of a program."""
    v = reading.visits
    found = number_edits(v.literals, reading.sources, literals, values, v.dialect)
    return write_edits(reading, found, model)
