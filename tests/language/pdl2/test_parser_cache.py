"""Tables read back parse like those just made; whatever fails, they are made."""

from __future__ import annotations

import os
from pathlib import Path

import lark
import pytest

from postproc.language.text import grammars
from postproc.language.text.source import source_from_bytes
from postproc.language.text.statement_table import read_lines

ROOT = Path(__file__).parents[3]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache folder; no parser in memory, now and afterwards."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    grammars.line_parser.cache_clear()
    yield tmp_path / "cache" / "postproc"
    grammars.line_parser.cache_clear()


@pytest.fixture
def made(monkeypatch):
    """How often tables were made."""
    count: list[str] = []

    class Counting(lark.Lark):
        def __init__(self, *given, **options):
            count.append(options["start"])
            super().__init__(*given, **options)

    monkeypatch.setattr(grammars.lark, "Lark", Counting)
    return count


def again(name: str = "lsv") -> lark.Lark:
    """Ask for a parser as a new process does."""
    grammars.line_parser.cache_clear()
    return grammars.line_parser(name, "line")


def read(with_: lark.Lark, form: str) -> object:
    try:
        return with_.parse(form)
    except lark.exceptions.LarkError as exc:
        return type(exc)


def forms() -> list[str]:
    """Return the forms of all sample programs, and of each one broken in its middle."""
    found: dict[str, None] = {}
    for path in sorted((ROOT / "programs").glob("*.pdl")):
        lines = read_lines(source_from_bytes(path.name, path.read_bytes()))
        found |= dict.fromkeys(lines.shapes.texts)
    return [*found, *(f[: len(f) // 2] + ") ::" + f[len(f) // 2 :] for f in found)]


def test_tables_read_back_parse_alike(cache, made):
    first, second = again("pdl2"), again("pdl2")
    assert made == ["line"]
    tried = forms()
    given = [read(first, form) for form in tried]
    assert [read(second, form) for form in tried] == given
    kinds = {isinstance(said, lark.Tree) for said in given}
    assert kinds == {True, False}  # some that are understood, some that are not


def test_each_grammar_has_its_own_tables(cache, made, monkeypatch):
    again("lsv")
    text = grammars.grammar("lsv")
    monkeypatch.setattr(grammars, "grammar", lambda name: text + "\n// changed\n")
    again("lsv")
    assert len(made) == len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("keep", [0, 10, 5000, -1])
def test_a_damaged_file_is_made_anew(cache, made, keep):
    again()
    (file,) = cache.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[:keep])
    assert read(again(), "A: \0") == read(again(), "A: \0")
    assert len(made) == 2
    assert file.read_bytes()[grammars.SIZE :] != b""


def test_what_is_no_table_is_made_anew(cache, made):
    again()
    (file,) = cache.iterdir()
    grammars.keep(file.name, b"whole, but no table")
    again()
    again()
    assert len(made) == 2


def test_a_file_that_others_may_write_is_not_trusted(cache, made):
    again()
    (file,) = cache.iterdir()
    file.chmod(0o666)
    again()
    assert len(made) == 2
    assert file.stat().st_mode & 0o777 == 0o600
    assert cache.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_may_write_to_is_not_trusted(cache, made):
    again()
    cache.chmod(0o777)
    again()
    assert len(made) == 2


@pytest.mark.parametrize("put", [os.mkfifo, Path.mkdir])
def test_what_is_no_file_is_not_waited_for(cache, made, put):
    again()
    (file,) = cache.iterdir()
    file.unlink()
    put(file)
    again()
    assert len(made) == 2


def test_a_link_is_not_followed(cache, made, tmp_path):
    again()
    (file,) = cache.iterdir()
    file.symlink_to(file.rename(tmp_path / "elsewhere"))
    again()
    assert len(made) == 2


def test_no_folder_is_no_error(tmp_path, monkeypatch, made):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    again()
    again()
    assert len(made) == 2
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", no_home)
    assert grammars.folder() is None
    again()
    assert len(made) == 3


def no_home() -> Path:
    raise RuntimeError("Could not determine home directory.")


def test_a_full_disk_leaves_nothing_behind(cache, made, monkeypatch):
    monkeypatch.setattr(os, "replace", full)
    again()
    assert list(cache.iterdir()) == []


def full(*_: object) -> None:
    raise OSError(28, "No space left on device")


def test_a_relative_folder_is_none_of_ours(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert grammars.folder() == tmp_path / ".cache" / "postproc"
    for home in ("relative", str(tmp_path / "not there")):
        monkeypatch.setenv("HOME", home)
        assert grammars.folder() is None
