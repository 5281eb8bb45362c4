"""The line that a message speaks of, with a caret under the place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from postproc.compensation.outcome import Outcome
from postproc.exceptions import FileError, printable
from postproc.language.text.source import Source
from postproc.language.visits import Visits

WIDTH = 96  # characters of a line that are shown
LEAD = 30  # of them before the caret, where the line is longer
LONGEST = 2000  # characters of a line that are looked at
MOST_BYTES = 200_000_000  # a file larger than this is not read again for a message


def point_at(error: FileError, files: Iterable[Path | None] = ()) -> str:
    """Show the line that an error speaks of; "" where there is none to show.

    Args:
        error: It names a file and a line, or a place in a TOML file.
        files: Files that it may mean where it gives a bare name.
    """
    text = _read(error.path, files)
    if text is None:
        return ""
    lines = re.split(r"\r\n|\n|\r", text)
    line = error.line
    if line is None and error.path.lower().endswith(".toml"):
        line = toml_line(lines, error.place)
    if line is None or not 1 <= line <= len(lines):
        return ""
    source = lines[line - 1]
    if error.column is not None:
        return excerpt(source, line, error.column)
    key = re.sub(r"\[\d+\]", "", error.place).rpartition(".")[2]
    quoted = re.findall(r"'([^']+)'", error.problem)
    for token in (*quoted, key):
        if token and token in source:
            return excerpt(source, line, source.index(token) + 1, len(token))
    return excerpt(source, line, 1, len(source))


def point_at_visits(outcome: Outcome, rows: Iterable[int]) -> list[str]:
    """Show the lines of moves, each with a caret at its numbers if they are there.

    Args:
        outcome: A compensation that keeps its sources.
        rows: Indices of visits.
    """
    sources = {name: Source(name, data) for name, data in outcome.sources.items()}
    v = outcome.visits
    names = ((i, v.file_name(i)) for i in rows)
    return [_at_visit(sources[n], v, i) if n in sources else "" for i, n in names]


def _at_visit(source: Source, v: Visits, i: int) -> str:
    """Show the line of visit i's move."""
    line, literal = int(v.place.line[i]), int(v.target.literal[i])
    first = int(source.line_starts[line - 1])
    text = source.data[first : first + LONGEST].decode("latin-1")
    text = re.split(r"[\r\n]", text)[0]
    if literal >= 0 and v.literals.file[literal] == v.place.file[i]:
        places = v.literals.places[literal : literal + 1]
        start, end = int(places.start.min()) - first, int(places.end.max()) - first
        if v.literals.line[literal] == line and 0 <= start < len(text):
            return excerpt(text, line, start + 1, end - start)
    return excerpt(text, line, 1, len(text))


def excerpt(source: str, line: int, column: int, length: int = 1) -> str:
    r"""Show a line with a caret.

    Args:
        source: The line.
        line: Its 1-based number.
        column: 1-based column of the caret; blanks there are skipped.
        length: How many characters are meant.

    >>> print(excerpt("a := 1 + x", 7, 6, 5))
          7 | a := 1 + x
            |      ^~~~~
    """
    end = min(column - 1 + length, len(source.rstrip()))
    head, middle = source[: column - 1], source[column - 1 : end]
    idle = len(middle) - len(middle.lstrip())
    head, middle = head + middle[:idle], middle[idle:]
    before, meant = printable(head.expandtabs(4)), printable(middle)
    rest = printable(source[end:])
    if len(before) + len(meant) + len(rest) > WIDTH and len(before) > LEAD:
        before = "…" + before[len(before) - LEAD + 1 :]
    shown = before + meant + rest
    if len(shown) > WIDTH:
        shown = shown[: WIDTH - 1] + "…"
    under = "^" + "~" * (min(len(meant), WIDTH - len(before)) - 1)
    return f"{line:7d} | {shown}\n        | {' ' * len(before)}{under}"


def toml_line(lines: Sequence[str], place: str) -> int | None:
    """Find the line of a place such as ``$.tool.xyz_mm``, or of its table.

    >>> toml_line(["[robot]", "", "[tool]", "xyz = [1]"], "$.tool.xyz")
    4
    >>> toml_line(["[robot]", "[tool]", "xyz = [1]"], "$.tool.source")
    2
    """
    wanted = place.removeprefix("$").lstrip(".")
    found, table = None, ""
    count: dict[str, int] = {}
    for number, text in enumerate(lines, start=1):
        header = re.match(r"\s*(\[\[?)\s*(.+?)\s*\]", text)
        if header and not text.lstrip().startswith("[["):
            table = _plain(header.group(2))
        elif header:
            name = _plain(header.group(2))
            count[name] = count.get(name, 0) + 1
            table = f"{name}[{count[name]}]"
        key = re.match(r"\s*([\w.\-\"',]+)\s*=", text)
        own = f"{table}.{_plain(key.group(1))}".lstrip(".") if key else table
        if own and (wanted == own or wanted.startswith((f"{own}.", f"{own}["))):
            found = number if found is None or key else found
            if key:
                return number
    return found


def _plain(name: str) -> str:
    """Write a TOML key as messages do, without quotes."""
    return re.sub(r"[\"'\s]", "", name)


def _read(path: str, files: Iterable[Path | None]) -> str | None:
    """Read the file that a message names, None where it cannot be had."""
    places = [*(f for f in files if f is not None and f.name == path), Path(path)]
    for place in places:
        try:
            if place.is_file() and place.stat().st_size <= MOST_BYTES:
                return place.read_bytes().decode("latin-1")
        except OSError:
            continue
    return None
