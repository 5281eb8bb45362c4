"""The record beside an output that gives the source back, byte for byte."""

from __future__ import annotations

import hashlib
import json
import os
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Any, Self, TypeVar

import numpy as np

from postproc.arrays import Cells, shortest, text_of, whole
from postproc.diagnostics import Reason
from postproc.exceptions import ProgramError
from postproc.files import LARGEST, check_places, read_input, write_all
from postproc.language.text.source import Replacements, Source, apply, as_bytes
from postproc.language.text.stamp import read_stamp

# The record beside an output that gives the source back, byte for byte.

T = TypeVar("T")
SUFFIX = ".postproc.json"
EDITS, TARGETS = b'"edits": [', b'], "targets": {'
CURE = "Restore needs the record that was written beside the program"
EDITED = "was edited after it was compensated: overwritten. Edit its source instead"
BLOCK = 50  # lines per checksum: how closely a later edit can be located


def sidecar_path(output: Path) -> Path:
    """Name the record of an output.

    >>> sidecar_path(Path("job.compensated.pdl")).name
    'job.compensated.pdl.postproc.json'
    """
    return output.with_name(output.name + SUFFIX)


def sha256(data: bytes) -> str:
    """Hash bytes."""
    return hashlib.sha256(data).hexdigest()


def file_sha256(path: str | Path) -> str:
    """Hash a file without holding it.

    Raises:
        OSError: It cannot be read.
    """
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def path_between(folder: PurePath, file: PurePath) -> str:
    """Return the path of a file from a folder on, with ``/``; both from one root.

    >>> path_between(PurePath("R1/Program"), PurePath("R1/System/$config.dat"))
    '../System/$config.dat'
    """
    return PurePath(os.path.relpath(file, folder)).as_posix()


def block_checksums(data: bytes) -> list[int]:
    """Checksum every `BLOCK` lines, so that a later edit can be located."""
    starts = Source("", data).line_starts[::BLOCK].tolist()
    marks = [*starts, len(data)] if data else []
    return [zlib.crc32(data[a:b]) for a, b in pairwise(marks)]


@dataclass(frozen=True)
class FileRecord:
    """How one output file differs from its source.

    Attributes:
        source_sha256, output_sha256: Hashes of the bytes.
        checksums: CRC-32 of every `BLOCK` lines of the output.
        edits: What the output's bytes were before, ascending: in a file start, end and
            the original as Latin-1 text. The stamp is the first of them.
        targets: What came of the targets in it, see `compensation.outcome`; empty in
            records of older versions. Columns are arrays before they are written.
    """

    source_sha256: str
    output_sha256: str
    checksums: Sequence[int]
    edits: Replacements
    targets: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def read(cls, told: Mapping[str, Any]) -> Self:
        """Take what a record's file says of one output file.

        Raises:
            KeyError, ValueError, TypeError: It is something else.
        """
        rows = told["edits"]
        if len(rows) * max((len(str(text)) for *_, text in rows), default=0) > LARGEST:
            raise ValueError("replaced texts are numbers, and these are longer")
        return cls(
            str(told["source_sha256"]),
            str(told["output_sha256"]),
            [int(c) for c in told["checksums"]],
            Replacements(
                np.array([int(start) for start, _, _ in rows], dtype=np.int64),
                np.array([int(end) for _, end, _ in rows], dtype=np.int64),
                np.array([str(text).encode("latin-1") for *_, text in rows], "S"),
            ),
            dict(told.get("targets", {})),
        )

    def to_json(self) -> Iterator[bytes]:
        """Write the record piece by piece: it is as long as the program."""
        told = {name: value for name, value in vars(self).items() if name != "edits"}
        targets = told.pop("targets")
        yield (json.dumps(told)[:-1] + ', "edits": [').encode()
        comma = b""
        for some in self.edits.pieces():
            yield comma + _rows(some)
            comma = b", "
        yield b'], "targets": {'
        for number, (key, value) in enumerate(targets.items()):
            yield f"{', ' if number else ''}{json.dumps(key)}: ".encode()
            if isinstance(value, np.ndarray):  # a column of numbers
                column = shortest(value, 9) if value.dtype.kind == "f" else whole(value)
                yield b"[" + text_of(len(value), [column, Cells(b", ")])[:-2] + b"]"
            else:
                yield json.dumps(value).encode()
        yield b"}}"


