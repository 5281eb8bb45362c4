"""Commands on trees of programs: batch, check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc.cli.common import (
    SetOption,
    app,
    changes_of,
    report_errors,
    say,
)
from postproc.cli.project import MAKE, cell_file, find_project, model_file
from postproc.cli.reports import PAGE, PageOption, ReportOption, Reports, TableOption
from postproc.cli.robot import record_file, release
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.exceptions import PostprocError
from postproc.files import check_places
from postproc.operating_system import count_cores

if TYPE_CHECKING:
    from postproc.batch.journal import Summary
    from postproc.batch.plan import BatchPlan
    from postproc.batch.run import BatchOptions, Gather
    from postproc.batch.second_opinion import TreeOpinion
    from postproc.record.robots import Release

CellFile = Annotated[
    Path | None,
    typer.Option(
        "--cell", help="Cell (TOML); with --plan, of programs that no rule matches."
    ),
]
ModelFile = Annotated[
    Path | None,
    typer.Option(
        "--model", help="Model (JSON); with --plan, of programs that no rule matches."
    ),
]
PlanFile = Annotated[
    Path | None,
    typer.Option("--plan", help="Plan (TOML): the cell and model of each program."),
]


@app.command()
def batch(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SRC]", help="Tree of programs. Default: the project's."
        ),
    ] = None,
    target: Annotated[
        Path | None,
        typer.Argument(metavar="[DST]", help="Tree to write. Default: the project's."),
    ] = None,
    cell: CellFile = None,
    model: ModelFile = None,
    plan: PlanFile = None,
    jobs: Annotated[
        str,
        typer.Option(
            "--jobs",
            "-j",
            metavar="N",
            help="Processes, 0: one for a core; or a Dask scheduler, tls://host:8786.",
        ),
    ] = "0",
    resume: Annotated[
        bool, typer.Option("--resume", help="Skip finished, unchanged files.")
    ] = False,
    stale: Annotated[
        bool, typer.Option("--stale", help="Make only stale programs of robots again.")
    ] = False,
    report: PageOption = None,
    table: TableOption = None,
    changes: SetOption = None,
) -> None:
    """Compensate a tree of programs; programs that fail are not written to DST.

    Exit 0: every target that can be corrected is; 1: some are not; 2: a program failed.
    """
    with report_errors():
        source, target = _trees(source, target)
        if plan is None:
            cell, model = cell_file(cell, source), model_file(model, source)
        if not _is_address(jobs):
            _count(jobs)
            from postproc.batch.workers import start_server

            start_server()
        from postproc.batch import run
        from postproc.batch.plan import make_plan
        from postproc.report.terminal import progress_bar

        asked = changes_of(changes)
        made = make_plan(plan, cell, model, DEFAULT_OPTIONS, asked)
        reports = Reports.of(report, PAGE, tables=table)
        check_places(reports.files, [cell, model, plan])
        for line in _archive_lines(source, made):
            say(line)
        log, only = run.default_log(target), _stale_below(source) if stale else None
        order = run.BatchOptions(source, target, made, log, resume or stale, only)
        with progress_bar(f"{source} -> {target}") as told:
            summary = run.batch(order, _workers(jobs), told)
        release(source, lambda: _list_releases(order))
        _print_summary(summary, table=not reports.on_stdout)
        say(f"log: {order.log}")
        _write_reports(reports, f"{source} -> {target}", order.log)
        if summary.stopped:
            say("stopped; nothing is half written. Go on: same command with --resume")
    raise typer.Exit(summary.exit_code)


def _trees(source: Path | None, target: Path | None) -> tuple[Path, Path]:
    """Return the trees that are given, else those of the project.

    Raises:
        PostprocError: Nothing names one of them.
    """
    project = None if source and target else find_project(source)
    if project is not None:
        source, target = source or project.source, target or project.output
    if source is None or target is None:
        where = f"name source and output in {project.path}" if project else MAKE
        raise PostprocError(f"batch: give SRC and DST, or {where}")
    return source, target


def _archive_lines(source: Path, plan: BatchPlan) -> list[str]:
    """Return what the archive of a controller gives, and what the cell lacks."""
    from postproc.batch.archive import missing_in_cell
    from postproc.language.languages import languages

    cells = [setup.cell for setup in plan.setups]
    found = []
    for language in languages() if source.is_dir() else ():
        ours = [cell for cell in cells if language.controller in cell.controllers]
        archive = language.read_archive(source) if ours else None
        found += [] if archive is None else missing_in_cell(archive, ours[0])
    return found


def _count(jobs: str) -> int:
    """Return how many processes are asked for.

    Raises:
        PostprocError: It is neither a number nor the address of a scheduler.
    """
    if not jobs.isascii() or not jobs.isdigit():
        raise PostprocError(
            f"--jobs {jobs}: give the number of processes, 0 for one for a core, or "
            "the address of a Dask scheduler, such as tls://host:8786"
        )
    return int(jobs) or count_cores()


def _is_address(jobs: str) -> bool:
    """Return True if work goes to a cluster."""
    return "://" in jobs


def _workers(jobs: str) -> Gather:
    """Choose who does the work."""
    if _is_address(jobs):
        from postproc.batch.cluster import ClusterPool

        return lambda plan: ClusterPool(plan.setups, jobs)
    from postproc.batch.workers import LocalPool

    return lambda plan: LocalPool(plan.setups, _count(jobs))


def _print_summary(summary: Summary, table: bool) -> None:
    """Print the table, and what a person must look at."""
    from postproc.batch.journal import TITLES
    from postproc.report.terminal import Column, print_table

    columns = [Column(t, "left" if t == TITLES[0] else "right") for t in TITLES]
    if table:
        print_table(columns, summary.rows())
    for line in summary.lists():
        say(line)


def _stale_below(source: Path) -> frozenset[str]:
    """Return the stale programs of a tree, by their places below it.

    Raises:
        RecordError: There is no record.
    """
    from postproc.record.database import open_record
    from postproc.record.stale import list_stale

    with open_record(record_file(None, source)) as record:
        folder = record.path.parent
        found = [(folder / row.path).resolve() for row in list_stale(record)]
    root = source.resolve()
    below = (place for place in found if place.is_relative_to(root))
    return frozenset(place.relative_to(root).as_posix() for place in below)


def _list_releases(order: BatchOptions) -> list[Release]:
    """List the programs of a tree that were compensated for robots with numbers."""
    from postproc.batch.journal import read_entries
    from postproc.compensation.output.sidecar import read_sidecar, sidecar_path
    from postproc.record.robots import Release

    setups = [(s.model.id, s.cell.file.robot.serial_number) for s in order.plan.setups]
    serials = {model: serial for model, serial in setups if serial is not None}
    found = []
    for entry in read_entries(order.log).values() if serials else ():
        output = order.target / entry.place
        if entry.place in entry.outputs and sidecar_path(output).exists():
            model = read_sidecar(sidecar_path(output)).model
            if model in serials:
                digest = entry.outputs[entry.place]
                original = order.source / entry.place
                found.append(Release(serials[model], original, output, model, digest))
    return found


def _write_reports(reports: Reports, title: str, log: Path) -> None:
    """Write reports of a batch from its log, which holds what earlier runs did too."""
    from postproc.batch.journal import read_entries
    from postproc.report.html import batch_report
    from postproc.report.json import tree_json

    entries = read_entries(log).values() if reports.files else ()
    found = [(entry.place, entry.status, entry.facts) for entry in entries]
    reports.write_json(lambda: tree_json(found))
    reports.write_pages(lambda: batch_report(title, found))
    for place in reports.pages:
        say(f"written {place}")


@app.command()
def check(
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="[DIR]", help="Compensated tree. Default: the project's output."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", help="Current model (JSON). Default: any model."),
    ] = None,
    plan: PlanFile = None,
    source: Annotated[
        Path | None,
        typer.Option("--source", help="Tree of the originals. Default: not compared."),
    ] = None,
    allow_uncorrected: Annotated[
        bool,
        typer.Option("--allow-uncorrected", help="Accept uncorrected targets."),
    ] = False,
    changes: SetOption = None,
    report: ReportOption = None,
    cell: CellFile = None,
) -> None:
    """Check whether a tree may be uploaded: exit 0 yes, 1 no, 2 error.

    Every program must be compensated, with all its targets, and unchanged since. With
    --model it must be by this model, with --source from the source as it is now. With
    --cell and --model, or --plan, the libraries pin, toppra and ruckig check the motion
    too, if they are installed.
    """
    from postproc.batch.check import check as look
    from postproc.robot.cell import verify_section

    with report_errors():
        if folder is None:
            project = find_project()
            if project is None or project.output is None:
                raise PostprocError(f"check: give DIR, or {MAKE}")
            folder, source = project.output, source or project.source
            if plan is None:
                cell = cell_file(cell, folder)
                model = model_file(model, folder)
        reports = Reports.of(report)
        verify, asked = verify_section(changes_of(changes))
        insists = verify.second_opinion if verify.model_fields_set else None
        found = look(
            folder, model=model, plan=plan, source=source, cell=cell, changes=asked
        )
        if allow_uncorrected:
            found = found.allow_uncorrected()
        judged = _second_opinion(folder, (cell, model, plan), insists, asked)
        opinion = None if judged is None else judged.to_dict()
        reports.write_json(lambda: found.to_json(opinion))
        for finding in found.findings:
            say(str(finding))
        if judged is not None:
            _print_opinion(judged)
        say(f"{folder}: {found.programs} programs, {len(found.findings)} findings")
    code = max(found.exit_code, 0 if judged is None else judged.exit_code)
    if insists and judged is not None and judged.skipped:
        code = code or 2  # what was asked for could not be given
    raise typer.Exit(code)


Places = tuple[Path | None, Path | None, Path | None]  # of cell, model, plan


def _second_opinion(
    folder: Path, places: Places, asked: bool | None, changes: Sequence[str]
) -> TreeOpinion | None:
    """Judge a tree by other libraries; None where they or cells and models lack.

    Raises:
        PostprocError: Somebody asked for it, and it cannot be given.
    """
    from postproc.verify.extra import INSTALL, explain_missing, load, missing

    if asked is False:
        return None
    if not asked and (lacks := missing()):
        say(f"no second opinion: {' and '.join(lacks)} not installed ({INSTALL})")
        return None
    cell, model, plan = places
    if not asked and plan is None and None in (cell, model):
        say("no second opinion on the motion: it needs --cell and --model, or --plan")
        return None
    if asked:
        load()
    elif problem := explain_missing():
        say(problem)
        return None
    from postproc.batch.plan import make_plan
    from postproc.batch.second_opinion import judge_tree
    from postproc.batch.tree import scan
    from postproc.language.languages import file_named

    own = (None, None) if cell is None and plan is not None else (cell, model)
    made = make_plan(plan, *own, DEFAULT_OPTIONS, changes)
    judged = judge_tree(folder, made)
    refused = sorted(scan(folder, made).refused.items())
    outside = [(place, why) for place, why in refused if file_named(place).is_program]
    return replace(judged, skipped=(*judged.skipped, *outside))


def _print_opinion(judged: TreeOpinion) -> None:
    """Print the table of a second opinion, and which programs have none."""
    from postproc.report.second_opinion import print_opinion

    for place, why in judged.skipped:
        say(f"{place}: no second opinion: {why}")
    if judged.programs:
        print_opinion(judged.opinion)
    else:
        say("no second opinion: no program could be judged")
