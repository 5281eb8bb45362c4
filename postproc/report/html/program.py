"""The page of a compensated program: what moved, by how much, and what did not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints
from postproc.compensation.outcome import Outcome, Status
from postproc.language.languages import language_of
from postproc.language.text.source import Source
from postproc.language.visits import Meaning
from postproc.report.head import ReportHead
from postproc.report.html.distribution import distribution
from postproc.report.html.page import render, short, visible
from postproc.report.html.page_columns import MOVES, VERDICTS, VIA, PageColumns
from postproc.report.html.target_fields import FIELDS
from postproc.report.json import JOINTS, error_summary_of, finite, in_time_of
from postproc.report.second_opinion import opinion_table
from postproc.report.tolerance import ALL_WORDS, tolerance_json
from postproc.robot.pose import MM
from postproc.verify.opinion import Opinion


@dataclass(frozen=True)
class PageShares:
    """How much of the predicted error of n visits is of which of k effects.

    Attributes:
        effects: Names of the effects, and of their interaction.
        size_mm: Size of every share, (n, k).
        free_mm, free_std_mm: What free forms predict, and its standard error per axis,
            (n, 3); (n, 0) without free forms.
    """

    effects: tuple[str, ...]
    size_mm: Floats
    free_mm: Floats
    free_std_mm: Floats


@dataclass(frozen=True)
class ProgramPage:
    """Everything that the program page shows.

    Attributes:
        name: Of the program.
        model: Id of the model.
        columns: All visits.
        predicted: Error statistics by "before" and "after", then by name.
        diagnostics: Rows of file, line, code and message.
        stages: Seconds by stage.
        sources: Bytes by file name; empty where they are not at hand.
        shares: What the effects do; none where the report does not say.
        motion: Largest changes of joints, elbow and wrist centre; empty likewise.
        in_time: The keys of the report that tell of time and paths; empty likewise.
        opinion: The second opinion; None likewise.
        head: Which robot, program, model, and when.
        expected: The keys of the report that tell of expected errors; empty likewise.
        tolerance: .. of the tolerance.
    """

    name: str
    model: str
    columns: PageColumns
    predicted: Mapping[str, Mapping[str, float | None]]
    diagnostics: tuple[Mapping[str, object], ...]
    stages: Mapping[str, float]
    sources: Mapping[str, bytes]
    shares: PageShares
    motion: Mapping[str, float]
    in_time: Mapping[str, Any]
    opinion: Opinion | None
    head: ReportHead
    expected: Mapping[str, Any] = field(default_factory=dict)
    tolerance: Mapping[str, Any] = field(default_factory=dict)


def columns_of(outcome: Outcome) -> PageColumns:
    """Take the columns out of an outcome."""
    v, d = outcome.visits, outcome.decisions
    n, has = len(v), v.target.literal >= 0
    literal = np.where(has, v.target.literal, 0)
    nowhere = np.full(n, -1)
    empty = len(v.literals) == 0
    place = (nowhere, nowhere) if empty else (v.literals.file, v.literals.line)
    known = len(outcome.position) == n
    position = outcome.position / MM if known else np.full((n, 3), np.nan)
    blank = np.where(np.arange(v.target.values.shape[1]) < JOINTS, 0.0, np.nan)
    blank = np.where((v.target.meaning == Meaning.JOINTS)[:, None], blank, 0.0)
    blank[~has] = np.nan
    return PageColumns(
        files=v.files,
        names=v.target.names,
        reasons=tuple(reason.text for reason in d.reasons),
        heads=v.dialect.heads,
        visit=np.arange(1, n + 1),
        file=v.place.file,
        line=v.place.line,
        literal_file=nowhere if empty else np.where(has, place[0][literal], -1),
        literal_line=nowhere if empty else np.where(has, place[1][literal], -1),
        name=v.target.name,
        move=np.where(v.motion.via, VIA, v.motion.kind),
        status=d.status,
        why=d.why,
        direction=np.asarray(d.direction, dtype=np.int64),
        q_deg=np.rad2deg(d.q),
        original=v.target.values + blank,
        corrected=d.corrected + blank,
        position_mm=position,
        correction_mm=d.correction / MM,
        std_mm=d.std_error / MM,
        expected_mm=_stack_errors(outcome),
        verdict=np.full(n, len(ALL_WORDS))
        if outcome.tolerance is None
        else np.asarray(outcome.tolerance.verdict, dtype=np.int64),
    )


def _stack_errors(outcome: Outcome) -> Floats:
    """Stack expected errors and their bounds, (n, 3) [mm]."""
    errors = outcome.expected
    if errors is None:
        return np.full((len(outcome.visits), 3), np.nan)
    return np.stack([errors.before, errors.after, errors.high], axis=1) / MM


def shares_of(outcome: Outcome) -> PageShares:
    """Take the shares of effects out of an outcome, as far as reports tell them."""
    told, rows = outcome.reported.arrivals, np.arange(len(outcome.visits))
    none = np.empty((len(rows), 0))
    if told is None:
        return PageShares((), none, none, none)
    sizes = told.sizes(rows) / MM
    if not told.free_forms:
        return PageShares(told.effects, sizes, none, none)
    free, std = np.moveaxis(told.free(rows) / MM, 1, 0)
    return PageShares(told.effects, sizes, free, std)


# The columns of the program page out of a written report.


class Texts:
    """Distinct texts in order of appearance; number 0 is "".

    >>> texts = Texts()
    >>> texts.index(["a", None, "b", "a"]).tolist(), texts.all
    ([1, 0, 2, 1], ('', 'a', 'b'))
    """

    def __init__(self) -> None:
        """Start with no text but "" ."""
        self._number: dict[str, int] = {"": 0}

    def index(self, texts: Sequence[object]) -> NDArray[np.int64]:
        """Number texts; None is ""."""
        put = self._number.setdefault
        told = ("" if t is None else str(t) for t in texts)
        return np.array([put(t, len(self._number)) for t in told], dtype=np.int64)

    @property
    def all(self) -> tuple[str, ...]:
        """Return the texts by number."""
        return tuple(self._number)


EXPECTED = ("expected_before_mm", "expected_mm", "bound_95_mm")


def columns_from(
    targets: Sequence[Mapping[str, Any]], verdicts: Sequence[str] = ()
) -> PageColumns:
    """Take the columns out of the targets of a report.

    Args:
        targets: The targets.
        verdicts: Of each against a tolerance; none where nobody asked.

    Raises:
        KeyError, ValueError, TypeError: They are not the targets of a report.
    """
    files, names, reasons = Texts(), Texts(), Texts()
    literals = [t["literal"] or {"file": "", "line": -1} for t in targets]
    width = max([6, *(len(t.get("original") or ()) for t in targets)])
    place = files.index([p["file"] for p in literals])
    statuses = {s.name.lower(): int(s) for s in Status}
    moves = {name: k for k, name in enumerate(MOVES)}
    return PageColumns(
        visit=np.arange(1, len(targets) + 1),
        file=files.index([t["file"] for t in targets]),
        line=np.array([t["line"] for t in targets], dtype=np.int64),
        literal_file=np.where(place > 0, place, -1),
        literal_line=np.array([p["line"] for p in literals], dtype=np.int64),
        name=names.index([t["name"] for t in targets]),
        move=np.array([moves[t["move"]] for t in targets], dtype=np.int64),
        status=np.array([statuses[t["status"]] for t in targets], dtype=np.int64),
        why=reasons.index([t["reason"] for t in targets]),
        direction=_numbers(targets, "lambda", 6).astype(np.int64),
        q_deg=_numbers(targets, "q_deg", 6),
        original=_numbers(targets, "original", width),
        corrected=_numbers(targets, "corrected", width),
        position_mm=_numbers(targets, "position_mm", 3),
        correction_mm=_numbers(targets, "correction_mm", 3),
        std_mm=_numbers(targets, "std_error_mm", 3),
        expected_mm=np.array(
            [[t.get(name) for name in EXPECTED] for t in targets], dtype=np.float64
        ).reshape(len(targets), 3),
        verdict=np.array(
            [VERDICTS.index(v) for v in verdicts or [""] * len(targets)], dtype=np.int64
        ),
        files=files.all,
        names=names.all,
        reasons=reasons.all,
        heads=_heads(targets),
    )


def _heads(targets: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return what the language of targets heads the numbers of a pose with."""
    return language_of(str(targets[0]["file"])).dialect.heads if targets else ()


