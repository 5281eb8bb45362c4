"""The files that a compensation writes, and the record that undoes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from postproc import __version__
from postproc.arrays import Floats, Ints
from postproc.language.rewrite import edits as number_edits
from postproc.language.source import Edit, Replacements, Source, Span, apply, compose
from postproc.language.stamp import stamp_line
from postproc.planning import Reading
from postproc.sidecar import FileRecord, Sidecar, block_checksums, sha256


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
