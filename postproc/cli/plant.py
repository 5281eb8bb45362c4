"""Commands on trees of programs: batch, check."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc.cli.common import TemperatureOption, app, explained, say

if TYPE_CHECKING:
    from postproc.batch.run import Gather
    from postproc.batch.summary import Summary

CellFile = Annotated[
    Path | None, typer.Option("--cell", help="Cell of programs that no rule fits.")
]
ModelFile = Annotated[
    Path | None, typer.Option("--model", help="Model of programs that no rule fits.")
]
PlanFile = Annotated[
    Path | None, typer.Option("--plan", help="Plan file: pattern -> cell, model.")
]


@app.command()
def batch(
    source: Annotated[Path, typer.Argument(metavar="SRC", help="Tree of programs.")],
    target: Annotated[Path, typer.Argument(metavar="DST", help="Tree to write.")],
    cell: CellFile = None,
    model: ModelFile = None,
    plan: PlanFile = None,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", min=0, help="Processes; 0: one for a core.")
    ] = 0,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", help="Dask: tcp://host:8786.")
    ] = None,
    tls: Annotated[
        Path | None,
        typer.Option("--tls", help="Folder with ca.pem, cert.pem and key.pem."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep what is done and unchanged.")
    ] = False,
    log: Annotated[
        Path | None, typer.Option("--log", help="Log; default: DST.batch.jsonl.")
    ] = None,
    clone: Annotated[
        bool, typer.Option("--clone", help="Clone variables whose arrivals disagree.")
    ] = False,
    temperature: TemperatureOption = None,
) -> None:
    """Compensate a tree of programs; what could not be compensated is not in DST.

    Example: postproc batch src dst --cell cell.toml --model model.json --resume
    """
    with explained():
        from postproc.batch import run
        from postproc.batch.plan import make_plan
        from postproc.console import progress_bar
        from postproc.options import Options

        made = make_plan(plan, cell, model, Options(clone, temperature=temperature))
        order = run.Order(source, target, made, log or run.default_log(target), resume)
        with progress_bar(f"{source} -> {target}") as told:
            summary = run.batch(order, _workers(jobs, scheduler, tls), told)
        _print_summary(summary)
        say(f"log: {order.log}")
        if summary.stopped:
            say("stopped; nothing is half written. Go on: same command with --resume")
    raise typer.Exit(summary.exit_code)


def _workers(jobs: int, scheduler: str | None, tls: Path | None) -> Gather:
    """Choose who does the work."""
    if scheduler is None:
        from postproc.batch.local import LocalCrew

        count = jobs or os.cpu_count() or 1
        return lambda plan: LocalCrew(plan.setups, count)
    from postproc.batch.cluster import ClusterCrew

    return lambda plan: ClusterCrew(plan.setups, scheduler, tls)


def _print_summary(summary: Summary) -> None:
    """Print the table, and what a person must look at."""
    from postproc.batch.summary import TITLES
    from postproc.console import Column, print_table, printable

    columns = [Column(t, "left" if t == TITLES[0] else "right") for t in TITLES]
    print_table(columns, summary.rows())
    for line in summary.lists():
        say(printable(line))
