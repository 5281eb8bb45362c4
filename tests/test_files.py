"""Durable writing: all or nothing."""

import os

import pytest

from postproc import files
from postproc.exceptions import OutputError
from postproc.files import TEMPORARY, write_all


def test_writes_and_replaces(tmp_path):
    old = tmp_path / "a"
    old.write_bytes(b"old")
    write_all({old: b"new", tmp_path / "b": b"\x00\xff"})
    assert old.read_bytes() == b"new"
    assert (tmp_path / "b").read_bytes() == b"\x00\xff"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


def test_missing_folder_changes_nothing(tmp_path):
    first = tmp_path / "a"
    with pytest.raises(OutputError, match="folder does not exist"):
        write_all({first: b"x", tmp_path / "none" / "b": b"y"})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write to any folder")
def test_read_only_folder(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="read-only"):
        write_all({tmp_path / "a": b"x"})


def test_failing_rename_leaves_no_temporary(tmp_path, monkeypatch):
    def refuse(src, dst):
        raise PermissionError(13, "Permission denied", str(dst))

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OutputError):
        write_all({tmp_path / "a": b"x"})
    assert list(tmp_path.iterdir()) == []


def test_a_signal_finds_a_temporary_file_as_soon_as_it_is_there(tmp_path, monkeypatch):
    opened, noted = os.open, []

    def note(path, *given):
        if str(path).endswith(TEMPORARY):
            noted.append(str(path) in files._unfinished)
        return opened(path, *given)

    monkeypatch.setattr(os, "open", note)
    write_all({tmp_path / "a": b"x", tmp_path / "b": b"y"})
    assert noted == [True, True] and not files._unfinished


def test_keeps_permissions(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"x")
    path.chmod(0o640)
    write_all({path: b"y"})
    assert path.stat().st_mode & 0o777 == 0o640
