"""What is written, read back, and held to be what was meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from postproc import __version__
from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.eligibility.guards import limit_violations
from postproc.compensation.output.equivalence import equivalent
from postproc.compensation.output.sidecar import (
    FileRecord,
    Sidecar,
    block_checksums,
    sha256,
)
from postproc.compensation.program import ParsedProgram
from postproc.compensation.scale.workers import in_background
from postproc.compensation.solver.shifts import shift_values
from postproc.exceptions import PostprocError
from postproc.language.languages import language_of
from postproc.language.text.number_edits import (
    NO_STAMP,
    count_decimals,
    difference,
)
from postproc.language.text.source import (
    Edit,
    Replacements,
    Source,
    Span,
    apply,
    compose,
)
from postproc.language.text.stamp import (
    stamp_line,
    stamp_place,
    stamp_span,
)
from postproc.language.visits import Literals, Visits
from postproc.motion.deviation import JointDeviation
from postproc.robot.cell import LimitSection

# The files that a compensation writes, and the record that undoes them.


@dataclass(frozen=True)
class Output:
    """What is to be written.

    Attributes:
        files: All files of the program by name, the program first.
        stamps: Where those that changed are stamped; `NO_STAMP` where nothing did.
        edits: Numbers that were changed in every file, in the order of the files.
        all_edits: The files as they were given, with all that is changed in each.
    """

    files: Mapping[str, bytes]
    stamps: Mapping[str, Span]
    edits: tuple[Replacements, ...]
    all_edits: tuple[tuple[Source, Replacements], ...]

    @property
    def changed(self) -> dict[str, bytes]:
        """Return the program, and the other files that changed."""
        program = next(iter(self.files))
        return {
            name: data
            for name, data in self.files.items()
            if name == program or name in self.stamps
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
            source.name: record(
                source, self.stamps[source.name], own, self.files[source.name],
                arrivals[source.name],
            )
            for source, own in self.all_edits
            if source.name in self.stamps
        }  # fmt: skip
        return Sidecar(__version__, model, records, options)


def write_edits(
    reading: ParsedProgram, edits: tuple[Replacements, ...], model: str
) -> Output:
    """Make edits of numbers, file by file.

    A file is stamped when it changes. Where nothing changes at all, nothing is stamped:
    the program has an empty stamp, with which the record speaks of it.

    Args:
        reading: The program.
        edits: What to write, of every file.
        model: Id of the model, for the stamp.
    """
    nothing = not any(edits) and not any(reading.cloned)
    files, stamps = {}, {}
    comment = language_of(reading.sources[0].name).comment
    found = tuple(_compose_edits(reading, edits))
    for number, (source, own) in enumerate(found):
        files[source.name] = source.data
        if number == 0 and nothing:
            stamps[source.name] = NO_STAMP
        if own:
            stamp = stamp_line(__version__, model, source, comment)
            at = stamp_place(source.data)
            text = memoryview(apply(source.data, own))  # its header is as it was
            files[source.name] = b"".join((text[:at], stamp, text[at:]))
            stamps[source.name] = Span(at, at + len(stamp))
    return Output(files, stamps, edits, found)


def _compose_edits(
    reading: ParsedProgram, edits: Sequence[Replacements]
) -> Iterator[tuple[Source, Replacements]]:
    """Go through the files as they were given, with all that is changed in them."""
    for (source, cloned), own in zip(reading.originals, edits, strict=True):
        yield source, Replacements.of(compose(cloned, own)) if cloned else own


def record(
    source: Source,
    stamp: Span,
    edits: Replacements,
    output: bytes,
    targets: Mapping[str, object],
) -> FileRecord:
    """Record how an output differs from its source, in the output's offsets."""
    length = stamp.end - stamp.start
    stamped = Replacements.of([Edit(stamp, b"")] if length else [])
    undone = Replacements.join([stamped, edits.invert(source.data, length)])
    checksums = block_checksums(output)
    return FileRecord(sha256(source.data), sha256(output), checksums, undone, targets)


# The numbers of a corrected program as they will be read from its text.


MOST_DECIMALS = 15


@dataclass(frozen=True)
class WrittenNumbers:
    """How the numbers of n visits are written.

    Attributes:
        visits: The visits that have numbers of their own, (k,).
        old: These numbers, (k, w).
        scale: What makes whole numbers of those that are written, (k, w).
    """

    visits: Ints
    old: Floats
    scale: Floats

    @classmethod
    def of(cls, reading: ParsedProgram) -> WrittenNumbers:
        """Look at a program."""
        visits = reading.visits
        rows = np.flatnonzero(visits.target.literal >= 0)
        literals = visits.literals, reading.sources, visits.target.literal[rows]
        decimals = count_decimals(*literals, visits.dialect)
        scale = 10.0 ** np.minimum(decimals, MOST_DECIMALS)
        return cls(rows, visits.target.values[rows], scale)

    def round(self, values: Floats) -> Floats:
        """Round the numbers of all visits as they will be read, (n, w).

        Where that is not sure to the last bit, `read_back` tells.
        """
        out, own = np.array(values), values[self.visits]
        stays = np.abs(own - self.old) <= 0.5 / self.scale
        out[self.visits] = np.where(
            stays, self.old, np.rint(own * self.scale) / self.scale
        )
        return out


