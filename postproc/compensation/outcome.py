"""What came of a program: every visit with its status, and the exit code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import (
    Bools,
    Floats,
    Indices,
    Ints,
    Signs,
    columns_of,
    data_frame,
)
from postproc.compensation.output.sidecar import (
    LeftLine,
    Sidecar,
    file_sha256,
    read_without_edits,
    sidecar_path,
)
from postproc.diagnostics import Code, Reason
from postproc.exceptions import PostprocError, ProgramError
from postproc.files import (
    Content,
    check_places,
    is_stream,
    make_folder,
    write_all,
)
from postproc.language.languages import file_named
from postproc.language.visits import (
    NOT_FOLLOWED,
    Diagnostic,
    Visits,
)
from postproc.model.statistics import ErrorStatistics
from postproc.robot.pose import MM

if TYPE_CHECKING:  # it loads all of the planning, which a record does not want
    from postproc.arrays import DataFrame
    from postproc.compensation.findings.headline import ProgramErrors
    from postproc.compensation.findings.timing_comparison import InTime
    from postproc.compensation.findings.tolerance import JobTolerance, ToleranceCheck
    from postproc.compensation.solver.arrivals import ArrivalStates
    from postproc.compensation.solver.expected_error import ExpectedErrors
    from postproc.verify.opinion import Opinion

# What came of a program: every visit with its status, and the exit code.

DONE, NOT_ALL, FAILED = 0, 1, 2  # exit codes
SHARED = 40_000  # visits up to which reports tell the shares of the effects


class Status(IntEnum):
    """How a visit came out."""

    CORRECTED = 0  # corrected; every arrival at the literal agrees
    CONFLICT = 1  # arrivals at one literal disagree: left alone
    RUNTIME = 2  # the value is known only at run time
    REJECTED = 3  # the correction is not trusted: left alone
    UNCHANGED = 4  # nothing to correct, or not to be corrected


@dataclass(frozen=True)
class Decisions:
    """What was decided for n visits (structure of arrays).

    Attributes:
        status: `Status`, (n,).
        why: Index into `reasons`, (n,).
        reasons: Why visits keep their values; reasons[0] is `NO_REASON`.
        q: Commanded joint angles of the original program, (n, 6) [rad].
        direction: Arrival direction, (n, 6): +1, -1, or 0 where not known.
        side: Where every joint lies in its play, (n, 6) from -1 to 1.
        corrected: The numbers in the file after correction, (n, w).
        correction: Change of the commanded TCP, base frame, (n, 3) [m].
        std_error: Standard error of the model there, per axis, (n, 3) [m].
        turn: Rotation of the commanded tool, base frame, (n, 3) [rad]; empty where
            nobody asked.
    """

    status: Signs
    why: Indices
    reasons: tuple[Reason, ...]
    q: Floats
    direction: Signs
    side: Floats
    corrected: Floats
    correction: Floats
    std_error: Floats
    turn: Floats = field(default_factory=lambda: np.empty((0, 3)))

    def count(self, status: Status) -> int:
        """Count the visits of one status."""
        return int((self.status == status).sum())


@dataclass(frozen=True)
class Outcome:
    """A compensated program and how it came about.

    Attributes:
        program: Name of the program.
        model: Id of the model.
        outputs: New bytes by file name, the program itself first; a file whose values
            did not change is absent.
        record: What `restore` needs.
        visits: What was found in the program.
        decisions: What was decided for every visit.
        before, after: Predicted error on the visits that could be compensated. After
            is the residual of the correction: what the arm will miss is `expected`.
        diagnostics: What else was found, in order of line.
        stages: Seconds spent in every stage, by all processes together.
        motion: The largest change on the ways between targets: ``joint_deg``,
            ``elbow_mm``, ``wrist_centre_mm``, ``tcp_mm``.
        position: Where the program wants the TCP at every visit, base frame, (n, 3)
            [m], NaN where it is not known; empty where nobody asked.
        sources: The bytes of the source files by name, for showing lines.
        arrivals: The states that the visits are corrected for, with the shares of the
            effects in their errors; None where nobody knows.
        expected: Their expected true errors; None likewise.
        in_time: The program run in time, before and after; None where nobody asked.
        opinion: A second opinion on it; None where nobody asked.
        tolerance: Expected true errors against a tolerance; None where nobody asked.
        inputs: Files that it was read from, which `save` must not write over.
    """

    program: str
    model: str
    outputs: Mapping[str, bytes]
    record: Sidecar
    visits: Visits
    decisions: Decisions
    before: ErrorStatistics
    after: ErrorStatistics
    diagnostics: tuple[Diagnostic, ...]
    stages: Mapping[str, float] = field(default_factory=dict)
    motion: Mapping[str, float] = field(default_factory=dict)
    position: Floats = field(default_factory=lambda: np.empty((0, 3)))
    sources: Mapping[str, bytes] = field(default_factory=dict)
    arrivals: ArrivalStates | None = None
    expected: ExpectedErrors | None = None
    in_time: InTime | None = None
    opinion: Opinion | None = None
    tolerance: ToleranceCheck | None = None
    inputs: tuple[Path, ...] = ()

    def __str__(self) -> str:
        """Say what came of it; see `summary`."""
        said = [self.summary()]
        if self.in_time is not None:
            said.append(self.in_time.summary(self.visits))
        return "\n".join(said)

    def save(self, folder: str | Path) -> list[Path]:
        """Write the program, what changed of its files, and the records of them.

        Args:
            folder: Where to; it is made unless it is there. Files keep their names.

        Returns:
            The files written, the program last.

        Raises:
            OutputError: One would be written over what it was read from, or cannot be
                written.
        """
        names = {name: Path(folder, Path(name).name) for name in self.outputs}
        values = file_named(self.program).variables
        own = [n for n in (values, self.program) if n in names]
        files: dict[Path, Content] = {}
        for name in reversed([name for name in names if name not in own]):
            files |= self.name_files({name: names[name]}, names[name])
        files |= self.name_files({n: names[n] for n in own}, names[self.program])
        make_folder(Path(folder))
        check_places(files, self.inputs)
        write_all(files)
        return list(files)

    def name_files(self, places: Mapping[str, Path], main: Path) -> dict[Path, Content]:
        """Name the files of one program, behind the record that undoes them.

        Args:
            places: Where outputs go, by name.
            main: The place beside which the record lies; none lies beside a pipe.
        """
        names = {name: place.name for name, place in places.items()}
        record = self.record.rename_files(names).to_json()
        files = {place: self.outputs[name] for name, place in places.items()}
        return {**({} if is_stream(main) else {sidecar_path(main): record}), **files}

    def to_frame(self) -> DataFrame:
        """Return a data frame, one row a visit, in the order of the program.

        Columns: file, line, target, status, code, reason, then the correction of the
        TCP in the base frame (``dx_mm`` ..), its standard error (``std_x_mm`` ..) and
        the commanded joint angles before correction (``q1_deg`` ..).
        """
        v, d = self.visits, self.decisions
        return data_frame(
            {
                "file": [v.files[k] for k in v.place.file.tolist()],
                "line": v.place.line,
                "target": [v.target.names[k] for k in v.target.name.tolist()],
                "status": [Status(k).name.lower() for k in d.status.tolist()],
                "code": [d.reasons[k].name for k in d.why.tolist()],
                "reason": [d.reasons[k].text for k in d.why.tolist()],
                **columns_of(("dx_mm", "dy_mm", "dz_mm"), d.correction / MM),
                **columns_of(("std_x_mm", "std_y_mm", "std_z_mm"), d.std_error / MM),
                **columns_of([f"q{k}_deg" for k in range(1, 7)], np.rad2deg(d.q)),
            }
        )

    @property
    def sidecar(self) -> str:
        """The record that `restore` needs, as JSON text."""
        return b"".join(self.record.to_json()).decode("ascii")

    @property
    def reported(self) -> Outcome:
        """Return what reports tell: of a long program no shares of effects.

        They cost more than all else that a report says of a target, up to four times
        as much.
        """
        return self if len(self.visits) <= SHARED else replace(self, arrivals=None)

    @property
    def exit_code(self) -> int:
        """Return 1 where a target could have been compensated and was not.

        Also where the compensated program does not run as the original does, a second
        opinion disagrees, or a visit does not pass the tolerance.
        """
        left = (Status.CONFLICT, Status.RUNTIME, Status.REJECTED)
        missed = any(d.code in NOT_FOLLOWED for d in self.diagnostics)
        missed |= self.in_time is not None and self.in_time.falls_short
        missed |= self.opinion is not None and not self.opinion.agrees
        missed |= self.tolerance is not None and not self.tolerance.passes
        far = [one.code is Code.ARRIVALS_FAR_APART for one in self.decisions.reasons]
        missed |= bool(np.array(far)[self.decisions.why].any())
        return NOT_ALL if missed or np.isin(self.decisions.status, left).any() else DONE

    def with_tolerance(self, tolerance: JobTolerance | None) -> Outcome:
        """Judge every visit by its expected true error, see `check_tolerance`.

        Raises:
            PostprocError: How the arm arrives is not known.
        """
        if tolerance is None:
            return self
        from postproc.compensation.findings.tolerance import check_tolerance

        if self.expected is None:
            raise PostprocError("--tolerance: how the arm arrives is not known")
        found = check_tolerance(self.expected, tolerance.of_visits(self.visits))
        record = replace(self.record, tolerance=found.to_record())
        return replace(self, tolerance=found, record=record)

    @property
    def errors(self) -> ProgramErrors | None:
        """What is known of its expected errors; None where they are not known."""
        if self.expected is None:
            return None
        from postproc.compensation.findings.headline import ProgramErrors

        d = self.decisions
        return ProgramErrors(
            visits=self.visits,
            corrected=np.asarray(d.status == Status.CORRECTED),
            kept=np.isin(d.status, LEFT_ALONE),
            why=d.why,
            reasons=d.reasons,
            side=d.side,
            expected=self.expected,
            tolerance=self.tolerance,
        )

    def summary(self) -> str:
        """Say what came of the program, the worst first."""
        from postproc.compensation.findings.headline import headline

        d = self.decisions
        counts = ", ".join(
            f"{d.count(s)} {s.name.lower()}" for s in Status if d.count(s)
        )
        errors = self.errors
        lines: list[str] = []
        parts = [f"{len(d.status)} visits ({counts or 'no targets'})"]
        if errors is not None:
            found = headline(errors)
            parts.append(str(found))
            lines += filter(None, [found.first])
        if self.before.n:
            parts.append(f"residual of the correction {self.after.max_mm:.4f} mm")
        lines.append(f"{self.program}: {'; '.join(filter(None, parts))}")
        return "\n".join(lines)

    def list_uncorrected_rows(self) -> list[int]:
        """Return the visits that kept their value although they hold a target."""
        left = (Status.CONFLICT, Status.RUNTIME, Status.REJECTED)
        rows: list[int] = np.flatnonzero(np.isin(self.decisions.status, left)).tolist()
        return rows

    def list_uncorrected(self) -> list[str]:
        """List every visit that kept its value although it holds a target."""
        d, v = self.decisions, self.visits
        return [
            f"{v.file_name(i)}:{v.place.line[i]}: {Status(d.status[i]).name.lower()}: "
            f"{d.reasons[d.why[i]]}"
            for i in self.list_uncorrected_rows()
        ]


def largest_motion(departure: Floats) -> dict[str, float]:
    """Name the largest changes of motion.

    Args:
        departure: Changes of a joint [rad], elbow, wrist centre and TCP [m], (n, 4).
    """
    largest = np.fmax.reduce(departure, axis=0, initial=0.0)
    joint, elbow, wrist, tcp = np.append(np.rad2deg(largest[:1]), largest[1:] / MM)
    return {
        "joint_deg": float(joint),
        "elbow_mm": float(elbow),
        "wrist_centre_mm": float(wrist),
        "tcp_mm": float(tcp),
    }


def find_judged(visits: Visits, decisions: Decisions) -> Bools:
    """Return which visits have a target that they can miss, (n,)."""
    changed = decisions.status != Status.UNCHANGED
    return np.asarray(changed | (visits.target.literal >= 0))


# What came of the targets on every line: kept beside an output, told by `diff`.

DIGIT = "0123456789"  # status of a visit
SIGNS = "-0+"  # direction of a joint: -1, 0, 1
BOTH = 2  # arrivals at one line from both sides of a joint
URGENCY = (
    Status.CONFLICT,
    Status.REJECTED,
    Status.RUNTIME,
    Status.CORRECTED,
    Status.UNCHANGED,
)
LEFT_ALONE = (Status.CONFLICT, Status.REJECTED, Status.RUNTIME)
DIGITS = 4  # of a correction [mm]


@dataclass(frozen=True)
class LineOutcomes:
    """What came of the targets on k lines of one file (structure of arrays).

    Attributes:
        line: 1-based lines of the source, ascending, (k,).
        status: The most urgent `Status` of a line's visits, (k,).
        why: Index into `reasons`, of that visit, (k,).
        reasons: Why they keep their values; without codes in records of version 0.1.0.
        direction: In which every joint arrives, (k, 6): -1, 1, 0 where not known,
            `BOTH` where the visits differ.
        correction_mm: Largest correction of the TCP, (k,).
        counts: Visits of every status in this file, by name.
        mixed: Visits of every status on a line, the most urgent first, by its index;
            for lines whose visits have several.
    """

    line: Ints
    status: Ints
    why: Ints
    reasons: tuple[Reason, ...]
    direction: Signs
    correction_mm: Floats
    counts: Mapping[str, int]
    mixed: Mapping[int, Mapping[str, int]] = field(default_factory=dict)

    def find(self, lines: Sequence[int] | Ints) -> Ints:
        """Return the index of every line, -1 where it holds no target."""
        wanted = np.asarray(lines, dtype=np.int64)
        if len(self.line) == 0:
            return np.full(len(wanted), -1)
        at = np.minimum(np.searchsorted(self.line, wanted), len(self.line) - 1)
        return np.where(self.line[at] == wanted, at, -1)

    @classmethod
    def read(cls, told: Mapping[str, Any]) -> Self:
        """Take what `tell_arrivals` wrote.

        Raises:
            KeyError, ValueError, TypeError: It is something else.
        """
        line = np.array(told["line"], dtype=np.int64)
        status = _places(told["status"], DIGIT).astype(np.int64)
        sides = (_places(told["direction"], SIGNS) - 1).reshape(len(line), 6)
        size = np.array(told["correction_mm"], dtype=np.float64)
        why = np.array(_read_reason_index(told), dtype=np.int64)
        texts = [str(text) for text in told["reasons"]]
        # The reasons of version 0.1.0 are texts without codes.
        codes = [str(code) for code in told.get("codes", [""] * len(texts))]
        rank = np.argsort(URGENCY)[status]
        order = np.lexsort((rank, line))
        first = np.flatnonzero(np.diff(line[order], prepend=-1))
        least, most = (
            f.reduceat(sides[order], first, axis=0) if len(line) else sides
            for f in (np.minimum, np.maximum)
        )
        lead = order[first]
        return cls(
            line=line[lead],
            status=status[lead],
            why=why[lead],
            reasons=tuple(map(Reason.named, codes, texts)),
            direction=np.where(least == most, least, BOTH),
            correction_mm=np.maximum.reduceat(size[order], first)
            if len(line)
            else size,
            counts={s.name.lower(): int((status == s).sum()) for s in Status},
            mixed=_count_mixed(status[order], first),
        )


def _read_reason_index(told: Mapping[str, Any]) -> Sequence[int]:
    """Take the index of the reason of every visit; `why` in records of 0.1.0."""
    found: Sequence[int] = told.get("reason", told.get("why", ()))
    return found


def _count_mixed(status: Ints, first: Ints) -> dict[int, dict[str, int]]:
    """Count the visits of lines that have several statuses.

    Args:
        status: Of every visit, line by line, the most urgent one first.
        first: Where each line begins.
    """
    last = np.append(first[1:], len(status)) - 1
    several = np.flatnonzero(status[first] != status[last]) if len(status) else first
    found = {}
    for k in several.tolist():
        own = status[first[k] : last[k] + 1].tolist()
        found[k] = {s.name.lower(): own.count(s) for s in URGENCY if s in own}
    return found


def _places(text: str, letters: str) -> Signs:
    """Return the place of every character of a text among some letters.

    Raises:
        ValueError: A character is none of them.
    """
    missing = len(letters)
    table = bytearray([missing]) * 256
    for place, letter in enumerate(letters):
        table[ord(letter)] = place
    places = np.frombuffer(text.encode("latin-1", "replace").translate(table), np.int8)
    if (places == missing).any():
        raise ValueError(f"a character is none of {letters}")
    return places


def _letters(places: NDArray[np.integer], letters: str) -> str:
    """Return the text of the letters at some places, as `_places` reads it."""
    table = letters.encode("ascii").ljust(256)
    return places.astype(np.int8).tobytes().translate(table).decode("ascii")


def tell_arrivals(
    visits: Visits, decisions: Decisions, files: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Say, file by file, what came of every visit, for the record of an output.

    A visit belongs to the line of its numbers where that file is written, else to the
    line of its move.

    Args:
        visits: Every arrival.
        decisions: What was decided for it.
        files: Names of the files that are written.
    """
    v, d = visits, decisions
    file, line = _lines_of_visits(v, files)
    size = np.linalg.norm(d.correction, axis=1) / MM
    told = {}
    for name in files:
        rows = np.flatnonzero(file == v.files.index(name))
        codes, first, why = np.unique(
            d.why[rows], return_index=True, return_inverse=True
        )
        order = np.argsort(first)  # reasons as the visits need them
        told[name] = {
            "line": line[rows],
            "status": _letters(d.status[rows], DIGIT),
            "direction": _letters(d.direction[rows] + 1, SIGNS),
            "correction_mm": np.round(np.nan_to_num(size[rows]), DIGITS),
            "reason": np.argsort(order)[why],
            "codes": [d.reasons[k].name for k in codes[order].tolist()],
            "reasons": [d.reasons[k].text for k in codes[order].tolist()],
        }
    return told