def _rows(edits: Replacements) -> bytes:
    """Write edits as JSON lists of start, end and text, with commas between."""
    start, end = whole(edits.start).behind(b"["), whole(edits.end).behind(b", ")
    text = Cells(b", ", quoted=as_bytes(edits.new))
    return text_of(len(edits), [start, end, text, Cells(b"], ")])[:-2]


LeftLine = tuple[str, int, Reason]
"""A file, a line of its source, and the reason why it is not corrected."""

AssumedLine = tuple[str, int, str]
"""A file, a line of its source, and what was assumed there."""


@dataclass(frozen=True)
class Sidecar:
    """The records of a program and of the files written with it.

    Attributes:
        version, model: What wrote it, and the model's id.
        files: The record of every file that was written, by name.
        options: What the user asked for.
        left: What may hold targets, was left, and no record of a file tells: targets
            in files that were not changed, moves that are never reached, statements
            that are not understood.
        assumed: routines that were assumed motionless because the shipped list says so:
            where the first call of each stands, and its message.
        tolerance: How many targets pass which tolerance, as
            `ToleranceCheck.to_record` writes it; empty where nobody asked.
        read: SHA-256 of every file that the job was read from, as it was then, by its
            path from the folder of the record; empty in records of older versions.
    """

    version: str
    model: str
    files: Mapping[str, FileRecord]
    options: Mapping[str, Any] = field(default_factory=dict)
    left: tuple[LeftLine, ...] = ()
    assumed: tuple[AssumedLine, ...] = ()
    tolerance: Mapping[str, Any] = field(default_factory=dict)
    read: Mapping[str, str] = field(default_factory=dict)

    def list_uncorrected_in(self, name: str) -> tuple[LeftLine, ...]:
        """Return what was left in a file, beside what its own record tells."""
        return tuple(line for line in self.left if line[0] == name)

    def to_json(self) -> Iterator[bytes]:
        """Write the record as JSON text, piece by piece."""
        head: dict[str, Any] = {"postproc": self.version, "model": self.model}
        left = [(file, line, why.text, why.name) for file, line, why in self.left]
        head |= {"uncorrected": left} if left else {}
        head |= {"assumed": self.assumed} if self.assumed else {}
        head |= {"tolerance": dict(self.tolerance)} if self.tolerance else {}
        head["options"] = dict(self.options)
        head |= {"read": dict(self.read)} if self.read else {}
        yield (json.dumps(head)[:-1] + ', "files": {').encode()
        for number, (name, record) in enumerate(self.files.items()):
            yield f"{', ' if number else ''}{json.dumps(name)}: ".encode()
            yield from record.to_json()
        yield b"}}\n"

    def rename_files(self, names: Mapping[str, str]) -> Sidecar:
        """Let the record speak of its files by other names.

        Args:
            names: New names by old ones; outputs that have none are left out.
        """
        files = {names[name]: r for name, r in self.files.items() if name in names}
        main = next(iter(self.files), None)
        rest = not files or main in names

        def own(lines: Sequence[tuple[str, int, T]]) -> tuple[tuple[str, int, T], ...]:
            return tuple(
                (names.get(file, file), line, told)
                for file, line, told in lines
                if file in names or (rest and file not in self.files)
            )

        return replace(
            self,
            files=files,
            left=own(self.left),
            assumed=own(self.assumed),
            read={names.get(name, name): digest for name, digest in self.read.items()},
        )

    def source_of(self, name: str) -> str | None:
        """Return the SHA-256 of the source of a file, None where it is not told."""
        record = self.files.get(name)
        return self.read.get(name) if record is None else record.source_sha256


