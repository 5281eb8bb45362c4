"""What is written, read back, and held to be what was meant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from postproc import __version__
from postproc.arrays import Bools, Floats, Ints, chunks
from postproc.compensation.parallel import in_background
from postproc.compensation.program import Reading
from postproc.compensation.record import FileRecord, Sidecar, block_checksums, sha256
from postproc.exceptions import PostprocError
from postproc.language.rewrite import Skeleton, compare
from postproc.language.rewrite import edits as number_edits
from postproc.language.source import (
    UTF8_MARK,
    Edit,
    Replacements,
    Source,
    Span,
    apply,
    compose,
)
from postproc.language.stamp import stamp_length, stamp_line
from postproc.language.visits import Literals, Visits

# The files that a compensation writes, and the record that undoes them.


@dataclass(frozen=True)
class Output:
    """What is to be written.

    Attributes:
        files: All files of the program by name, the program first.
        records: How those that changed differ from their source.
        edits: Numbers that were changed in every file, in the order of the files.
    """

    files: Mapping[str, bytes]
    records: Mapping[str, FileRecord]
    edits: tuple[Replacements, ...]

    @property
    def changed(self) -> dict[str, bytes]:
        """Return the program, and the other files that changed."""
        program = next(iter(self.files))
        return {
            name: data
            for name, data in self.files.items()
            if name == program or name in self.records
        }

    def sidecar(
        self,
        model: str,
        options: Mapping[str, object],
        arrivals: Mapping[str, Mapping[str, object]],
    ) -> Sidecar:
        """Return the record beside the program.

        Args:
            model: Id of the model.
            options: What the user asked for.
            arrivals: What came of the targets in every file.
        """
        records = {
            name: replace(record, targets=arrivals[name])
            for name, record in self.records.items()
        }
        return Sidecar(__version__, model, records, options)


def write_numbers(
    reading: Reading, literals: Ints, values: Floats, model: str
) -> Output:
    """Write new numbers into a program's files.

    A file is stamped when it changes; the program also when nothing changes at all, so
    that it shows that it was looked at.

    Args:
        reading: The program.
        literals: Literals that get new numbers, (m,).
        values: Their numbers, (m, 6) in the file's units.
        model: Id of the model, for the stamp.
    """
    found = number_edits(reading.visits.literals, reading.sources, literals, values)
    return write_edits(reading, found, model)


def write_edits(
    reading: Reading, edits: tuple[Replacements, ...], model: str
) -> Output:
    """Make edits of numbers, file by file; as `write_numbers`."""
    nothing = not any(edits) and not any(reading.cloned)
    files, records = {}, {}
    for number, (source, cloned) in enumerate(reading.originals):
        own = edits[number]
        if cloned:
            own = Replacements.of(compose(cloned, own))
        files[source.name] = source.data
        if own or (number == 0 and nothing):
            stamp = stamp_line(__version__, model, source)
            files[source.name] = stamp + apply(source.data, own)
            records[source.name] = record(source, stamp, own, files[source.name])
    return Output(files, records, edits)


def record(
    source: Source, stamp: bytes, edits: Replacements, output: bytes
) -> FileRecord:
    """Record how an output differs from its source, in the output's offsets."""
    stamped = Replacements.of([Edit(Span(0, len(stamp)), b"")])
    undone = Replacements.joined([stamped, edits.undone(source.data, len(stamp))])
    checksums = block_checksums(output)
    return FileRecord(sha256(source.data), sha256(output), checksums, undone)


# The numbers of a corrected program as they will be read from its text.


def read_back(visits: Visits, edited: Ints, edits: Sequence[Replacements]) -> Floats:
    """Give the numbers of all visits once the edits are made, (n, 6).

    Those of edited literals come out bit by bit, those of targets computed from them
    but for what adding constants rounds off.

    Args:
        visits: The program as it was.
        edited: Its literals that are edited, ascending, (m,).
        edits: The edits of their numbers, file by file.
    """
    values = np.array(visits.values)
    new, changed = edited_numbers(visits.literals, edited, edits)
    rows, at = _among(visits.literal, edited)
    values[rows] = np.where(changed[at], new[at], values[rows])
    moved = np.zeros((len(edited), 6))
    moved[at] = values[rows] - visits.values[rows]
    rows, at = _among(visits.follows, edited)
    values[rows] += moved[at]
    return values


def edited_numbers(
    literals: Literals, edited: Ints, edits: Sequence[Replacements]
) -> tuple[Floats, Bools]:
    """Read the new numbers of some literals, (m, 6), and tell which there are.

    Args:
        literals: All literals of a program.
        edited: Those to look at, (m,).
        edits: The edits of numbers, file by file.
    """
    new = np.zeros((len(edited), 6))
    changed = np.zeros((len(edited), 6), dtype=bool)
    for file, own in enumerate(edits):
        mine = np.flatnonzero(literals.file[edited] == file)
        if len(own) == 0:
            continue
        start = literals.start[edited[mine]]
        at = np.minimum(np.searchsorted(own.start, start), len(own) - 1)
        hit = own.start[at] == start
        numbers = np.zeros(at.shape)
        numbers[hit] = own.new[at[hit]].astype(float)
        changed[mine], new[mine] = hit, numbers
    return new, changed


def _among(column: Ints, edited: Ints) -> tuple[Ints, Ints]:
    """Find the visits of edited literals, and which each has."""
    if len(edited) == 0:
        none = np.empty(0, dtype=np.int64)
        return none, none
    at = np.minimum(np.searchsorted(edited, column), len(edited) - 1)
    rows = np.flatnonzero(edited[at] == column)
    return rows, at[rows]


# Our own output, read again: nothing but the intended numbers may differ.