def _lines_of_visits(v: Visits, files: Sequence[str]) -> tuple[Ints, Ints]:
    """Return file and line that tell of every visit: of its numbers, or its move."""
    has = v.target.literal >= 0
    literal = np.where(has, v.target.literal, 0)
    file, line = v.place.file, v.place.line
    if len(v.literals):
        written = np.isin(v.literals.file, [v.files.index(f) for f in files])
        has &= written[literal]
        file = np.where(has, v.literals.file[literal], v.place.file)
        line = np.where(has, v.literals.line[literal], v.place.line)
    return file, line


def directions_of_record(visits: Visits, record: Sidecar) -> Floats | None:
    """Return the directions that visits were corrected for, as the record tells them.

    Args:
        visits: Every arrival of the source.
        record: Of its output.

    Returns:
        (n, 6), NaN where the target was left; None where the record is of other visits:
        of clones, or of an older version.
    """
    files = [name for name in record.files if name in visits.files]
    file, line = _lines_of_visits(visits, files)
    out = np.full((len(visits), 6), np.nan)
    for name in files:
        told = record.files[name].targets
        rows = np.flatnonzero(file == visits.files.index(name))
        if not np.array_equal(np.asarray(told.get("line", ())), line[rows]):
            return None
        sides = _places(str(told["direction"]), SIGNS) - 1.0
        corrected = _places(str(told["status"]), DIGIT) == Status.CORRECTED
        out[rows[corrected]] = sides.reshape(len(rows), 6)[corrected]
    return out


