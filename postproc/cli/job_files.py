"""Where what comes of a program goes: files, folders, standard output."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from postproc.cli.common import say, write_stdout
from postproc.cli.reports import NO_REPORTS, Reports
from postproc.compensation.outcome import Outcome
from postproc.compensation.output.sidecar import EDITED, SUFFIX, list_edited
from postproc.compensation.program_files import ProgramFiles
from postproc.exceptions import OutputError
from postproc.files import (
    STREAM,
    Content,
    check_places,
    is_stream,
    write_all,
)
from postproc.language.languages import file_named
from postproc.language.outputs import OUTPUT
from postproc.report.json import report_pieces


@dataclass(frozen=True)
class Destination:
    """Where the outputs of a program go.

    Attributes:
        given: The program and its files.
        inputs: Further files that were read, which no output may be.
    """

    given: ProgramFiles
    inputs: tuple[Path, ...] = ()

    def write(
        self,
        outcome: Outcome,
        output: Path | None = None,
        reports: Reports = NO_REPORTS,
        values: Path | None = None,
    ) -> list[Path]:
        """Write the program, its variable file, the record and the reports.

        A program from standard input or a pipe goes to standard output unless it is
        told where to. One that goes to standard output, a pipe or a device has no
        record, and files only where it is told to.

        Args:
            outcome: What came of the program.
            output: Where the program goes.
            reports: Where the reports go; the one for standard output is not written.
            values: Where the variable file goes, changed or not; default: beside the
                program, if it has changed.

        Returns:
            The files written.

        Raises:
            OutputError: An output is an input, cannot be written, or a part of the
                program has no place to go to.
        """
        inputs = (*self.given.inputs, *self.inputs)
        check_places([output, *reports.files, values], inputs)
        files: dict[Path, Content] = {
            place: report_pieces(outcome)
            for place in reports.json
            if place != Path(STREAM)
        }
        for place in reports.pages:
            from postproc.report.html import program_report

            files[place] = program_report(outcome).encode()
        if reports.tables:
            files |= _table_files(outcome, reports.tables)
        own = self.given.path
        target = output or (None if own is None else default_output(own))
        files |= self._results(outcome, target, values)
        check_places(files, inputs)
        records = [place for place in files if place.name.endswith(SUFFIX)]
        edited = [path for record in records for path in list_edited(record)]
        write_all(files)
        for path in edited:
            say(f"{path}: {EDITED}")
        if target is None:
            write_stdout(outcome.outputs[self.given.name])
        return list(files)

    def _results(
        self, outcome: Outcome, target: Path | None, values: Path | None
    ) -> dict[Path, Content]:
        """Name what a compensation gives, the file that users wait for last.

        Args:
            outcome: The compensation.
            target: Where the program goes, None for standard output.
            values: Where its variable file goes, None for beside it.

        Raises:
            OutputError: A part of the program has no place to go to.
        """
        files: dict[Path, Content] = {}
        for page in reversed(self.given.page_paths):
            if page.name in outcome.outputs:
                output = _file_of(target, page)
                beside = output.parent.resolve() == page.parent.resolve()
                place = default_output(page) if beside else output.with_name(page.name)
                files |= outcome.name_files({page.name: place}, place)
        own = self._own_places(outcome, target, values)
        variables = self.given.variables
        unchanged = file_named(self.given.name).variables not in own
        if values and variables is not None and unchanged:
            files[values] = variables
        # A record speaks of the files beside it.
        found: dict[Path, dict[str, Path]] = {}
        for name, path in own.items():
            folder = path if is_stream(path) else path.parent.resolve()
            found.setdefault(folder, {})[name] = path
        for places in found.values():
            files |= outcome.name_files(places, list(places.values())[-1])
        if target is not None and is_stream(target):
            files[target] = outcome.outputs[self.given.name]
        return files

    def _own_places(
        self, outcome: Outcome, target: Path | None, values: Path | None
    ) -> dict[str, Path]:
        """Tell where the program and its values go, where those are files."""
        name = file_named(self.given.name).variables
        own: dict[str, Path] = {}
        if name in outcome.outputs:
            changed = self.given.variables_path or Path(name)
            place = values or _file_of(target, changed)
            beside = place.with_name(file_named(place.name).variables)
            if place.suffix.isupper():  # JOB.PDL has JOB.LSV beside it
                beside = beside.with_suffix(beside.suffix.upper())
            own[name] = values or beside
        if target is not None and not is_stream(target):
            own[self.given.name] = target
        return own


def _table_files(outcome: Outcome, places: Iterable[Path]) -> dict[Path, Content]:
    """Write the tables of the page, all targets first."""
    from postproc.report.html import program_report
    from postproc.report.html.program import columns_of
    from postproc.report.html.target_fields import target_sheet
    from postproc.report.sheets import sheets_of_page, table_files

    targets = target_sheet(columns_of(outcome))
    sheets = [targets, *sheets_of_page(program_report(outcome))]
    files: dict[Path, Content] = {}
    for place in places:
        files |= table_files(place, sheets)
    return files


def _file_of(target: Path | None, part: Path) -> Path:
    """Return the file of a program, beside which a part of it may go.

    Raises:
        OutputError: The program goes to standard output, a pipe or a device.
    """
    if target is None or is_stream(target):
        how = "--variables-out FILE, or " if file_named(part).is_variables else ""
        raise OutputError(
            part,
            "changes too, and nothing says where it goes",
            f"Give {how}the program a file with -o",
        )
    return target


def default_output(program: Path) -> Path:
    """Name the output of a program.

    >>> default_output(Path("cell/job.pdl")).name
    'job.compensated.pdl'
    """
    return program.with_name(f"{program.stem}{OUTPUT}{program.suffix}")
