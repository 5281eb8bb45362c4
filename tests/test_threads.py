"""Numerical libraries start no threads while the package computes."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from postproc import _native, threads
from postproc.threads import POOLS

SIZES = """
import os, threading
import numpy, scipy.linalg
from threadpoolctl import threadpool_info
from postproc import threads

def sizes():
    return {pool["num_threads"] for pool in threadpool_info()}
"""
NESTED = """
with threads.one_thread():
    with threads.one_thread():
        pass
    print(*sizes())
print(*sizes())
"""
RAISED = """
@threads.in_one_thread
def broken():
    raise ValueError(*sizes())

try:
    broken()
except ValueError as exc:
    print(*exc.args)
print(*sizes())
"""
BESIDE = """
begun, over = threading.Event(), threading.Event()

def longer():
    with threads.one_thread():
        begun.set()
        over.wait()

other = threading.Thread(target=longer)
with threads.one_thread():
    other.start()
    begun.wait()
print(*sizes())
over.set()
other.join()
print(*sizes())
"""
FORKED = """
with threads.one_thread():
    child = os.fork()
    if child == 0:
        with threads.one_thread():
            small = sizes() == {1}
        os._exit(0 if small and sizes() == {1} else 1)
    print(1 if os.waitpid(child, 0)[1] == 0 else "large in the child")
print(*sizes())
"""
LATER = """
threads.start_no_threads()
with threads.one_thread():
    print(*sizes())
print(*sizes())
"""


def run(code: str, **said: str) -> list[str]:
    """Run code in a process whose environment says so much of pools; what it prints."""
    told = {k: v for k, v in os.environ.items() if k not in POOLS} | said
    done = subprocess.run(
        [sys.executable, "-c", SIZES + code], capture_output=True, text=True, env=told
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.skipif((os.cpu_count() or 1) == 1, reason="one core has no pools")
@pytest.mark.parametrize("code", [NESTED, RAISED, BESIDE, FORKED, LATER])
def test_pools_are_small_within_and_as_before_behind(code):
    within, behind = run(code)
    assert int(within) == 1 < int(behind)


@pytest.mark.skipif((os.cpu_count() or 1) == 1, reason="one core has no pools")
def test_pools_that_the_user_has_stated_stay_as_they_are():
    assert run(NESTED, OPENBLAS_NUM_THREADS="2", OMP_NUM_THREADS="2") == ["2", "2"]


def test_where_the_environment_says_it_nothing_is_looked_for():
    code = "import sys\nwith threads.one_thread(): pass\nprint('scipy' in sys.modules)"
    head = "from postproc import threads\n"
    told = {k: v for k, v in os.environ.items() if k not in POOLS}
    for said, loaded in (({"OMP_NUM_THREADS": "1"}, "False"), ({}, "True")):
        done = subprocess.run(
            [sys.executable, "-c", head + code],
            capture_output=True, text=True, check=True, env=told | said,
        )  # fmt: skip
        assert done.stdout.split() == [loaded]


def test_processes_share_the_cores(monkeypatch) -> None:
    seen: list[int] = []
    monkeypatch.setattr(_native, "use_cores", seen.append)
    monkeypatch.setattr(threads, "count_cores", lambda: 8)
    for processes in (3, 16, 1):
        threads.share_cores(processes)
    assert seen == [2, 1, 8]
