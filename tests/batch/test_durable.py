"""Runs that end early: killed, interrupted, out of room. Nothing is ever lost."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import threading
import time

import pytest

from postproc.batch.plan import make_plan
from postproc.batch.run import default_log, lock_folder
from postproc.batch.workers import LocalPool
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.exceptions import OutputError
from postproc.files import TEMPORARY
from tests.chaos import Plant, build, chaos, descendants, gone
from tests.plant import contents, grow


@pytest.fixture
def plant(tmp_path, job_folder):
    cell, model = job_folder / "cell.toml", job_folder / "model.json"
    return Plant(tmp_path, cell, model, 2)


def started(plant, *more, **how):
    """Start a batch and wait until it has written something."""
    target = plant.root / "dst"
    command = plant.command(target, *more)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **how)
    end = time.monotonic() + 60.0
    while process.poll() is None and time.monotonic() < end:
        if target.exists() and any(target.rglob("*.pdl")):
            break
        time.sleep(0.01)
    return process


def test_killed_runs_resume_to_the_same_tree(plant):
    build(plant.source, 16)
    chaos(plant, 1, seed=2)


def test_an_interrupted_run_stops_in_order_and_can_go_on(plant):
    grow(plant.source, 60, 1)
    process = started(plant)
    workers = list(descendants(process.pid))
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    there = contents(plant.root / "dst")
    assert process.returncode == 128 + signal.SIGTERM
    assert "--resume" in said and "Traceback" not in said
    assert not [p for p in there if p.endswith(TEMPORARY)]
    assert 0 < len([p for p in there if p.endswith(".pdl")]) < 60
    gone(workers)
    assert plant.run(plant.root / "dst", "--resume") == 0
    assert len([p for p in contents(plant.root / "dst") if p.endswith(".pdl")]) == 60


def test_a_second_signal_ends_a_run_at_once(plant):
    grow(plant.source, 60, 1)
    process = started(plant)
    workers = list(descendants(process.pid))
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    assert process.returncode in (128 + signal.SIGTERM, 128 + signal.SIGINT)
    assert "Traceback" not in said
    there = contents(plant.root / "dst")
    assert not [p for p in there if p.endswith(TEMPORARY)]
    gone(workers)


def test_a_run_that_cannot_stop_in_order_is_ended(tmp_path):
    code = (
        "import time\n"
        "from postproc.batch.run import stoppable\n"
        "from postproc.files import replace_file\n"
        "from pathlib import Path\n"
        "with stoppable(), replace_file(Path('copy')) as out:\n"
        "    print('begun', flush=True)\n"
        "    for _ in range(600): time.sleep(0.1)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE
    )
    assert process.stdout.readline() == b"begun\n"
    start = time.monotonic()
    process.terminate()
    assert process.wait(timeout=60) == 128 + signal.SIGTERM
    assert time.monotonic() - start < 2.0
    assert not list(tmp_path.iterdir())


def test_closed_workers_leave_no_thread_behind(plant):
    # The interpreter would close its pipe a second time on its way out.
    plan = make_plan(None, plant.cell, plant.model, DEFAULT_OPTIONS)
    before = set(threading.enumerate())
    pool = LocalPool(plan.setups, 2)
    for _ in range(5):
        working = [pool.submit([]) for _ in range(4)]
        pool.renew()
        working += [pool.submit([])]
    pool.close()
    assert set(threading.enumerate()) <= before
    assert all(w.done() for w in working)


def test_a_full_disk_stops_the_run_and_loses_nothing(plant):
    grow(plant.source, 3, 1)
    (plant.source / "zz.bin").write_bytes(bytes(3_000_000))
    target = plant.root / "dst"
    small = (1_000_000, 1_000_000)
    done = subprocess.run(
        plant.command(target),
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, small),
    )
    assert done.returncode == 2
    assert "the disk is full" in done.stderr and "Traceback" not in done.stderr
    assert "zz.bin" not in contents(target)
    assert not [p for p in contents(target) if p.endswith(TEMPORARY)]
    assert plant.run(target, "--resume") == 0
    assert len(contents(target)) == 3 * 2 + 1 + 1


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write to any folder")
def test_a_read_only_target_is_said(plant):
    grow(plant.source, 1, 1)
    plant.root.chmod(0o500)
    done = subprocess.run(
        plant.command(plant.root / "dst"), capture_output=True, text=True, timeout=60
    )
    plant.root.chmod(0o700)
    assert done.returncode == 2
    assert "read-only" in done.stderr and "Traceback" not in done.stderr


def test_a_read_only_target_is_told_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda place, mode: mode != os.W_OK)
    with pytest.raises(OutputError, match="read-only"), lock_folder(tmp_path / "dst"):
        raise AssertionError("held")


def test_a_place_that_cannot_be_written_fails_alone(plant):
    grow(plant.source, 12, 1)
    target = plant.root / "dst"
    target.mkdir()
    (target / "line001").write_bytes(b"a file where a folder is to be")
    assert plant.run(target) == 2
    there = contents(target)
    assert there["line001"] == contents(target)["line001"]
    assert sum(p.endswith(".pdl") for p in there) == 10
    assert "line001/job00010.pdl" in default_log(target).read_text()


def test_ctrl_c_does_not_reach_the_process_that_workers_are_forked_from():
    code = (
        "from multiprocessing import forkserver\n"
        "from postproc.batch.workers import start_server\n"
        "start_server()\n"
        "pid = forkserver._forkserver._forkserver_pid\n"
        "print(open(f'/proc/{pid}/status').read())\n"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    status = dict(
        line.split(":\t") for line in done.stdout.splitlines() if ":\t" in line
    )
    assert int(status["SigBlk"], 16) & 1 << (signal.SIGINT - 1)
    assert not int(status["SigBlk"], 16) & 1 << (signal.SIGTERM - 1)