def read_sidecar(path: Path) -> Sidecar:
    """Read a record.

    Raises:
        ProgramError: It is missing, or not a record.
    """
    return _record(path, read_input(path, CURE))


def read_without_edits(path: Path) -> Sidecar:
    """Read a record but for its edits, which are most of it; it has none then.

    Raises:
        ProgramError: It is missing, or not a record.
    """
    return _record(path, _without_edits(read_input(path, CURE)))


def list_edited(record: Path) -> list[Path]:
    """Return the outputs beside a record that were changed since they were written.

    Those that were restored are not among them. Nothing where there is no record, or
    none that can be read.
    """
    try:
        told = read_without_edits(record)
    except ProgramError:
        return []
    own = record.name.removesuffix(SUFFIX)
    ours = {name: {digest} for name, digest in told.read.items() if name == own}
    ours |= {n: {f.source_sha256, f.output_sha256} for n, f in told.files.items()}
    found = ((record.with_name(name), digests) for name, digests in ours.items())
    return [p for p, digests in found if p.is_file() and file_sha256(p) not in digests]


def _without_edits(text: bytes) -> bytes:
    """Cut the edits out of a record as `FileRecord.to_json` writes it.

    A quote in a text is escaped, so that neither mark can stand inside of one.
    """
    head, *files = text.split(EDITS)
    kept = [head]
    for file in files:
        _, found, rest = file.partition(TARGETS)
        if not found:
            return text
        kept.append(found + rest)
    return EDITS.join(kept)


def _record(path: Path, text: bytes) -> Sidecar:
    try:
        data = json.loads(text)
        files = {name: FileRecord.read(told) for name, told in data["files"].items()}
        if not all(map(_is_name, files)):
            raise ValueError("a name that no file has")
        version, model = str(data["postproc"]), str(data["model"])
        left = tuple(
            map(_read_uncorrected_line, data.get("uncorrected", data.get("left", ())))
        )
        assumed = tuple(
            (str(f), int(n), str(text)) for f, n, text in data.get("assumed", ())
        )
        options, tolerance = data.get("options", {}), dict(data.get("tolerance", {}))
        read = {name: str(digest) for name, digest in data.get("read", {}).items()}
        return Sidecar(version, model, files, options, left, assumed, tolerance, read)
    except (
        *(ValueError, KeyError, TypeError, AttributeError),
        *(RecursionError, OverflowError),
    ):
        raise ProgramError(path, "is not a record of postproc", CURE) from None


def _read_uncorrected_line(told: Sequence[Any]) -> LeftLine:
    """Take a line that was left; version 0.1.0 gave its text without a code."""
    file, line, text, *code = told
    return str(file), int(line), Reason.named(str(code[0]) if code else "", str(text))


def _is_name(name: str) -> bool:
    r"""Tell whether a file beside the record can have a name.

    >>> _is_name("job.pdl"), _is_name(""), _is_name(".."), _is_name("a\0b")
    (True, False, False, False)
    """
    return Path(name).name not in ("", "..") and "\0" not in name


# Give a compensated program back as it was.

BESIDE = "Put it beside its record"
OF_PAGES = (
    "A page that was changed, such as a data list, has a record of its own: restore "
    "that"
)


def restore(data: bytes, record: FileRecord, name: str) -> bytes:
    """Undo the edits of one file.

    Args:
        data: The compensated file.
        record: How it differs from its source.
        name: Name for messages.

    Raises:
        ProgramError: The file was changed since it was compensated, or the record does
            not belong to it.
    """
    stamp = read_stamp(data)
    if stamp is not None and stamp.source != record.source_sha256.lower():
        problem = "its stamp names another source than its record"
        raise ProgramError(name, problem, CURE, line=1)
    if sha256(data) != record.output_sha256.lower():
        _check_transfer(data, record, name)
        raise ProgramError(
            name,
            f"was changed after it was compensated ({_where(data, record)})",
            "Undo that change, or take the source from your archive",
            line=_first_changed_line(data, record),
        )
    try:
        source = apply(data, record.edits)
    except ValueError:
        source = b""  # an edit lies outside of the file
    if sha256(source) != record.source_sha256.lower():
        raise ProgramError(
            name, "the record does not give its source back", "It belongs elsewhere"
        )
    return source


