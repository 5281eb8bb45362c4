"""A job whose texts are read, checked and written on two cores is the same job."""

from __future__ import annotations

import sys

import pytest

from postproc.compensation import parallel, rewrite
from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Outcome
from postproc.compensation.parallel import in_worker
from postproc.compensation.rewrite import VerificationError
from postproc.language import source
from postproc.report.json import report_text
from tests.bench.made import KINDS

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="one process does it where there is no fork"
)

TARGETS = 300


@pytest.fixture
def children(monkeypatch) -> list[object]:
    """Let two cores share short texts; collect what is done in children."""
    begun: list[object] = []

    def watched(work, *more):
        begun.append(work)
        return in_worker(work, *more)

    monkeypatch.setattr(parallel, "in_worker", watched)
    monkeypatch.setattr(parallel, "available", lambda: 2)
    monkeypatch.setattr(parallel, "LONG", 2)
    monkeypatch.setattr(rewrite, "WORTH", 1)
    monkeypatch.setattr(source, "AT_ONCE", 100)
    monkeypatch.setattr("postproc.report.json.AT_ONCE", 100)
    return begun


@pytest.fixture
def job(bench_cell, bench_model):
    def run(kind: str, processes: int) -> Outcome:
        made = KINDS[kind](TARGETS)
        with_ = {"name": made.name, "variables": made.variables}
        return compensate(
            made.source, bench_cell, bench_model, **with_, processes=processes
        )

    return run


def told(outcome: Outcome) -> list[str]:
    """Return record and report but for the stages."""
    return [outcome.sidecar, report_text(outcome).partition('"stages_s"')[0]]


@pytest.mark.parametrize("kind", ["milling", "spot"])
def test_two_cores_give_what_one_gives(job, children, kind: str) -> None:
    alone = job(kind, 1)
    assert children == []
    shared = job(kind, 2)
    assert len(children) >= 1  # comparing
    assert told(shared) == told(alone)
    assert shared.outputs == alone.outputs


def test_what_is_wrong_with_a_text_is_told_before_what_is_wrong_with_visits(
    job, children, monkeypatch
) -> None:
    monkeypatch.setattr(rewrite, "equivalent", lambda *given: "visits")
    with pytest.raises(VerificationError, match=r"\.pdl: visits$"):
        job("milling", 2)
    monkeypatch.setattr(rewrite, "_in_text", lambda *given: "texts")
    for processes in (1, 2):
        with pytest.raises(VerificationError, match="texts; nothing is written"):
            job("milling", processes)
