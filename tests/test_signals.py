"""A signal ends a command within two seconds and leaves nothing behind."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.chaos import LongRun, end_many
from tests.plant import program

WRITING = """
import os, signal, sys
from pathlib import Path
from postproc import cli, files

cli._leave_signals_to_the_system()
number = signal.Signals[sys.argv[1]]

def pieces():
    yield b"begun"
    if sys.argv[2] == "written":
        os.kill(os.getpid(), number)
    yield b"ended"

renamed, replace = [], os.replace

def rename(*names):
    replace(*names)
    renamed.append(names)
    if sys.argv[2] == "renamed" and len(renamed) == 1:
        os.kill(os.getpid(), number)

os.replace = rename
files.write_all({Path("a"): pieces(), Path("b"): pieces()})
"""


def written(folder: Path, number: signal.Signals, when: str) -> tuple[int, set[str]]:
    """Send a signal while two files are written; return the exit code and all files."""
    command = [sys.executable, "-c", WRITING, number.name, when]
    done = subprocess.run(command, cwd=folder, capture_output=True, timeout=60)
    assert b"Traceback" not in done.stderr
    return done.returncode, {path.name for path in folder.iterdir()}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_while_files_are_written_leaves_none(tmp_path, number):
    assert written(tmp_path, number, "written") == (128 + number, set())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_between_two_files_comes_after_both(tmp_path, number):
    assert written(tmp_path, number, "renamed") == (128 + number, {"a", "b"})


def test_signals_are_left_as_they_were(tmp_path):
    from postproc.files import write_all

    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    write_all({tmp_path / "a": b"x"})
    assert before == [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]


def test_an_ignored_signal_stays_ignored(tmp_path):
    # As `nohup` and shells do it for what runs in the background.
    code = (
        "import signal; from postproc import cli\n"
        "cli._leave_signals_to_the_system()\n"
        "print(signal.getsignal(signal.SIGINT) == signal.SIG_IGN)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    assert done.stdout == "True\n", done.stderr


def test_a_long_run_ends_at_any_moment(tmp_path, job_folder):
    (tmp_path / "job.pdl").write_bytes(program("job", 1500, 1))
    cell, model = job_folder / "cell.toml", job_folder / "model.json"
    assert end_many(LongRun(tmp_path, cell, model), 2, seed=5) < 2.0
