"""Libraries that are installed and cannot be loaded."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest
from typer.testing import CliRunner

from postproc.cli.commands import app
from postproc.exceptions import PostprocError
from postproc.verify import extra
from tests.verify.judged import PROGRAMS

INSIST = ("--set", "verify.second_opinion=true")
ALONE = ("--set", "verify.second_opinion=false")
KINDS = (
    "raise ImportError('libboost.so: not found')",
    "raise OSError('libhdf5.so: not found')",
    "raise RuntimeError('another build of numpy')",
    "raise AttributeError('numpy has no float')",
    "VERSION = 1  # another package of this name",
)


@pytest.fixture(params=KINDS)
def kind(request) -> str:
    return request.param


@pytest.fixture(params=sorted(extra.PACKAGES))
def library(request, kind, tmp_path, monkeypatch) -> Iterator[str]:
    """The name of a library that does not load."""
    folder = tmp_path / "packages"
    folder.mkdir()
    (folder / f"{request.param}.py").write_text(kind + "\n")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, request.param, raising=False)
    yield request.param
    sys.modules.pop(request.param, None)


def test_an_error_of_any_kind_is_a_broken_library(library) -> None:
    assert f"a library is broken ({library}: " in extra.explain_missing()
    with pytest.raises(PostprocError, match="pip install pin toppra"):
        extra.load()


def test_who_did_not_ask_gets_a_note(library, tmp_path, bench_model) -> None:
    """The exit code is that without the libraries."""
    tree, model = tmp_path / "tree", tmp_path / "model.json"
    tree.mkdir()
    bench_model.save(model)
    given = "--cell", str(PROGRAMS / "cell.toml"), "--model", str(model)
    done = CliRunner().invoke(app, ["check", str(tree), *given])
    plain = CliRunner().invoke(app, ["check", str(tree), *given, *ALONE])
    assert done.exit_code == plain.exit_code == 0
    note = f"no second opinion: a library is broken ({library}: "
    assert done.stderr.count(note) == 1
    asked = CliRunner().invoke(app, ["check", str(tree), *given, *INSIST])
    assert asked.exit_code == 2 and "pip install pin toppra" in asked.stderr


def test_libraries_that_load_are_not_broken() -> None:
    assert extra.explain_missing() == ""
    extra.load()