def list_uncorrected_elsewhere(
    visits: Visits,
    decisions: Decisions,
    files: Sequence[str],
    missed: Mapping[str, Ints],
    diagnostics: Iterable[Diagnostic],
) -> tuple[LeftLine, ...]:
    """List what may hold targets and was left, where `tell_arrivals` cannot say so.

    Args:
        visits: Every arrival.
        decisions: What was decided for it.
        files: Names of the files that are written.
        missed: Lines of moves that are never reached, by file.
        diagnostics: What else was found: statements that are not understood.
    """
    v, d = visits, decisions
    rows = np.isin(d.status, LEFT_ALONE)
    literal = np.where(v.target.literal >= 0, v.target.literal, 0)
    written = np.isin(v.files, [*files])
    told = written[v.place.file]
    if len(v.literals):
        told |= (v.target.literal >= 0) & written[v.literals.file[literal]]
    found = [
        (v.file_name(i), int(v.place.line[i]), d.reasons[d.why[i]])
        for i in np.flatnonzero(rows & ~told).tolist()
    ]
    for name, lines in missed.items():
        found += [(name, line, _of_finding(Code.NEVER_REACHED)) for line in lines]
    found += [
        (x.file, x.line, _of_finding(x.code))
        for x in diagnostics
        if x.code == Code.MOTION_UNKNOWN
    ]
    return tuple((file, int(line), why) for file, line, why in found)


