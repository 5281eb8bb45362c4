"""Give a compensated program back as it was."""

from __future__ import annotations

from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import read_input, write_all
from postproc.language.source import apply
from postproc.sidecar import (
    BLOCK,
    FileRecord,
    block_checksums,
    read_sidecar,
    sha256,
    sidecar_path,
)

BESIDE = "Put it beside its record"


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
    if sha256(data) != record.output_sha256:
        raise ProgramError(
            name,
            f"was changed after it was compensated ({_where(data, record)})",
            "Undo that change, or take the source from your archive",
            line=_first_changed_line(data, record),
        )
    source = apply(data, record.edits)
    if sha256(source) != record.source_sha256:
        raise ProgramError(
            name, "the record does not give its source back", "It belongs elsewhere"
        )
    return source


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
        ProgramError: No record, or a file was changed since.
        OutputError: A file cannot be written; nothing is changed then.
    """
    record = read_sidecar(sidecar_path(compensated))
    target = output or compensated
    restored: dict[Path, bytes] = {}
    if output is not None and compensated.name not in record.files:
        restored[output] = read_input(
            compensated, BESIDE
        )  # only its values were changed
    for name, file in record.files.items():
        source = compensated.with_name(Path(name).name)
        place = source
        if output is not None:
            place = target.with_name(target.stem + source.suffix)
            place = target if source == compensated else place
        restored[place] = restore(read_input(source, BESIDE), file, str(source))
    write_all(restored)
    return list(restored)
