"""Work in the background; `diff`, which reads a record there, ends as it should."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from postproc.compensation.scale.workers import in_background
from postproc.exceptions import PostprocError
from tests.bench.made import milling

LINES = 20_000
PATIENCE = 60.0  # [s] until a command has ended
COMMAND = "from postproc.cli import main; main()"


def test_it_is_done_meanwhile() -> None:
    let = threading.Event()
    ask = in_background(lambda: let.wait(PATIENCE) and threading.get_ident())
    let.set()
    assert ask() not in (False, threading.get_ident()) and ask() == ask()


def test_an_error_is_raised_where_its_result_is_asked_for() -> None:
    def work() -> None:
        raise PostprocError("told")

    in_background(work)
    with pytest.raises(PostprocError, match="told"):
        in_background(work)()


@pytest.fixture(scope="module")
def pair(tmp_path_factory) -> tuple[Path, Path]:
    """Write two long programs that differ in most lines."""
    folder = tmp_path_factory.mktemp("pair")
    paths = folder / "a.pdl", folder / "b.pdl"
    text = milling(LINES).source
    for path, data in zip(paths, (text, text.replace(b"0,", b"1,")), strict=True):
        path.write_bytes(data)
    return paths


def begun(pair: tuple[Path, Path], *options: str) -> subprocess.Popen:
    """Begin `diff`, in a process group of its own."""
    given = [sys.executable, "-c", COMMAND, "diff", *map(str, pair), *options]
    pipe = subprocess.PIPE
    return subprocess.Popen(given, stdout=pipe, stderr=pipe, start_new_session=True)


def ended(run: subprocess.Popen) -> tuple[int, bytes]:
    """Wait for the end of a command: its exit code, what it said."""
    with run:
        said = run.stderr.read()
        return run.wait(PATIENCE), said


@pytest.mark.parametrize("options", [(), ("--report", "-")])
def test_a_closed_pipe_ends_it_quietly(pair, options) -> None:
    run = begun(pair, *options)
    assert run.stdout.read(100_000)  # within the first block
    run.stdout.close()
    assert ended(run) == (2, b"")


def test_ctrl_c_ends_it_without_a_word(pair) -> None:
    run = begun(pair)
    assert run.stdout.read(100_000)
    os.killpg(run.pid, signal.SIGINT)
    assert ended(run) == (-signal.SIGINT, b"")