def _of_finding(code: Code) -> Reason:
    """Return the reason that a finding of the same code explains."""
    return Reason(code, str(code))


def add_uncorrected(
    told: Mapping[str, Any], left: Sequence[LeftLine]
) -> dict[str, Any]:
    """Add lines that were left to what `tell_arrivals` says of their file."""
    whys = list(dict.fromkeys(why for _, _, why in left))
    known = list(told.get("reasons", ()))
    codes = list(told.get("codes", [""] * len(known)))
    return {
        "line": [*told.get("line", ()), *(line for _, line, _ in left)],
        "status": str(told.get("status", "")) + str(int(Status.RUNTIME)) * len(left),
        "direction": str(told.get("direction", "")) + SIGNS[1] * 6 * len(left),
        "correction_mm": [*told.get("correction_mm", ()), *[0.0] * len(left)],
        "reason": [
            *_read_reason_index(told),
            *(len(known) + whys.index(why) for _, _, why in left),
        ],
        "codes": [*codes, *(why.name for why in whys)],
        "reasons": [*known, *(why.text for why in whys)],
    }


def read_arrivals(
    compensated: Path, pairs: Iterable[tuple[Path, Path]]
) -> dict[str, LineOutcomes]:
    """Read what the record beside an output says of files that are still as it says.

    Args:
        compensated: The output; its record lies beside it.
        pairs: Original and compensated files.

    Returns:
        Arrivals by the name of the original file; nothing where there is no record, or
        where a file has changed since.
    """
    try:
        record = read_without_edits(sidecar_path(compensated))
    except ProgramError:
        return {}
    told = {}
    for original, output in pairs:
        mine, left = (
            record.files.get(output.name),
            record.list_uncorrected_in(output.name),
        )
        if (mine is None or not mine.targets) and not left:
            continue
        before, after = file_sha256(original), file_sha256(output)
        source, result = before, before  # of a file that was not changed
        if mine is not None:
            source, result = mine.source_sha256, mine.output_sha256
        if (before, after) == (source, result):
            targets = mine.targets if mine is not None else {}
            told[original.name] = _read(
                add_uncorrected(targets, left) if left else targets
            )
    return {name: arrivals for name, arrivals in told.items() if arrivals is not None}


def _read(told: Mapping[str, Any]) -> LineOutcomes | None:
    """Take what a record says, None where it is damaged."""
    try:
        return LineOutcomes.read(told)
    except (KeyError, ValueError, TypeError):
        return None
