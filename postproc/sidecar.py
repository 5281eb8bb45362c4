"""The record beside an output that gives the source back, byte for byte."""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from postproc.exceptions import ProgramError

SUFFIX = ".postproc.json"
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


def block_checksums(data: bytes) -> list[int]:
    """Checksum every `BLOCK` lines, so that a later edit can be located."""
    lines = data.splitlines(keepends=True)
    blocks = (lines[i : i + BLOCK] for i in range(0, len(lines), BLOCK))
    return [zlib.crc32(b"".join(block)) for block in blocks]


@dataclass(frozen=True)
class FileRecord:
    """How one output file differs from its source.

    Attributes:
        source_sha256, output_sha256: Hashes of the bytes.
        checksums: CRC-32 of every `BLOCK` lines of the output.
        edits: Start and end in the output, and the original bytes (as Latin-1 text),
            ascending. The stamp is the first of them.
        targets: What came of the targets in it, see `postproc.arrivals`; empty in
            records of older versions.
    """

    source_sha256: str
    output_sha256: str
    checksums: Sequence[int]
    edits: Sequence[tuple[int, int, str]]
    targets: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Sidecar:
    """The records of a program and of the files written with it."""

    version: str
    model: str
    files: Mapping[str, FileRecord]
    options: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the record as JSON text."""
        head = {"postproc": self.version, "model": self.model}
        files = {name: vars(record) for name, record in self.files.items()}
        return (
            json.dumps({**head, "options": dict(self.options), "files": files}) + "\n"
        )


def rename_files(record: str, names: Mapping[str, str]) -> str:
    """Let a record speak of its files by other names.

    Args:
        record: JSON text of a record.
        names: New names by old ones; files that have none are left out.
    """
    data = json.loads(record)
    files = data["files"].items()
    data["files"] = {names[name]: file for name, file in files if name in names}
    return json.dumps(data) + "\n"


def read_sidecar(path: Path) -> Sidecar:
    """Read a record.

    Raises:
        ProgramError: It is missing, or not a record.
    """
    cure = "Restore needs the record that was written beside the program"
    try:
        data = json.loads(path.read_bytes())
        files = {
            name: FileRecord(
                str(r["source_sha256"]),
                str(r["output_sha256"]),
                [int(c) for c in r["checksums"]],
                [(int(a), int(b), str(text)) for a, b, text in r["edits"]],
                dict(r.get("targets", {})),
            )
            for name, r in data["files"].items()
        }
        version, model = str(data["postproc"]), str(data["model"])
        return Sidecar(version, model, files, data.get("options", {}))
    except OSError as exc:
        raise ProgramError(path, f"cannot be read ({exc.strerror})", cure) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ProgramError(path, "is not a record of postproc", cure) from None
