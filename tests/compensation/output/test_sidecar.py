"""Records are read without their edits by those who only ask what came of targets."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.output.sidecar import (
    FileRecord,
    Sidecar,
    read_sidecar,
    read_without_edits,
)
from postproc.exceptions import ProgramError
from postproc.language.text.source import Replacements

NASTY = (b'], "targets": {', b'"edits": [', b"\\", b'"', b'\\"edits": [', b"1.5", b"}")


def record(targets: dict[str, object]) -> Sidecar:
    """Make the record of two files with texts that look like the record itself."""
    start = 10 * np.arange(len(NASTY), dtype=np.int64)
    edits = Replacements(start, start + 3, np.array(NASTY, "S"))
    file = FileRecord("ab", "cd", [1, 2], edits, targets)
    options = {"note": '"edits": [ ], "targets": {'}
    return Sidecar("1.0", "m", {"a.pdl": file, "edits": file}, options)


def bare(sidecar: Sidecar) -> dict[str, object]:
    """Say what a record holds but for edits."""
    files = {name: vars(file) | {"edits": 0} for name, file in sidecar.files.items()}
    return vars(sidecar) | {"files": files}


@pytest.mark.parametrize("targets", [{}, {"line": [1], "reasons": ['], "targets": {']}])
def test_only_the_edits_are_missing(tmp_path, targets) -> None:
    path = tmp_path / "a.json"
    path.write_text(
        b"".join(record(targets).to_json()).decode("ascii"), encoding="utf-8"
    )
    found = read_without_edits(path)
    assert bare(found) == bare(read_sidecar(path))
    assert [len(file.edits) for file in found.files.values()] == [0, 0]
    assert len(read_sidecar(path).files["edits"].edits) == len(NASTY)


def test_a_record_that_was_laid_out_anew_is_read_whole(tmp_path) -> None:
    path = tmp_path / "a.json"
    text = b"".join(record({"line": [1]}).to_json()).decode("ascii")
    path.write_text(json.dumps(json.loads(text), indent=2), encoding="utf-8")
    assert bare(read_without_edits(path)) == bare(read_sidecar(path))


def test_what_is_no_record_is_refused(tmp_path) -> None:
    path = tmp_path / "a.json"
    text = b"".join(record({}).to_json()).decode("ascii")
    for damaged in ("", "{}", text[:-3], text.replace("cd", 'cd"')):
        path.write_text(damaged, encoding="utf-8")
        with pytest.raises(ProgramError, match="is not a record"):
            read_without_edits(path)


def test_a_record_without_edits_is_read(tmp_path) -> None:
    path = tmp_path / "a.json"
    none = Replacements(np.empty(0, np.int64), np.empty(0, np.int64), np.array([], "S"))
    file = replace(record({}).files["a.pdl"], edits=none)
    empty = replace(record({}), files={"a.pdl": file})
    path.write_text(b"".join(empty.to_json()).decode("ascii"), encoding="utf-8")
    assert bare(read_without_edits(path)) == bare(read_sidecar(path))


@pytest.mark.parametrize("texts", [(b"1.5", b"", b"-12.25"), NASTY, (b"1", b"\xe9\n")])
def test_edits_are_written_as_json_lists(texts) -> None:
    start = 10 * np.arange(len(texts), dtype=np.int64)
    edits = Replacements(start, start + 3, np.array(texts, "S"))
    told = [[*span, new.decode("latin-1")] for span, new in edits]
    text = b"".join(FileRecord("ab", "cd", [], edits).to_json()).decode("ascii")
    assert f'"edits": {json.dumps(told)},' in text


def test_columns_are_written_as_lists_are() -> None:
    columns = {
        "line": np.array([7, 0, 12]),
        "correction_mm": np.array([0.0, 0.1234, 12.5]),
        "none": np.empty(0),
        "reasons": ["", "far \xe9"],
    }
    lists = {k: v if k == "reasons" else v.tolist() for k, v in columns.items()}
    assert b"".join(record(columns).to_json()).decode("ascii") == b"".join(
        record(lists).to_json()
    ).decode("ascii")
    assert json.dumps(lists) in b"".join(record(columns).to_json()).decode("ascii")
