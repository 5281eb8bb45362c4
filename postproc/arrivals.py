"""What came of the targets on every line: kept beside an output, told by `diff`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints, Signs
from postproc.exceptions import ProgramError
from postproc.language.visits import Visits
from postproc.report import Decisions, Status
from postproc.robot.pose import MM
from postproc.sidecar import file_sha256, read_without_edits, sidecar_path

DIGIT = "0123456789"  # status of a visit
SIGNS = "-0+"  # direction of a joint: -1, 0, 1
BOTH = 2  # arrivals at one line from both sides of a joint
URGENCY = (Status.UNSAFE, Status.GUARDED, Status.DISPLAY, Status.SAFE, Status.UNCHANGED)
LEFT_ALONE = (Status.UNSAFE, Status.GUARDED, Status.DISPLAY)
DIGITS = 4  # of a correction [mm]


@dataclass(frozen=True)
class Arrivals:
    """What came of the targets on k lines of one file (structure of arrays).

    Attributes:
        line: 1-based lines of the source, ascending, (k,).
        status: The most urgent `Status` of a line's visits, (k,).
        why: Index into `reasons`, of that visit, (k,).
        reasons: Texts.
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
    reasons: tuple[str, ...]
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
        why = np.array(told["why"], dtype=np.int64)
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
            reasons=tuple(map(str, told["reasons"])),
            direction=np.where(least == most, least, BOTH),
            correction_mm=np.maximum.reduceat(size[order], first)
            if len(line)
            else size,
            counts={s.name.lower(): int((status == s).sum()) for s in Status},
            mixed=_mixed(status[order], first),
        )


def _mixed(status: Ints, first: Ints) -> dict[int, dict[str, int]]:
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
    codes = np.frombuffer(text.encode("latin-1", "replace"), dtype=np.uint8)
    table = np.full(256, -1, dtype=np.int8)
    table[[ord(c) for c in letters]] = range(len(letters))
    places: Signs = table[codes]
    if (places < 0).any():
        raise ValueError(f"a character is none of {letters}")
    return places


def _letters(places: NDArray[np.integer], letters: str) -> str:
    """Return the text of the letters at some places, as `_places` reads it."""
    table = np.frombuffer(letters.encode("ascii"), dtype=np.uint8)
    chosen: NDArray[np.uint8] = table[places]
    return chosen.tobytes().decode("ascii")


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
    has = v.literal >= 0
    literal = np.where(has, v.literal, 0)
    file, line = v.file, v.line
    if len(v.literals):
        written = np.isin(v.literals.file, [v.files.index(f) for f in files])
        has &= written[literal]
        file = np.where(has, v.literals.file[literal], v.file)
        line = np.where(has, v.literals.line[literal], v.line)
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
            "why": np.argsort(order)[why],
            "reasons": [d.reasons[k] for k in codes[order].tolist()],
        }
    return told


def read_arrivals(
    compensated: Path, pairs: Iterable[tuple[Path, Path]]
) -> dict[str, Arrivals]:
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
        mine = record.files.get(output.name)
        if mine is None or not mine.targets:
            continue
        same = file_sha256(original) == mine.source_sha256
        if same and file_sha256(output) == mine.output_sha256:
            told[original.name] = _read(mine.targets)
    return {name: arrivals for name, arrivals in told.items() if arrivals is not None}


def _read(told: Mapping[str, Any]) -> Arrivals | None:
    """Take what a record says, None where it is damaged."""
    try:
        return Arrivals.read(told)
    except (KeyError, ValueError, TypeError):
        return None
