"""Restoring undoes edits, and refuses whatever was changed since."""

import pytest

from postproc.compensation.record import (
    FileRecord,
    Sidecar,
    block_checksums,
    read_sidecar,
    restore,
    restore_file,
    sha256,
    sidecar_path,
)
from postproc.exceptions import ProgramError
from postproc.language.source import Edit, Replacements, Span

SOURCE = b"PROGRAM x\r\nMOVE TO {1.0, \xe4 2}\r\nEND x"
OUTPUT = b"-- stamp\r\nPROGRAM x\r\nMOVE TO {1.25, \xe4 2}\r\nEND x"
EDITS = Replacements.of([Edit(Span(0, 10), b""), Edit(Span(30, 34), b"1.0")])


@pytest.fixture
def record():
    return FileRecord(sha256(SOURCE), sha256(OUTPUT), block_checksums(OUTPUT), EDITS)


def test_undoes_edits(record):
    assert restore(OUTPUT, record, "x.pdl") == SOURCE


def test_refuses_what_was_edited_since_and_says_where(record):
    with pytest.raises(ProgramError, match=r"x\.pdl:1: was changed .* lines 1 and 50"):
        restore(OUTPUT.replace(b"1.25", b"1.26"), record, "x.pdl")


def test_locates_a_late_change():
    text = b"".join(b"line %d\n" % i for i in range(200))
    record = FileRecord(
        sha256(text), sha256(text), block_checksums(text), Replacements.of([])
    )
    with pytest.raises(ProgramError, match="lines 151 and 200"):
        restore(text.replace(b"line 170", b"line 17x"), record, "x.pdl")


def test_refuses_a_foreign_record(record):
    foreign = FileRecord("0" * 64, record.output_sha256, record.checksums, EDITS)
    with pytest.raises(ProgramError, match="belongs elsewhere"):
        restore(OUTPUT, foreign, "x.pdl")


def test_round_trip_through_files(tmp_path, record):
    program = tmp_path / "job.pdl"
    program.write_bytes(OUTPUT)
    side = Sidecar("0", "m", {"job.pdl": record}, {"clone": False})
    sidecar_path(program).write_text("".join(side.to_json()))
    read = read_sidecar(sidecar_path(program)).files["job.pdl"].edits
    assert list(read) == list(EDITS)
    assert restore_file(program, tmp_path / "back.pdl") == [tmp_path / "back.pdl"]
    assert (tmp_path / "back.pdl").read_bytes() == SOURCE
    assert program.read_bytes() == OUTPUT
    restore_file(program)
    assert program.read_bytes() == SOURCE


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"files": 3}', "{"])
def test_refuses_what_is_no_record(tmp_path, text):
    path = tmp_path / "x.postproc.json"
    path.write_text(text)
    with pytest.raises(ProgramError, match="not a record"):
        read_sidecar(path)


def test_missing_record(tmp_path):
    (tmp_path / "job.pdl").write_bytes(OUTPUT)
    with pytest.raises(ProgramError, match="cannot be read"):
        restore_file(tmp_path / "job.pdl")