def read_back(visits: Visits, edited: Ints, edits: Sequence[Replacements]) -> Floats:
    """Give the numbers of all visits once the edits are made, (n, w).

    Those of edited literals come out bit by bit, those of targets computed from them
    but for what adding constants rounds off.

    Args:
        visits: The program as it was.
        edited: Its literals that are edited, ascending, (m,).
        edits: The edits of their numbers, file by file.
    """
    values = np.array(visits.target.values)
    new, changed = read_edited(visits.literals, edited, edits)
    plain = visits.target.shift < 0
    rows, at = _among(visits.target.literal, edited, plain)
    values[rows] = np.where(changed[at], new[at], values[rows])
    moved = np.zeros((len(edited), visits.target.values.shape[1]))
    moved[at] = values[rows] - visits.target.values[rows]
    rows, at = _among(visits.target.follows, edited, plain)
    values[rows] += moved[at]
    return shift_values(visits, edited, np.where(changed, new, np.nan), values)


def read_edited(
    literals: Literals, edited: Ints, edits: Sequence[Replacements]
) -> tuple[Floats, Bools]:
    """Read the new numbers of some literals, (m, w), and tell which there are.

    Args:
        literals: All literals of a program.
        edited: Those to look at, (m,).
        edits: The edits of numbers, file by file.
    """
    shape = len(edited), literals.places.offset.shape[1]
    new, changed = np.zeros(shape), np.zeros(shape, dtype=bool)
    for file, own in enumerate(edits):
        mine = np.flatnonzero(literals.file[edited] == file)
        if len(own) == 0:
            continue
        start = literals.places[edited[mine]].start
        at = np.minimum(np.searchsorted(own.start, start), len(own) - 1)
        hit = own.start[at] == start
        numbers = np.zeros(at.shape)
        numbers[hit] = own.new[at[hit]].astype(float)
        changed[mine], new[mine] = hit, numbers
    return new, changed


def _among(column: Ints, edited: Ints, some: Bools) -> tuple[Ints, Ints]:
    """Find those of some visits that have edited literals, and which each has."""
    if len(edited) == 0:
        none = np.empty(0, dtype=np.int64)
        return none, none
    at = np.minimum(np.searchsorted(edited, column), len(edited) - 1)
    rows = np.flatnonzero((edited[at] == column) & some)
    return rows, at[rows]


# Our own output, read again: nothing but the intended numbers may differ.


class VerificationError(PostprocError):
    """The output is not the program that was meant; nothing may be written."""


def check_output(
    before: ParsedProgram,
    after: ParsedProgram,
    output: Output,
    edited: Ints,
    values: Floats,
) -> None:
    """Check that a rewritten program differs in the numbers of edited targets only.

    Args:
        before: The source.
        after: The output, parsed again.
        output: What was written.
        edited: Literals that were given new numbers, (m,).
        values: The numbers of all visits as they should be read, (n, w).

    Raises:
        VerificationError: Another byte differs, or the program reads differently.
    """
    ask = in_background(lambda: _in_texts(before, after, output))
    in_visits = equivalent(before.visits, after.visits, edited, values)
    problem = ask() or (in_visits and f"{before.visits.files[0]}: {in_visits}")
    if problem:
        raise VerificationError(problem)


def _in_texts(before: ParsedProgram, after: ParsedProgram, output: Output) -> str:
    """Say where the texts differ otherwise than by the edits, nothing if nowhere."""
    for old, new, edits in zip(before.texts, after.texts, output.edits, strict=True):
        name = old.source.name
        stamp = stamp_span(new.source.data) if name in output.stamps else NO_STAMP
        problem = difference(old, new, edits, stamp)
        if problem:
            return f"{name}: {problem}; nothing is written"
    return ""


# Our own output, planned again: the same motion, to the limits of the cell.


def check_motion(visits: Visits, moved: JointDeviation, limits: LimitSection) -> None:
    """Check that the arm moves as it did, but for what the cell's limits allow.

    Args:
        visits: The program, n visits.
        moved: How far the ways to the written targets lead from those before.
        limits: The cell's guards.

    Raises:
        VerificationError: A joint, the elbow or the wrist centre would swing too far,
            or the arm would stand on another branch.
    """
    for text, far in limit_violations(limits, moved).items():
        for row in np.flatnonzero(far)[:1].tolist():
            name, line = visits.file_name(row), visits.place.line[row]
            raise VerificationError(
                f"{name}:{line}: {text} on the way there, which no guard "
                "has held back; nothing is written"
            )
