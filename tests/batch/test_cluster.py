"""A real scheduler and two worker processes on loopback, one of them killed."""

from __future__ import annotations

import os
import signal

import pytest

from postproc.batch.cluster import ClusterPool
from postproc.batch.plan import make_plan
from postproc.batch.run import Order, batch, default_log
from postproc.compensation.options import AS_USUAL
from postproc.exceptions import PostprocError
from tests.batch.dask_cluster import Cluster
from tests.inline import InlinePool
from tests.plant import contents, grow, pages

pytest.importorskip("distributed")


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
        None, job_folder / "cell.toml", job_folder / "model.json", AS_USUAL
    )

    def order(name):
        target = tmp_path / name
        return Order(source, target, plan, default_log(target), False)

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
    [("tcp://127.0.0.1:9", "workers answers"), ("tls://127.0.0.1:9", "--tls")],
)
def test_nobody_answers(address, why, monkeypatch):
    monkeypatch.setattr("postproc.batch.cluster.CONNECT", 0.2)
    with pytest.raises(PostprocError, match=why):
        ClusterPool((), address)


def test_certificates_that_are_not_there(tmp_path):
    with pytest.raises(PostprocError, match="No such file"):
        ClusterPool((), "tls://127.0.0.1:9", tmp_path)
