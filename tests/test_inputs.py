"""What comes from outside: how long it may be, and how its names are shown."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from postproc.cli.commands import app
from postproc.exceptions import ProgramError
from postproc.files import read_input
from tests.plant import program


def test_reads_no_more_than_a_program_can_be(tmp_path, monkeypatch):
    monkeypatch.setattr("postproc.files.LARGEST", 100)
    place = tmp_path / "job.pdl"
    place.write_bytes(bytes(100))
    assert read_input(place) == bytes(100)
    place.write_bytes(bytes(101))
    with pytest.raises(ProgramError, match="is longer than 100 bytes"):
        read_input(place)
    with pytest.raises(ProgramError, match="cannot be read"):
        read_input(tmp_path)


def test_the_filter_reads_no_more_either(job_folder, monkeypatch):
    monkeypatch.setattr("postproc.files.LARGEST", 100)
    files = ["--cell", str(job_folder / "cell.toml")]
    files += ["--model", str(job_folder / "model.json")]
    source = program("job", 9, 1)
    done = CliRunner().invoke(app, ["compensate", "-", *files], input=source)
    assert done.exit_code == 2
    assert "-: is longer than 100 bytes" in done.stderr
    assert done.stdout == ""


def test_names_of_files_cannot_steer_the_terminal(tmp_path, job_folder):
    place = tmp_path / "a\x1b[31m\nb.pdl"
    place.write_bytes(b"PROGRAM x\0")
    files = ["--cell", str(job_folder / "cell.toml")]
    files += ["--model", str(job_folder / "model.json")]
    for command in (["compensate", str(place), *files], ["restore", str(place)]):
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 2
        assert "\x1b" not in done.stderr
        assert "a\\x1b[31m\\nb.pdl" in done.stderr
