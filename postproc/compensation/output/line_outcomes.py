"""What came of the targets on every line: kept beside an output, read by `diff`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import (
    Floats,
    Ints,
    Signs,
)
from postproc.compensation.outcome import LEFT_ALONE, Decisions, Status
from postproc.compensation.output.sidecar import (
    LeftLine,
    Sidecar,
    file_sha256,
    read_without_edits,
    sidecar_path,
)
from postproc.diagnostics import Code, Reason
from postproc.exceptions import ProgramError
from postproc.language.visits import (
    Diagnostic,
    Visits,
)
from postproc.robot.pose import MM

if TYPE_CHECKING:  # it loads all of the planning, which a record does not want
    pass

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
