"""Work on two cores gives what one gives, and ends as it does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from postproc.compensation import parallel
from postproc.compensation.parallel import LONG, in_background, parallel_map
from postproc.exceptions import PostprocError
from tests.bench.made import milling

LINES = 20_000
PATIENCE = 60.0  # [s] until a command has ended

# `diff` as on two cores with files of any length; the argument in front of the
# others is run before.
COMMAND = """
import os, sys
from postproc.compensation import parallel
from postproc.report import diff, diff_output
parallel.LONG, parallel.available, diff.LONG = 1, lambda: 2, 1
exec(sys.argv.pop(1))
from postproc.cli import main
main()
"""
DEFECT = """
here, make = os.getpid(), diff_output._Writer._block
def block(*given):
    if os.getpid() != here:
        raise ValueError("odd")
    return make(*given)
diff_output._Writer._block = block
"""


@pytest.fixture
def cores(monkeypatch):
    """Let there be so many cores."""

    def let(number: int) -> None:
        monkeypatch.setattr(parallel, "available", lambda: number)

    return let


def worker(task: int) -> tuple[int, int]:
    """Tell who does a task."""
    return task, os.getpid()


@pytest.mark.parametrize("every", [2, 3, 4])
def test_results_are_in_order_whoever_makes_them(cores, every: int) -> None:
    cores(2)
    made = list(parallel_map(worker, range(100, 100 + LONG), every))
    assert [task for task, _ in made] == list(range(100, 100 + LONG))
    here = [task % every == 100 % every for task, by in made if by == os.getpid()]
    assert len({by for _, by in made}) == 2 and len(here) == -(-LONG // every)


@pytest.mark.parametrize(("number", "tasks"), [(1, 5 * LONG), (2, LONG - 1), (2, 0)])
def test_one_core_or_little_work_makes_no_process(cores, number, tasks) -> None:
    cores(number)
    made = list(parallel_map(worker, range(tasks)))
    assert made == [(task, os.getpid()) for task in range(tasks)]


def test_an_error_comes_after_what_is_before_it(cores) -> None:
    def make(task: int) -> int:
        if task == 7:  # the child's
            raise PostprocError("told")
        return task

    cores(2)
    made = parallel_map(make, range(LONG))
    assert [next(made) for _ in range(7)] == list(range(7))
    with pytest.raises(PostprocError, match="told"):
        next(made)


def test_meanwhile_is_done_by_another_where_it_is_worth_it(cores) -> None:
    for number, worth, others in ((2, True, 1), (2, False, 0), (1, True, 0)):
        cores(number)
        with in_background(os.getpid, worth=worth) as ask:
            assert (ask() != os.getpid()) == others


def test_an_error_meanwhile_is_raised_where_its_result_is_asked_for(cores) -> None:
    def work() -> None:
        raise PostprocError("told")

    for number in (1, 2):
        cores(number)
        with in_background(work, worth=True):
            pass
        with in_background(work, worth=True) as ask, pytest.raises(PostprocError):
            ask()


@pytest.fixture(scope="module")
def pair(tmp_path_factory) -> tuple[Path, Path]:
    """Write two long programs that differ in most lines."""
    folder = tmp_path_factory.mktemp("pair")
    paths = folder / "a.pdl", folder / "b.pdl"
    text = milling(LINES).source
    for path, data in zip(paths, (text, text.replace(b"0,", b"1,")), strict=True):
        path.write_bytes(data)
    return paths


def begun(pair: tuple[Path, Path], *options: str, first: str = "") -> subprocess.Popen:
    """Begin `diff` on two cores, in a process group of its own."""
    given = [sys.executable, "-c", COMMAND, first, "diff", *map(str, pair), *options]
    pipe = subprocess.PIPE
    return subprocess.Popen(given, stdout=pipe, stderr=pipe, start_new_session=True)


def group(leader: int) -> list[int]:
    """List the processes of a group."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, own = stat.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(own) == leader and state != "Z":
            found.append(int(stat.parent.name))
    return found


def ended(run: subprocess.Popen) -> tuple[int, str, list[int]]:
    """Wait for the end of a command: its exit code, what it said, who is left."""
    with run:
        said = run.stderr.read()
    end = time.monotonic() + PATIENCE
    while group(run.pid) and time.monotonic() < end:
        time.sleep(0.01)
    return run.returncode, said.decode(), group(run.pid)


@pytest.mark.parametrize("options", [(), ("--json", "-")])
def test_two_cores_write_what_one_writes(pair, options) -> None:
    texts = []
    for first in ("", "parallel.available = lambda: 1"):
        run = begun(pair, *options, first=first)
        text, said = run.communicate(timeout=PATIENCE)
        assert (run.returncode, said) == (1, b"")
        texts.append(text)
    assert texts[0] == texts[1] and texts[0].count(b"\n") > LINES


@pytest.mark.parametrize("options", [(), ("--json", "-")])
def test_a_closed_pipe_ends_both_quietly(pair, options) -> None:
    run = begun(pair, *options)
    assert run.stdout.read(100_000)  # within the first block
    assert len(group(run.pid)) == 2
    run.stdout.close()
    assert ended(run) == (2, "", [])


def test_ctrl_c_ends_both_without_a_word(pair) -> None:
    run = begun(pair)
    assert run.stdout.read(100_000)
    os.killpg(run.pid, signal.SIGINT)
    assert ended(run) == (-signal.SIGINT, "", [])


def test_a_defect_in_the_child_is_told_as_one_here(pair) -> None:
    run = begun(pair, first=DEFECT)
    text, said = run.communicate(timeout=PATIENCE)
    assert text and run.returncode == 2
    assert said.startswith(b"postproc: internal error: ValueError: odd. ")
    assert b"Traceback" not in said and group(run.pid) == []