SAME = 1e-6  # [mm] and [deg]: what adding constants to numbers may round off
WORTH = 40_000  # visits from which on a second process compares the texts
ROWS = 50_000  # compared at a time: what that takes is small beside two readings
CONSTANT = (
    "frames", "tool", "base", "uframe", "pred_start", "pred", "target", "motion", "via",
    "distance_mm", "aux", "config", "configs", "config_given", "literal", "follows",
    "tool_remote", "nearest_turn", "care", "fly", "fly_dist_mm", "fly_per", "fly_type",
    "fly_traj", "lin_spd", "rot_spd", "override", "wrist_joint", "ornt_type",
)  # fmt: skip


class VerificationError(PostprocError):
    """The output is not the program that was meant; nothing may be written."""


def check_output(
    before: Reading, after: Reading, output: Output, edited: Ints, processes: int = 1
) -> None:
    """Check that a rewritten program differs in the numbers of edited targets only.

    Args:
        before: The source.
        after: The output, parsed again.
        output: What was written.
        edited: Literals that were given new numbers, (m,).
        processes: How many may work at once on a long program.

    Raises:
        VerificationError: Another byte differs, or the program reads differently.
    """
    worth = processes > 1 and len(before.visits) > WORTH
    with in_background(lambda: _in_texts(before, after, output), worth=worth) as ask:
        in_visits = _in_visits(before.visits, after.visits, output, edited)
        problem = ask() or in_visits
    if problem:
        raise VerificationError(problem)


def _in_texts(before: Reading, after: Reading, output: Output) -> str:
    """Say where the texts differ otherwise than by the edits, nothing if nowhere."""
    for old, new, edits in zip(before.texts, after.texts, output.edits, strict=True):
        name = old.source.name
        for problem in _differences(old, new, edits, name in output.records):
            return f"{name}: {problem}; nothing is written"
    return ""


def _in_visits(v: Visits, w: Visits, output: Output, edited: Ints) -> str:
    """Say what the program does otherwise than it should, nothing if nothing."""
    name = v.files[0]
    if len(v) != len(w) or not np.array_equal(v.literal, w.literal):
        return f"{name}: the output makes other moves"
    changes = np.append(np.zeros(len(v.literals), dtype=bool), False)  # none: -1
    changes[edited] = True
    for rows in chunks(len(v), ROWS):
        kept = ~(changes[v.literal[rows]] | changes[v.follows[rows]])
        if not _same(v.values[rows][kept], w.values[rows][kept]):
            return f"{name}: a target changed that was to be kept"
    if not _move_along(v, w):
        return f"{name}: a computed target changed otherwise"
    if not all(_as_meant(v, w, rows, output.edits) for rows in chunks(len(v), ROWS)):
        return f"{name}: a number does not read as it was meant"
    for column in CONSTANT:
        if not _equal(getattr(v, column), getattr(w, column)):
            return f"{name}: the output has another {column}"
    return ""


def _differences(
    old: Skeleton, new: Skeleton, edits: Replacements, stamped: bool
) -> tuple[str, ...]:
    """Compare two texts as they were read; the second may begin with a stamp line."""
    length = stamp_length(new.source.data) if stamped else 0
    if old.source.data.startswith(UTF8_MARK):  # it is no code on line 1 alone
        text = new.source.data[length:]
        return compare(old, Source(new.source.name, text), edits)
    return compare(old, new, edits, length)


def _as_meant(
    before: Visits, after: Visits, rows: slice, edits: Sequence[Replacements]
) -> bool:
    """Tell whether the numbers in the text are those of the edits, else as before."""
    literal = after.literal[rows]
    direct = literal >= 0
    new, edited = edited_numbers(before.literals, literal[direct], edits)
    meant = np.where(edited, new, before.values[rows][direct])
    return np.array_equal(after.values[rows][direct], meant)


def check_numbers(before: Visits, looked: Floats, after: Visits) -> None:
    """Check that the output has the numbers that the last look was at.

    Args:
        before: The source.
        looked: The numbers, (n, 6).
        after: The output, parsed again.

    Raises:
        VerificationError: A written number is not that one bit by bit, or a computed
            one differs by more than what adding constants rounds off.
    """
    for rows in chunks(len(before), ROWS):
        wanted, read = looked[rows], after.values[rows]
        computed = before.follows[rows] >= 0
        if not _same(wanted[~computed], read[~computed]):
            problem = "a number is not read as written"
            raise VerificationError(f"{before.files[0]}: {problem}")
        own = wanted[computed], read[computed]
        if not np.allclose(*own, rtol=0, atol=SAME, equal_nan=True):
            problem = "a computed target is elsewhere"
            raise VerificationError(f"{before.files[0]}: {problem}")


def _equal(a: Floats | tuple[str, ...], b: Floats | tuple[str, ...]) -> bool:
    """Compare two columns."""
    if isinstance(a, tuple) or isinstance(b, tuple):
        return a == b
    return a.shape == b.shape and all(
        _same(a[rows], b[rows]) for rows in chunks(len(a), ROWS)
    )


def _same(a: Floats, b: Floats) -> bool:
    """Compare some rows of two columns; NaN equals NaN."""
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def _move_along(before: Visits, after: Visits) -> bool:
    """Tell whether computed targets change as those do that they are computed from."""
    rows = np.flatnonzero(before.follows >= 0)
    if not len(rows):
        return True
    direct = np.flatnonzero(before.literal >= 0)
    change = np.zeros((len(before.literals), 6))
    moved = after.values[direct] - before.values[direct]
    change[before.literal[direct]] = moved
    moved = after.values[rows] - before.values[rows]
    meant = change[before.follows[rows]]
    return np.allclose(meant, moved, atol=SAME, equal_nan=True)
