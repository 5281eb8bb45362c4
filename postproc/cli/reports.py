"""Where reports go: the ending of a file decides what kind it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer

from postproc.cli.common import say, write_text
from postproc.exceptions import PostprocError
from postproc.files import STREAM, is_stream, write_all

JSON, PAGE, PLOTS = ".json", ".html", (".svg", ".png")
TABLES = (".csv", ".xlsx")
Text = Callable[[], str | Iterable[str]]


def _option(endings: str) -> Any:
    """Return --report of a command that writes files of some endings."""
    text = f"Write a report: FILE{endings}, - for JSON on stdout."
    return typer.Option("--report", metavar="FILE", help=text)


ReportOption = Annotated[list[Path] | None, _option(".json")]
PageOption = Annotated[list[Path] | None, _option(".html or .json")]
TableOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--table",
        metavar="FILE",
        help="Write its tables: FILE.csv or .xlsx.",
    ),
]
PlotOption = Annotated[list[Path] | None, _option(".html, .json, .svg or .png")]


@dataclass(frozen=True)
class Reports:
    """The reports that a command was asked for.

    Attributes:
        json: Files of JSON, ``-`` for standard output.
        pages: Pages for a browser.
        plots: Pictures.
        tables: Tables of the page, as CSV or as workbooks.
    """

    json: tuple[Path, ...] = ()
    pages: tuple[Path, ...] = ()
    plots: tuple[Path, ...] = ()
    tables: tuple[Path, ...] = ()

    @classmethod
    def of(
        cls,
        given: Sequence[Path] | None,
        *kinds: str,
        tables: Sequence[Path] | None = None,
    ) -> Reports:
        """Sort files by their endings; what has no name that lasts is JSON.

        Raises:
            PostprocError: A command writes no report of an ending, or matplotlib is
                not installed.
        """
        sorted_: dict[str, list[Path]] = {kind: [] for kind in (JSON, *kinds)}
        for place in given or ():
            kind = JSON if is_stream(place) else place.suffix.lower()
            if kind not in sorted_:
                known = ", ".join(f"FILE{one}" for one in sorted_)
                raise PostprocError(
                    f"--report {place}: the ending names no kind of report. Write "
                    f"{known}, or - for JSON on standard output"
                )
            sorted_[kind].append(place)
        plots = [place for kind in PLOTS for place in sorted_.get(kind, ())]
        if plots and find_spec("matplotlib") is None:
            raise PostprocError(
                f"--report {plots[0]}: pictures need matplotlib. Install it with "
                "pip install 'postproc[plots]', or write a page (FILE.html)"
            )
        for place in tables or ():
            if place.suffix.lower() not in TABLES:
                raise PostprocError(
                    f"--table {place}: write {' or '.join(f'FILE{e}' for e in TABLES)}"
                )
        pages = tuple(sorted_.get(PAGE, ()))
        return cls(tuple(sorted_[JSON]), pages, tuple(plots), tuple(tables or ()))

    @property
    def files(self) -> tuple[Path, ...]:
        """Return all places."""
        return (*self.json, *self.pages, *self.plots, *self.tables)

    @property
    def on_stdout(self) -> bool:
        """Whether JSON goes to standard output, where nothing else may go then."""
        return Path(STREAM) in self.json

    def write_json(self, text: Text) -> None:
        """Write the JSON, which is made only where it is asked for.

        Raises:
            OutputError: A file cannot be written.
        """
        for place in self.json:
            write_text(str(place), text())

    def write_pages(self, text: Text) -> None:
        """Write the pages, likewise, and the tables that stand on them.

        Raises:
            OutputError: A file cannot be written, or a library for it is missing.
        """
        for place in self.pages:
            write_text(str(place), text())
        if self.tables:
            from postproc.report.sheets import sheets_of_page, table_files

            sheets = sheets_of_page("".join(text()))
            for place in self.tables:
                write_all(files := table_files(place, sheets))
                for path in files:
                    say(f"written {path}")

    def write_plots(self, plot: Callable[[Path], Iterable[Path]]) -> None:
        """Draw the plots, and name each that is written."""
        for place in self.plots:
            for path in plot(place):
                say(f"plot {path}")


NO_REPORTS = Reports()
