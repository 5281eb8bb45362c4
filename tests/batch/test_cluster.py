"""A real scheduler and two worker processes on loopback, one of them killed."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys

import pytest

from postproc.batch.cluster import ClusterPool
from postproc.batch.plan import make_plan
from postproc.batch.run import BatchOptions, batch, default_log
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.exceptions import PostprocError
from tests.batch.dask_cluster import SCHEDULER, WORKER, Cluster, free_port
from tests.conftest import ROOT
from tests.inline import InlinePool
from tests.plant import contents, grow, pages

Client = pytest.importorskip("distributed").Client


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and two workers."""
    with Cluster(tmp_path / "scratch", workers=2) as running:
        yield running


def test_same_bytes_as_here_although_a_worker_is_killed(
    tmp_path, job_folder, cluster, monkeypatch
):
    monkeypatch.setattr("postproc.batch.workers.FIRST", 1)  # many chunks
    monkeypatch.setattr("postproc.batch.workers.LASTING", 0.05)
    source = grow(tmp_path / "src", 24, 2)
    pages(source / "pages", 2, 2)
    (source / "bad.pdl").write_bytes(b"\0")
    plan = make_plan(
        None, job_folder / "cell.toml", job_folder / "model.json", DEFAULT_OPTIONS
    )

    def order(name):
        target = tmp_path / name
        return BatchOptions(source, target, plan, default_log(target), False)

    class Wounded(ClusterPool):
        """Kills a worker that is at work, once."""

        killed = 0

        def submit(self, chunk):
            if not self.killed:
                self._client.wait_for_workers(2, timeout=30)
            future = super().submit(chunk)
            busy = [w for w, tasks in self._client.processing().items() if tasks]
            if busy and not self.killed:
                self.killed = self._client.run(os.getpid, workers=busy[:1])[busy[0]]
                os.kill(self.killed, signal.SIGKILL)
            return future

    pools = []

    def gather(plan):
        pools.append(Wounded(plan.setups, cluster.address))
        return pools[0]

    local = batch(order("local"), lambda plan: InlinePool(plan.setups))
    there = batch(order("cluster"), gather)
    killed = [worker for worker in cluster.workers if worker.pid == pools[0].killed]
    assert [worker.wait(10) for worker in killed] == [-signal.SIGKILL]
    assert contents(tmp_path / "cluster") == contents(tmp_path / "local")
    assert there.exit_code == local.exit_code == 2
    assert there.rows() == local.rows()


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("tcp://127.0.0.1:9", "workers answers"),
        ("tls://127.0.0.1:9", "configuration of Dask"),
    ],
)
def test_nobody_answers(address, why, monkeypatch):
    monkeypatch.setattr("postproc.batch.cluster.CONNECT", 0.2)
    with pytest.raises(PostprocError, match=why):
        ClusterPool((), address)


def test_certificates_that_are_not_there(tmp_path):
    import dask

    tls = "distributed.comm.tls"
    names = {f"{tls}.ca-file": "ca.pem", f"{tls}.client.cert": "cert.pem",
             f"{tls}.client.key": "key.pem"}  # fmt: skip
    named = {key: str(tmp_path / name) for key, name in names.items()}
    with dask.config.set(named), pytest.raises(PostprocError, match="No such file"):
        ClusterPool((), "tls://127.0.0.1:9")


def listeners(pid):
    """Return the addresses at which a process and its children listen."""
    psutil = pytest.importorskip("psutil")
    try:
        whole = psutil.Process(pid)
        family = [whole, *whole.children(recursive=True)]
        found = [c for one in family for c in one.net_connections("inet")]
    except psutil.NoSuchProcess:
        return set()
    return {c.laddr.ip for c in found if c.status == psutil.CONN_LISTEN}


def test_what_the_tests_start_listens_on_loopback_only(cluster):
    with Client(cluster.address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=30)
        found = [listeners(process.pid) for process in cluster.processes]
    assert found == [{"127.0.0.1"}] * 3


def documented(section):
    """Return the commands of a section of the page on clusters, each as words."""
    text = (ROOT / "docs" / "cluster.md").read_text()
    text = text.split(f"## {section}\n")[1].split("\n## ")[0].replace("\\\n", " ")
    lines = re.findall(r"(?m)^    (\S.*)$", text)
    return [shlex.split(re.sub(r"\b[A-Z_]+_THREADS=1 ", "", line)) for line in lines]


def test_the_first_example_is_encrypted_and_open_to_nobody_else(
    tmp_path, job_folder, monkeypatch
):
    port = str(free_port())
    commands = [
        [word.replace("8786", port).replace("8787", "0").replace("4096", "2048")
         for word in words]
        for words in documented("A cluster")
    ]  # fmt: skip
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    grow(tmp_path / "nominal", 2, 1)
    for name in ("cell.toml", "model.json"):
        shutil.copy(job_folder / name, tmp_path)
    running = []
    dask = {"scheduler": SCHEDULER, "worker": WORKER}
    try:
        for command in commands:
            if command[0] == "export":
                monkeypatch.setenv(*command[1].split("="))
                continue
            if command[0] == "dask":
                words = [*dask[command[1]], *command[2:]]
                words = ["2" if word == "auto" else word for word in words]
                running.append(subprocess.Popen(words, stderr=subprocess.DEVNULL))
                continue
            if command[0] == "postproc":
                main = "from postproc.cli import main; main()"
                command = [sys.executable, "-P", "-c", main, *command[1:]]
            done = subprocess.run(command, capture_output=True, text=True, timeout=120)
            assert done.returncode == 0, (command, done.stderr)
        assert [listeners(process.pid) for process in running] == [{"127.0.0.1"}] * 2
        stranger = f"tcp://127.0.0.1:{port}"
        monkeypatch.setattr("postproc.batch.cluster.CONNECT", 2.0)
        with pytest.raises(PostprocError, match="workers answers"):
            ClusterPool((), stranger)
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait(30)
    assert (tmp_path / "compensated" / "line000" / "job00000.pdl").is_file()