def shares_from(targets: Sequence[Mapping[str, Any]]) -> PageShares:
    """Take the shares of effects out of the targets of a report.

    Raises:
        KeyError, ValueError, TypeError: They are not the targets of a report.
    """
    told = [t.get("share_mm") or {} for t in targets]
    effects = tuple(dict.fromkeys(str(name) for shares in told for name in shares))
    rows = [[shares.get(name) for name in effects] for shares in told]
    size = np.array(rows, dtype=np.float64).reshape(len(targets), len(effects))
    axes = 3 if any("nonparametric_mm" in t for t in targets) else 0
    free, std = (
        _numbers(targets, k, axes) for k in ("nonparametric_mm", "nonparametric_std_mm")
    )
    return PageShares(effects, size, free, std)


def _numbers(targets: Sequence[Mapping[str, Any]], key: str, width: int) -> Floats:
    """Stack the lists under a key, (n, width); NaN where there is none."""
    blank = [None] * width
    lists = [t.get(key) or blank for t in targets]
    return np.array(lists, dtype=np.float64).reshape(len(targets), width)


# Columns as JSON that is small enough for a page.

MOST = 100_000  # visits that a page carries
LARGEST = 2_000  # of the largest corrections, carried whatever is left out
# Steps in which numbers are stored: finer than anybody reads, coarser than the digits
# of a double.
STEPS = {
    "q_deg": 1e-3,
    "original": 1e-5,
    "change": 1e-5,
    "position_mm": 1e-2,
    "correction_mm": 1e-4,
    "std_mm": 1e-4,
    "expected_mm": 1e-4,
    "share_mm": 1e-4,
    "nonparametric_mm": 1e-4,
    "nonparametric_std_mm": 1e-4,
}


