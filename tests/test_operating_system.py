"""What systems differ in, as far as one of them can play the others."""

from __future__ import annotations

import io
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import postproc
from postproc import operating_system
from postproc.batch.plan import pattern_from_glob
from postproc.batch.workers import LocalPool
from postproc.files import TEMPORARY, replace_file, write_all
from postproc.operating_system import (
    hold_signals,
    lock_folder,
    print_any_text,
    start_worker_server,
)
from postproc.robot.arm_file import arm_path

PACKAGE = Path(postproc.__file__).parent

# What is on one kind of system only, and one module may use.
NOT_EVERYWHERE = {
    "os": {"fchmod", "fchown", "chown", "sched_getaffinity", "geteuid", "getuid",
           "O_DIRECTORY", "O_TEMPORARY", "mkfifo", "setsid", "killpg", "getloadavg"},
    "signal": {"SIGHUP", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGBREAK", "setitimer",
               "pthread_sigmask", "alarm"},
}  # fmt: skip
MODULES = {"fcntl", "msvcrt", "resource", "pwd", "grp", "termios", "winreg", "tty"}


def _used_names(path: Path) -> set[str]:
    """Name what a module uses that is not everywhere."""
    text = path.read_text("utf-8")
    found = {
        f"{module}.{name}"
        for module, names in NOT_EVERYWHERE.items()
        for name in re.findall(rf"\b{module}\.(\w+)", text)
        if name in names
    }
    imported = re.findall(r"^\s*(?:import|from) (\w+)", text, re.MULTILINE)
    return found | MODULES.intersection(imported)


def test_one_module_uses_what_not_every_system_has():
    found = {
        path.relative_to(PACKAGE).as_posix(): names
        for path in sorted(PACKAGE.rglob("*.py"))
        if (names := _used_names(path))
    }
    assert set(found) == {"operating_system.py"}
    assert "os.fchmod" in found["operating_system.py"]  # the search finds something


# A Python without what Windows has not: modules fail, names are missing.
WINDOWS = """
import os, signal, sys
for name in {os}: os.__dict__.pop(name, None)
for name in {signal}: signal.__dict__.pop(name, None)
for name in ("fcntl", "resource", "pwd", "grp", "termios"): sys.modules[name] = None
import importlib, pkgutil, postproc
for module in pkgutil.walk_packages(postproc.__path__, "postproc."):
    if module.name != "postproc.batch.ready":  # it runs on the system that is here
        importlib.import_module(module.name)
print("imported")
"""


def test_the_package_is_imported_without_what_windows_lacks():
    """The module of systems is imported first: it asks for them by the platform."""
    code = "import postproc.operating_system\n" + WINDOWS.format(
        os=sorted(NOT_EVERYWHERE["os"]),
        signal=sorted(NOT_EVERYWHERE["signal"]),
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent
    )
    assert done.stdout.strip() == "imported", done.stderr


def test_signals_wait_for_the_end_of_a_block():
    came = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: came.append(number))
    try:
        with hold_signals(signal.SIGTERM):
            signal.pthread_kill(threading.get_ident(), signal.SIGTERM)
            assert not came
        assert came == [signal.SIGTERM]
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_block_runs_where_signals_cannot_wait(monkeypatch):
    monkeypatch.delattr(signal, "pthread_sigmask")
    with hold_signals(signal.SIGTERM):
        pass


def test_a_locked_folder_is_empty_and_free_again(tmp_path):
    unlock = lock_folder(tmp_path)
    assert unlock is not None and lock_folder(tmp_path) is None
    assert not list(tmp_path.iterdir())
    unlock()
    again = lock_folder(tmp_path)
    assert again is not None
    again()


def test_workers_are_new_processes_where_there_is_no_fork(monkeypatch):
    """They do the same, as slowly as they load the package."""
    monkeypatch.setattr(multiprocessing, "get_all_start_methods", lambda: ["spawn"])
    assert start_worker_server("postproc.batch.ready").get_start_method() == "spawn"
    pool = LocalPool((), 1)
    try:
        future = pool._pool.submit(os.getpid)
        assert future.result(timeout=120) not in (os.getpid(), None)
    finally:
        pool.close()


def test_a_stream_of_256_characters_takes_any_text():
    out = io.TextIOWrapper(io.BytesIO(), encoding="cp1252", write_through=True)
    with pytest.raises(UnicodeEncodeError):
        out.write("→")
    print_any_text(out, None, io.StringIO())
    out.write("±0.1 → 中")
    assert out.buffer.getvalue() == "±0.1 ? ?".encode("cp1252")


@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["explain", "--code", "position-unknown"], ["arm", "list"]],
)
def test_commands_print_on_a_console_of_windows(arguments):
    names = {k: v for k, v in os.environ.items() if k != "PYTHONUTF8"}
    done = subprocess.run(
        [sys.executable, "-c", "from postproc.cli import main; main()", *arguments],
        capture_output=True, cwd=PACKAGE.parent,
        env=names | {"PYTHONIOENCODING": "cp1252:strict"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert b"internal error" not in done.stderr


def test_folders_may_be_separated_as_on_windows(tmp_path):
    assert pattern_from_glob(r"r1\**\*.pdl").fullmatch("r1/weld/job.pdl")
    assert not pattern_from_glob(r"r1\*.pdl").fullmatch("r1/weld/job.pdl")
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "mine.toml").write_text("")
    assert arm_path(r"arms\mine.toml", tmp_path) == tmp_path / "arms" / "mine.toml"


def test_files_are_written_without_rights_and_folders_that_open(tmp_path, monkeypatch):
    """As on Windows, where neither is there to be set or synced."""
    monkeypatch.setattr(sys, "platform", "win32")
    for name in ("fchmod", "O_DIRECTORY"):
        monkeypatch.delattr(os, name)
    write_all({tmp_path / "a": b"1", tmp_path / "b": b"2"})
    with replace_file(tmp_path / "a") as file:
        file.write(b"3")
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {
        "a": b"3",
        "b": b"2",
    }
    assert not [p for p in tmp_path.iterdir() if p.name.endswith(TEMPORARY)]


def test_a_file_that_stays_read_only_keeps_its_bits(tmp_path):
    place = tmp_path / "a"
    place.write_bytes(b"1")
    place.chmod(0o444)
    write_all({place: b"2"})
    assert place.read_bytes() == b"2" and place.stat().st_mode & 0o777 == 0o444


def test_the_module_says_what_this_system_has():
    assert signal.SIGHUP in operating_system.ENDING
    assert operating_system.ASKING == (signal.SIGINT, signal.SIGTERM)
    assert 1 <= operating_system.count_cores() <= (os.cpu_count() or 1)