LINE_ENDS = (b"\r\n", b"\n", b"\r")
COUNTED = 200  # times that a controller may have saved a program
_RELEASE = re.compile(rb"(?m)^(&REL[ \t]+)(\d{1,9})\b")


def _check_transfer(data: bytes, record: FileRecord, name: str) -> None:
    """Refuse a file that differs as a controller or a transfer changes files.

    Raises:
        ProgramError: It has other line ends, or ``&REL`` was counted up.
    """
    wanted = record.output_sha256.lower()
    plain = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    for text in (data, *(plain.replace(b"\n", end) for end in LINE_ENDS)):
        ends = "came back with other line ends" if text != data else ""
        if ends and sha256(text) == wanted:
            cure = "Transfer it in binary mode, or take the source from your archive"
            raise ProgramError(name, ends, cure)
        counted = _restore_revision(text, wanted)
        if counted is not None:
            now, before = counted
            problem = (
                f"its &REL was counted up from {before} to {now} on the controller"
            )
            problem = f"{ends}, and {problem}" if ends else problem
            cure = "Set it back, or take the source from your archive"
            raise ProgramError(name, problem, cure)


def _restore_revision(data: bytes, wanted: str) -> tuple[int, int] | None:
    """Return &REL as it is, and with which the file is what was written, or None."""
    found = _RELEASE.search(data)
    if found is None:
        return None
    now = int(found[2])
    for before in range(now - 1, max(now - COUNTED, -1), -1):
        text = data[: found.start(2)] + str(before).encode() + data[found.end(2) :]
        if sha256(text) == wanted:
            return now, before
    return None


def _first_changed_line(data: bytes, record: FileRecord) -> int:
    """Return the first line of the first block that differs, 1-based."""
    now = block_checksums(data)
    pairs = zip(now, record.checksums, strict=False)
    block = next((i for i, (a, b) in enumerate(pairs) if a != b), None)
    if block is None:
        block = min(len(now), len(record.checksums))
    return block * BLOCK + 1


def _where(data: bytes, record: FileRecord) -> str:
    """Say between which lines the first change lies."""
    first = _first_changed_line(data, record)
    return f"between lines {first} and {first + BLOCK - 1}"


def restore_file(compensated: Path, output: Path | None = None) -> list[Path]:
    """Restore a program, and the variable file written with it, over itself.

    Args:
        compensated: The compensated program.
        output: Where to put the program instead; variable files go beside it.

    Returns:
        The files written.

    Raises:
        ProgramError: No record, one that does not speak of the program, or a file was
            changed since.
        OutputError: A file cannot be written, or would be written over the record;
            nothing is changed then.
    """
    path = sidecar_path(compensated)
    record = read_sidecar(path)
    target = output or compensated
    restored: dict[Path, bytes] = {}
    if compensated.name not in record.files:
        kept = _read_unchanged(compensated, record, path)
        restored |= {} if output is None else {output: kept}
    for name, file in record.files.items():
        source = compensated.with_name(Path(name).name)
        place = source
        if output is not None:
            place = target.with_name(target.stem + source.suffix)
            place = target if source == compensated else place
        check_places([*restored, place], [path])
        restored[place] = restore(read_input(source, BESIDE), file, str(source))
    write_all(restored)
    return list(restored)


def _read_unchanged(program: Path, record: Sidecar, path: Path) -> bytes:
    """Read a program that its record does not name: only its values were changed.

    Raises:
        ProgramError: The record speaks of no file, or the program was changed.
    """
    data = read_input(program, BESIDE)
    if read_stamp(data) is not None:
        raise ProgramError(path, f"does not speak of {program.name}", CURE)
    if not record.files:
        problem = f"speaks of no file: nothing was changed in {program.name} itself"
        raise ProgramError(path, problem, OF_PAGES)
    return data