def choose(columns: PageColumns, most: int = MOST) -> Ints:
    """Choose the visits that a page carries.

    Of a program with more than `most`, these are the visits left alone (at most half of
    the page), the largest corrections, and of the others every k-th.

    Returns:
        Indices, ascending.
    """
    n = len(columns)
    if n <= most:
        return np.arange(n)
    left = np.flatnonzero(
        np.isin(columns.status, (Status.CONFLICT, Status.REJECTED, Status.RUNTIME))
    )
    left = _evenly(left, most // 2)
    size = np.nan_to_num(columns.size_mm)
    largest = np.argsort(-size, kind="stable")[: min(LARGEST, most // 4)]
    first = np.union1d(left, largest)
    rest = np.setdiff1d(np.arange(n), first, assume_unique=True)
    return np.union1d(first, _evenly(rest, most - len(first)))


def _evenly(rows: Ints, most: int) -> Ints:
    if len(rows) <= most:
        return rows
    return rows[np.arange(most) * len(rows) // most]


DECIDED = ("status", "why", "verdict")


def pack(columns: PageColumns, shares: PageShares) -> dict[str, Any]:
    """Write columns as lists of integers, with the size of a step beside them.

    Args:
        columns: The visits on the page.
        shares: Of all visits.
    """
    effects = [visible(name) for name in shares.effects]
    numbers = {
        "original": columns.original,
        "change": columns.corrected - columns.original,
        "q_deg": columns.q_deg,
        "position_mm": columns.position_mm,
        "correction_mm": columns.correction_mm,
        "std_mm": columns.std_mm,
        "expected_mm": columns.expected_mm,
        "share_mm": shares.size_mm[columns.visit - 1],
        "nonparametric_mm": shares.free_mm[columns.visit - 1],
        "nonparametric_std_mm": shares.free_std_mm[columns.visit - 1],
    }
    packed = {
        key: {
            "step": STEPS[key],
            "width": values.shape[1],
            "values": integers(values, STEPS[key]),
        }
        for key, values in numbers.items()
    }
    indices = ("visit", "file", "line", "literal_file", "literal_line", "name", "move")
    return {
        "files": [visible(t) for t in columns.files],
        "names": [visible(t) for t in columns.names],
        "reasons": [visible(t) for t in columns.reasons],
        "moves": list(MOVES),
        "statuses": [s.name.lower() for s in Status],
        "effects": effects,
        "heads": list(columns.heads),
        "verdicts": list(VERDICTS),
        "index": {k: getattr(columns, k).tolist() for k in (*indices, *DECIDED)},
        "direction": _signs(columns.direction),
        "numbers": packed,
    }


def integers(values: Floats, step: float) -> list[int | None]:
    """Round to multiples of a step; what is not known becomes None.

    >>> integers(np.array([0.12345, np.nan]), 1e-4)
    [1234, None]
    """
    flat = np.asarray(values, dtype=np.float64).ravel() / step
    known = np.isfinite(flat)
    out: list[int | None] = np.rint(np.where(known, flat, 0.0)).astype(int).tolist()
    for k in np.flatnonzero(~known).tolist():
        out[k] = None
    return out


def _signs(direction: Ints) -> str:
    """Write directions as one text, a character each: ``-``, ``0`` or ``+``."""
    return "".join(np.array(["-", "0", "+"])[np.sign(direction).ravel() + 1].tolist())


# Source lines for a page: all of a small program, the moves of a large one.

WHOLE = 150_000  # lines of all files together, up to which the page carries them all
LONGEST = 500  # characters of a line

Listing = dict[str, dict[str, list[int] | list[str]]]


def listing(sources: Mapping[str, bytes], columns: PageColumns) -> Listing:
    """Choose the lines that a page shows.

    Args:
        sources: Bytes by file name, perhaps none.
        columns: The visits on the page.

    Returns:
        By file name ``line``, the first line of every stretch and how many there are,
        alternating, and ``text``, the lines.
    """
    given = {name: Source(name, data) for name, data in sources.items()}
    total = sum(len(source.line_starts) for source in given.values())
    out: Listing = {}
    for name, source in given.items():
        last = len(source.line_starts)
        wanted = (
            np.arange(1, last + 1)
            if total <= WHOLE
            else _list_used_lines(columns, name)
        )
        wanted = wanted[(wanted >= 1) & (wanted <= last)]
        out[visible(name)] = {"line": stretches(wanted), "text": _texts(source, wanted)}
    return out


def _list_used_lines(columns: PageColumns, name: str) -> NDArray[np.int64]:
    """Return the lines of a file that the visits name, ascending."""
    pairs = (
        (columns.file, columns.line),
        (columns.literal_file, columns.literal_line),
    )
    number = [k for k, file in enumerate(columns.files) if file == name]
    lines = [line[np.isin(file, number)] for file, line in pairs]
    return np.unique(np.concatenate(lines))


def stretches(lines: NDArray[np.int64]) -> list[int]:
    """Pack ascending line numbers.

    >>> stretches(np.array([3, 4, 5, 9]))
    [3, 3, 9, 1]
    """
    if len(lines) == 0:
        return []
    first = np.flatnonzero(np.diff(lines, prepend=lines[0] - 2) != 1)
    count = np.diff(np.append(first, len(lines)))
    return [int(v) for v in np.column_stack([lines[first], count]).ravel()]


def _texts(source: Source, lines: Iterable[int]) -> list[str]:
    """Take lines out of a file, fit to look at."""
    starts = np.append(source.line_starts, len(source.data)).tolist()
    text = source.text
    return [
        short(visible(text[starts[k - 1] : starts[k]].rstrip("\r\n")), LONGEST)
        for k in np.asarray(lines).tolist()
    ]


# The figures and lists that stand on a page before any script runs.

BINS = 40
EXAMPLES = 12  # visits named in a group
LEFT_ALONE = (Status.CONFLICT, Status.REJECTED, Status.RUNTIME)  # most urgent first


@dataclass(frozen=True)
class UncorrectedGroup:
    """Visits that were left alone for the same reason.

    Attributes:
        status: Name of the status.
        why: The reason.
        count: How many visits.
        examples: Number, file and line, name of the first ones.
    """

    status: str
    why: str
    count: int
    examples: tuple[tuple[int, str, int, str], ...]


@dataclass(frozen=True)
class Stage:
    """Seconds spent in a stage and their share of the whole."""

    name: str
    seconds: float
    share: float


def group_uncorrected(columns: PageColumns) -> tuple[UncorrectedGroup, ...]:
    """Group what was not corrected by status and reason, the largest group first."""
    groups = []
    for status in LEFT_ALONE:
        mine = columns.status == status
        codes, counts = np.unique(columns.why[mine], return_counts=True)
        for k in np.argsort(-counts, kind="stable"):
            rows = np.flatnonzero(mine & (columns.why == codes[k]))
            groups.append(
                UncorrectedGroup(
                    status.name.lower(),
                    columns.reasons[codes[k]],
                    int(counts[k]),
                    tuple(_place(columns, int(i)) for i in rows[:EXAMPLES]),
                )
            )
    return tuple(groups)


def _place(columns: PageColumns, i: int) -> tuple[int, str, int, str]:
    """Say which visit, and where its move stands."""
    return (
        int(columns.visit[i]),
        columns.files[columns.file[i]],
        int(columns.line[i]),
        columns.names[columns.name[i]],
    )


def histogram(columns: PageColumns) -> dict[str, Any]:
    """Count the lengths of the corrections that were made."""
    size = columns.size_mm[columns.status == Status.CORRECTED]
    size = size[np.isfinite(size)]
    if len(size) == 0:
        return {"edges_mm": [], "counts": []}
    top = max(float(size.max()), 1e-6)
    counts, edges = np.histogram(size, bins=BINS, range=(0.0, top))
    return {"edges_mm": edges.round(6).tolist(), "counts": counts.tolist()}


def uncertainty(columns: PageColumns) -> dict[str, float | None]:
    """Summarise the standard errors at the corrected targets, over the axes [mm]."""
    rows = columns.status == Status.CORRECTED
    size = np.linalg.norm(columns.std_mm[rows], axis=1)
    size = size[np.isfinite(size)]
    if len(size) == 0:
        return {"median": None, "max": None}
    return {"median": float(np.median(size)), "max": float(size.max())}


def seconds(stages: Mapping[str, float]) -> tuple[Stage, ...]:
    """List stages in their order, with shares."""
    total = sum(stages.values()) or 1.0
    return tuple(Stage(name, s, s / total) for name, s in stages.items())


# The page of a compensated program: what moved, by how much, and what did not.

IN_TIME = ("timing", "path_accuracy", "path")  # keys of the report
OPINION = "second_opinion"  # another one


def largest_use(in_time: Mapping[str, Any]) -> str:
    """Say how much of the joints' limits the compensated program uses at the most."""
    if "timing" not in in_time:
        return ""
    told = []
    for what in ("velocity", "acceleration"):
        shares = [use["share"] for use in in_time["timing"][f"{what}_use"]["after"]]
        most = max(shares)
        told.append(f"{what} {100 * most:.0f} % (J{shares.index(most) + 1})")
    return ", ".join(told)


def worst_paths(in_time: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Choose the moves that leave their path the most and whose curve is told."""
    told = [path for path in in_time.get("path", ()) if "curve" in path]
    return sorted(told, key=lambda path: -path["max_mm"]["after"])


SCRIPTS = (
    "page.js", "sheets.js", "columns.js", "view.js", "table.js", "source.js",
    "paths.js", "program.js",
)  # fmt: skip


def program_report(outcome: Outcome, sources: Mapping[str, bytes] | None = None) -> str:
    """Make the page of an outcome.

    Args:
        outcome: What came of a program.
        sources: Bytes of the source files by name; default: those of the outcome.
    """
    program = ProgramPage(
        name=outcome.program,
        model=outcome.model,
        columns=columns_of(outcome),
        predicted={"before": asdict(outcome.before), "after": asdict(outcome.after)},
        diagnostics=tuple(asdict(d) for d in outcome.diagnostics),
        stages=outcome.stages,
        sources=outcome.sources if sources is None else sources,
        shares=shares_of(outcome),
        motion=outcome.motion,
        in_time=in_time_of(outcome),
        opinion=outcome.opinion,
        head=ReportHead.of_outcome(outcome),
        expected=error_summary_of(outcome).get("expected", {}),
        tolerance={}
        if outcome.tolerance is None
        else tolerance_json(outcome.tolerance),
    )
    return _page(program)


def program_report_from_json(
    data: Mapping[str, Any], sources: Mapping[str, bytes] | None = None
) -> str:
    """Make the page of a written report.

    Args:
        data: What ``compensate --report`` wrote.
        sources: Bytes of the source files by name, where they are at hand.

    Raises:
        KeyError, ValueError, TypeError: It is no such report.
    """
    tolerance = data.get("tolerance", {})
    program = ProgramPage(
        name=str(data["program"]),
        model=str(data["model"]),
        columns=columns_from(data["targets"], tolerance.get("verdict", ())),
        predicted={when: data["predicted"][when] for when in ("before", "after")},
        diagnostics=tuple(data.get("diagnostics", ())),
        stages=data.get("stages_s", {}),
        sources=sources or {},
        shares=shares_from(data["targets"]),
        motion=data.get("motion", {}),
        in_time={key: data[key] for key in IN_TIME if key in data},
        opinion=Opinion.of_report(told) if (told := data.get(OPINION)) else None,
        head=ReportHead.from_json(data.get("head", {})),
        expected=data.get("expected", {}),
        tolerance=tolerance,
    )
    return _page(program)


WIDE = "what the model and the repeatability of the arm leave open"
UNUSUAL = "its bound is more than twice the usual one"
LOOKED_AT = 20  # exceptions that stand on the page


def _verdict(program: ProgramPage) -> tuple[str, str]:
    """Return what the page says first, and the class of its mark."""
    expected, tolerance = program.expected, program.tolerance
    if not expected:
        return "The expected true errors of this report are not known.", "unknown"
    if tolerance:
        kind = "fail" if tolerance.get("fail") else "unknown"
        kind = "pass" if tolerance.get("passes") else kind
    else:
        kind = "unknown" if expected.get("exceptions_count") else "plain"
    if not expected.get("corrected"):
        kind = "fail" if kind == "fail" else "unknown"
    return str(expected.get("verdict", "")), kind


def _page(program: ProgramPage) -> str:
    """Choose what the page carries and render it."""
    columns = program.columns
    carried = columns[choose(columns)]
    payload = {
        "columns": pack(carried, program.shares),
        "fields": FIELDS,
        "listing": listing(program.sources, carried),
        "histogram": histogram(columns),
        "paths": worst_paths(program.in_time),
    }
    return render(
        "program.html.j2",
        program.name,
        payload,
        SCRIPTS,
        program=program,
        counts={s.name.lower(): int((columns.status == s).sum()) for s in Status},
        corrected=int((columns.status == Status.CORRECTED).sum()),
        groups=group_uncorrected(columns),
        predicted=finite(program.predicted),
        sigma=uncertainty(columns),
        head=program.head.rows(),
        picture=distribution(
            columns.expected_mm[:, 0],
            columns.expected_mm[:, 1],
            sorted(set(program.tolerance.get("tolerances_mm", ()))),
        ),
        verdict=_verdict(program),
        unexplained=WIDE if program.tolerance else UNUSUAL,
        exceptions=finite(list(program.expected.get("exceptions", ())))[:LOOKED_AT],
        stages=seconds(program.stages),
        shown=len(carried),
        paths=worst_paths(program.in_time),
        use=largest_use(program.in_time),
        second=opinion_table(program.opinion),
        placed=bool(np.isfinite(columns.position_mm).all(axis=1).any()),
    )
