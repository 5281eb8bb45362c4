"""Restoring undoes edits, and refuses whatever was changed since."""

import json

import pytest

from postproc.compensation.output.sidecar import (
    FileRecord,
    Sidecar,
    block_checksums,
    read_sidecar,
    restore,
    restore_file,
    sha256,
    sidecar_path,
)
from postproc.exceptions import OutputError, ProgramError
from postproc.language.text.source import Edit, Replacements, Source, Span
from postproc.language.text.stamp import stamp_line

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
    sidecar_path(program).write_bytes(b"".join(side.to_json()))
    read = read_sidecar(sidecar_path(program)).files["job.pdl"].edits
    assert list(read) == list(EDITS)
    assert restore_file(program, tmp_path / "back.pdl") == [tmp_path / "back.pdl"]
    assert (tmp_path / "back.pdl").read_bytes() == SOURCE
    assert program.read_bytes() == OUTPUT
    restore_file(program)
    assert program.read_bytes() == SOURCE


ODD = {
    "a name of nothing": {"": {}},
    "a name of the folder above": {"..": {}},
    "a name with NUL": {"job\0.pdl": {}},
    "a huge offset": {"job.pdl": {"edits": [[10**30, 10**30, "1"]]}},
    "texts that would fill the memory": {
        "job.pdl": {"edits": [[0, 1, "1" * 10**5]] + [[1, 1, ""]] * 10**4}
    },
}


def odd_record(files):
    """Write a record of files of which only what is odd is told."""
    bare = {
        "source_sha256": sha256(SOURCE),
        "output_sha256": sha256(OUTPUT),
        "checksums": [],
        "edits": [],
    }
    told = {name: bare | own for name, own in files.items()}
    return json.dumps({"postproc": "0", "model": "m", "options": {}, "files": told})


@pytest.mark.parametrize("odd", ODD)
def test_an_odd_record_is_refused_in_words(tmp_path, odd):
    program = tmp_path / "job.pdl"
    program.write_bytes(OUTPUT)
    sidecar_path(program).write_text(odd_record(ODD[odd]))
    with pytest.raises(ProgramError, match="not a record"):
        restore_file(program)


@pytest.mark.parametrize("edit", [[-5, -1, "1"], [3, 10**12, "1"]])
def test_edits_outside_of_the_file_are_refused(tmp_path, edit):
    program = tmp_path / "job.pdl"
    program.write_bytes(OUTPUT)
    sidecar_path(program).write_text(odd_record({"job.pdl": {"edits": [edit]}}))
    with pytest.raises(ProgramError, match="belongs elsewhere"):
        restore_file(program)


def test_an_empty_record_restores_nothing_and_says_so(tmp_path):
    program = tmp_path / "job.pdl"
    program.write_bytes(OUTPUT)
    sidecar_path(program).write_text(odd_record({}))
    for output in (None, tmp_path / "back.pdl"):
        with pytest.raises(ProgramError, match="speaks of no file"):
            restore_file(program, output)
    assert program.read_bytes() == OUTPUT and not (tmp_path / "back.pdl").exists()


STAMPED = stamp_line("1.0", "m", Source("job.pdl", SOURCE), "--") + SOURCE


def test_a_record_of_another_program_is_refused(tmp_path, record):
    program = tmp_path / "job.pdl"
    program.write_bytes(STAMPED)
    sidecar_path(program).write_text(odd_record({"other.pdl": {}}))
    (tmp_path / "other.pdl").write_bytes(OUTPUT)
    with pytest.raises(ProgramError, match=r"does not speak of job\.pdl"):
        restore_file(program)


def test_a_record_that_does_not_fit_the_stamp_is_refused():
    # It gives back what it says, which is not what the stamp says.
    other = SOURCE + b"\r\n-- more"
    edits = Replacements.of(
        [
            Edit(Span(0, len(STAMPED) - len(SOURCE)), b""),
            Edit(Span(len(STAMPED), len(STAMPED)), b"\r\n-- more"),
        ]
    )
    forged = FileRecord(sha256(other), sha256(STAMPED), [], edits)
    with pytest.raises(ProgramError, match="its stamp names another source"):
        restore(STAMPED, forged, "job.pdl")


def test_nothing_is_restored_over_the_record(tmp_path, record):
    program = tmp_path / "job.pdl"
    program.write_bytes(OUTPUT)
    side = sidecar_path(program)
    side.write_bytes(b"".join(Sidecar("0", "m", {"job.pdl": record}).to_json()))
    before = side.read_bytes()
    with pytest.raises(OutputError, match="is an input"):
        restore_file(program, side)
    assert side.read_bytes() == before


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
