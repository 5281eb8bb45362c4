"""The command line: arguments, a call, and what is printed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc import __version__
from postproc.exceptions import FileError, PostprocError

if TYPE_CHECKING:
    from postproc.report import Outcome

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Compensate robot programs with a model learned from laser-tracker data.",
)

CellOption = Annotated[Path, typer.Option("--cell", help="Cell file (TOML).")]
ModelOption = Annotated[Path, typer.Option("--model", help="Model file (JSON).")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of every random draw.")]


class Method(StrEnum):
    """How a model is made from measurements."""

    FULL = "full"
    EJA_ELM = "eja-elm"
    ELM = "elm"
    INTERPOLATION = "interpolation"
    KINEMATIC_ELM = "kinematic-elm"
    KRIGING = "kriging"


class MeasuredFrame(StrEnum):
    """The frame that positions were measured in."""

    BASE = "base"
    TRACKER = "tracker"


def say(text: str) -> None:
    """Print a message for a person, on stderr."""
    typer.echo(text, err=True)


@contextmanager
def explained() -> Iterator[None]:
    """Turn an error that the user can mend into a message and exit code 2."""
    try:
        yield
    except PostprocError as exc:
        say(f"postproc: {exc}")
        raise typer.Exit(2) from None
    except BrokenPipeError:
        sys.stderr.close()
        raise typer.Exit(2) from None


@app.callback(invoke_without_command=True)
def _main(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.")
    ] = False,
) -> None:
    if version:
        typer.echo(f"postproc {__version__}")
        raise typer.Exit(0)


@app.command()
def compensate(
    program: Annotated[str, typer.Argument(help="PROGRAM.pdl, or - for stdin.")],
    cell: CellOption,
    model: ModelOption,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Default: PROGRAM.compensated.pdl beside it."
        ),
    ] = None,
    lsv: Annotated[
        Path | None, typer.Option("--lsv", help="Variable file, default PROGRAM.lsv.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="Write the report (JSON) here.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option("--html", help="Write the report (HTML) here.")
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Fail, and write nothing, if any is left.")
    ] = False,
    clone: Annotated[
        bool, typer.Option("--clone", help="Clone variables whose arrivals disagree.")
    ] = False,
    temperature: Annotated[
        float | None, typer.Option("--temperature", help="Arm temperature [deg C].")
    ] = None,
) -> None:
    """Rewrite a program so that the tool lands where its targets say.

    Example: postproc compensate job.pdl --cell cell.toml --model model.json
    """
    from postproc import jobs
    from postproc.compensate import Options

    options = Options(clone=clone, temperature=temperature)
    with explained():
        job = jobs.Job.open(program, cell, model, lsv)
        outcome = job.run(options)
        if strict and outcome.exit_code:
            _print_outcome(outcome)
            raise PostprocError(
                "--strict: targets were left uncompensated (listed above), nothing is "
                "written. Mend them, or run without --strict"
            )
        job.write(outcome, output, report, html)
        _print_outcome(outcome)
    raise typer.Exit(outcome.exit_code)


def _print_outcome(outcome: Outcome) -> None:
    """Print what a person needs to know, on stderr."""
    for finding in outcome.diagnostics:
        say(f"{finding.file}:{finding.line}: {finding.code}: {finding.message}")
    for line in outcome.left_alone():
        say(line)
    say(outcome.summary())


@app.command()
def diff(
    original: Path,
    compensated: Path,
    json: Annotated[
        str | None, typer.Option("--json", help="Write JSON to a file, - for stdout.")
    ] = None,
) -> None:
    """Compare the targets of two programs: exit 0 same, 1 different, 2 trouble."""
    from postproc import diff as differ

    with explained():
        found = differ.diff(original, compensated)
        if json:
            write_text(json, found.to_json())
        if json != "-":
            found.print()
    raise typer.Exit(1 if found.rows else 0)


@app.command()
def restore(
    compensated: Path,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Default: over the program.")
    ] = None,
) -> None:
    """Give back the original program, byte for byte, from the sidecar record."""
    from postproc.restore import restore_file

    with explained():
        for path in restore_file(compensated, output):
            say(f"restored {path}")


@app.command()
def explain(
    program: Path,
    cell: CellOption,
    model: Annotated[
        Path | None, typer.Option("--model", help="Model file (JSON).")
    ] = None,
    lsv: Annotated[Path | None, typer.Option("--lsv", help="Variable file.")] = None,
    line: Annotated[
        int | None, typer.Option("--line", help="Only the visits of this line.")
    ] = None,
    temperature: Annotated[
        float | None, typer.Option("--temperature", help="Arm temperature [deg C].")
    ] = None,
    json: Annotated[
        str | None, typer.Option("--json", help="Write JSON to a file, - for stdout.")
    ] = None,
) -> None:
    """Show why every target moves: from where it is reached, and what that costs."""
    from postproc.explain import explain_file

    with explained():
        found = explain_file(program, cell, model, lsv, temperature)
        if json:
            write_text(json, found.to_json(line))
        if json != "-":
            found.print(line)


@app.command()
def survey(
    cell: CellOption,
    output: Annotated[Path, typer.Option("-o", "--output", help="SURVEY.pdl")],
    poses: Annotated[int, typer.Option("--poses", help="Number of poses.")] = 300,
    mode: Annotated[
        str, typer.Option("--mode", help="lhs (Latin hypercube) or optimal.")
    ] = "lhs",
    tracker: Annotated[
        str | None, typer.Option("--tracker", help="x,y,z [mm] in the base frame.")
    ] = None,
    seed: SeedOption = 0,
) -> None:
    """Write a measurement program; every pose is approached from both sides."""
    from postproc.surveying import write_survey

    with explained():
        say(write_survey(cell, output, poses, mode, tracker, seed))


@app.command()
def simulate(
    program: Annotated[Path, typer.Argument(help="PROGRAM.pdl or SURVEY.csv")],
    cell: CellOption,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="MEASURED.csv")
    ] = None,
    seed: SeedOption = 1,
    effects: Annotated[
        str | None, typer.Option("--effects", help="Further effects, comma separated.")
    ] = None,
    wanted: Annotated[
        Path | None,
        typer.Option("--wanted", help="Original program: print the true error."),
    ] = None,
    json: Annotated[
        str | None, typer.Option("--json", help="True error as JSON, - for stdout.")
    ] = None,
) -> None:
    """Let the virtual arm run a program or a survey, and measure it."""
    from postproc.simulate import simulate_file

    with explained():
        found = simulate_file(program, cell, seed, effects, wanted)
        if output is not None:
            found.write(output)
        if json:
            write_text(json, found.to_json())
        say(found.summary())


@app.command()
def fit(
    data: Annotated[list[Path], typer.Argument(help="Measurement files (CSV).")],
    cell: CellOption,
    output: Annotated[Path, typer.Option("-o", "--output", help="MODEL.json")],
    method: Annotated[Method, typer.Option("--method")] = Method.FULL,
    effects: Annotated[
        str | None,
        typer.Option("--effects", help="Effects of the full method, comma separated."),
    ] = None,
    frame: Annotated[MeasuredFrame, typer.Option("--frame")] = MeasuredFrame.BASE,
    seed: SeedOption = 0,
    program: Annotated[
        Path | None,
        typer.Option("--program", help="The survey program, for id, x, y, z files."),
    ] = None,
) -> None:
    """Fit a model of the arm's error to laser-tracker measurements."""
    from postproc import calibrating

    names = None if effects is None else split_names(effects)
    with explained():
        found = calibrating.fit_files(
            data,
            cell,
            output,
            program,
            method=method.value,
            effects=names,
            seed=seed,
        )
        say(found)


@app.command()
def predict(
    states: Annotated[Path, typer.Argument(help="STATES.csv")],
    cell: CellOption,
    model: ModelOption,
    output: Annotated[Path | None, typer.Option("-o", "--output")] = None,
) -> None:
    """Add the predicted error of every row; with positions, also the residual."""
    from postproc import calibrating

    with explained():
        text, summary = calibrating.predict_file(states, cell, model)
        write_text("-" if output is None else str(output), text)
        say(summary)


def split_names(text: str) -> list[str]:
    """Split a comma-separated list of names.

    >>> split_names("geometry, backlash,")
    ['geometry', 'backlash']
    """
    return [name.strip() for name in text.split(",") if name.strip()]


def write_text(target: str, text: str) -> None:
    """Write text to a file, or to stdout for ``-``.

    Raises:
        OutputError: The file cannot be written.
    """
    from postproc.files import write_all

    if target == "-":
        sys.stdout.write(text if text.endswith("\n") else text + "\n")
    else:
        write_all({Path(target): text.encode()})


def main() -> None:
    """Run the command line."""
    app()


__all__ = ["FileError", "app", "main"]
