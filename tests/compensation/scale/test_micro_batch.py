"""Programs in one pass: the bytes, records and reports of each alone."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import DEFAULT_OPTIONS, Options
from postproc.compensation.scale import micro_batch
from postproc.compensation.scale.micro_batch import Given, compensate_batch
from postproc.compensation.solver import iterate
from postproc.exceptions import CellError, ModelError, PostprocError, ProgramError
from postproc.report.json import report_text
from postproc.robot.cell import load_cell
from tests.bench.made import KINDS
from tests.conftest import ROOT
from tests.generated.landing import program as generated
from tests.plant import program

CORPUS = 30  # generated programs
EMPTY = b"PROGRAM nothing\nBEGIN\nEND nothing\n"


def given(name: str, source: bytes, variables: bytes | None = None) -> Given:
    """Give a program without pages."""
    return Given(name, source, variables, {})


def alone(one: Given, cell, model, options):
    """Compensate it as the only one."""
    try:
        return compensate(one.source, cell, model, name=one.name, options=options,
                          variables=one.variables, pages=one.pages)  # fmt: skip
    except PostprocError as exc:
        return exc


def said(outcome):
    """Tell everything that comes of a program, but for the time that it took.

    Which files it was read from a batch knows by their places.
    """
    if isinstance(outcome, Exception):
        return repr(outcome)
    outcome = replace(outcome, record=replace(outcome.record, read={}))
    report = json.loads(report_text(outcome))
    del report["stages_s"]
    return outcome.outputs, outcome.sidecar, outcome.summary(), report


def assert_as_alone(programs, cell, model, options=DEFAULT_OPTIONS):
    """Compare what comes of programs together with what comes of each alone."""
    found = compensate_batch(programs, cell, model, options)
    assert len(found) == len(programs)
    for one, outcome in zip(programs, found, strict=True):
        assert said(outcome) == said(alone(one, cell, model, options)), one.name
    return found


@pytest.fixture(scope="module")
def mixed():
    """Samples, production programs of every kind, generated ones with their pages."""
    paths = sorted((ROOT / "programs").glob("*.pdl"))
    lsv = [path.with_suffix(".lsv") for path in paths]
    out = [
        given(path.name, path.read_bytes(), v.read_bytes() if v.exists() else None)
        for path, v in zip(paths, lsv, strict=True)
    ]
    made = [(kind, make(120)) for kind, make in KINDS.items()]
    out += [given(f"{kind}.pdl", one.source, one.variables) for kind, one in made]
    for seed in range(CORPUS):
        pages = dict(generated(seed)[0].files)
        out.append(Given("job.pdl", pages.pop("job.pdl"), None, pages))
    return out


@pytest.mark.slow
def test_mixed_programs(mixed, job_model):
    cell = load_cell(ROOT / "programs" / "cell.toml")
    meant = [said(alone(one, cell, job_model, DEFAULT_OPTIONS)) for one in mixed]
    for size in (2, 5, 100):
        for first in range(0, len(mixed), size):
            some = mixed[first : first + size]
            found = compensate_batch(some, cell, job_model, DEFAULT_OPTIONS)
            for k, outcome in enumerate(found, first):
                assert said(outcome) == meant[k], (size, mixed[k].name)


@pytest.mark.parametrize(
    "options", [Options(shared_points="clone"), Options(orientation=True)]
)
def test_other_options(mixed, options, job_model):
    cell = load_cell(ROOT / "programs" / "cell.toml")
    assert_as_alone(mixed[:10], cell, job_model, options)


def test_small_programs_share_a_pass(job_cell, job_model, monkeypatch):
    sizes = []
    correct = micro_batch.correct_batch

    def watched(readings, *given):
        sizes.append(len(readings))
        return correct(readings, *given)

    monkeypatch.setattr(micro_batch, "correct_batch", watched)
    monkeypatch.setattr(micro_batch, "PASS", 35)
    programs = [given(f"p{k}.pdl", program(f"p{k}", 10, k)) for k in range(7)]
    programs.insert(4, given("nothing.pdl", EMPTY))
    assert_as_alone(programs, job_cell, job_model)
    assert sizes == [3, 3]  # 11 visits each; p3 is alone before the empty one


def test_what_is_no_program_stops_no_other(job_cell, job_model):
    good = given("good.pdl", program("good", 10, 1))
    stamped = compensate(good.source, job_cell, job_model).outputs["program.pdl"]
    programs = [
        given("bad.pdl", b"PROGRAM bad\0"), good, given("stamped.pdl", stamped),
        given("lost.pdl", program("lost", 5, 2)),
    ]  # fmt: skip
    found = assert_as_alone(programs, job_cell, job_model)
    kinds = [isinstance(one, ProgramError) for one in found]
    assert kinds == [True, False, True, False]


def test_one_that_fails_later_leaves_the_others(job_cell, job_model, monkeypatch):
    correct = micro_batch.correct

    def fragile(reading, *given):
        if any(text.source.name == "p1.pdl" for text in reading.texts):
            raise MemoryError
        return correct(reading, *given)

    monkeypatch.setattr(micro_batch, "correct", fragile)
    programs = [given(f"p{k}.pdl", program(f"p{k}", 10, k)) for k in range(3)]
    found = compensate_batch(programs, job_cell, job_model, DEFAULT_OPTIONS)
    assert isinstance(found[1], MemoryError)
    for k in (0, 2):
        assert said(found[k]) == said(
            alone(programs[k], job_cell, job_model, DEFAULT_OPTIONS)
        )


def test_a_wrong_cell_or_model_is_said_of_every_program(job_cell, job_model):
    programs = [given(f"p{k}.pdl", program(f"p{k}", 3, k)) for k in range(2)]
    robot = job_cell.file.robot.model_copy(update={"absolute_accuracy": True})
    file = job_cell.file.model_copy(update={"robot": robot})
    twice = replace(job_cell, file=file)
    found = compensate_batch(programs, twice, job_model, DEFAULT_OPTIONS)
    assert [type(one) for one in found] == [CellError, CellError]
    other = replace(job_model, arm_id="another")
    found = compensate_batch(programs, job_cell, other, DEFAULT_OPTIONS)
    assert [type(one) for one in found] == [ModelError, ModelError]


def test_nothing_at_all(job_cell, job_model):
    assert compensate_batch([], job_cell, job_model, DEFAULT_OPTIONS) == []


def test_what_changes_sides_as_it_is_written_comes_out_as_alone(
    job_cell, job_model, monkeypatch
):
    for name in ("SAME", "OTHER"):  # so that rounding is enough
        monkeypatch.setattr(iterate, name, 0.006)
    monkeypatch.setattr(iterate.WrittenNumbers, "round", lambda _, values: values)
    begins, write = [], iterate.write_and_read_back

    def watched(reading, *given):
        begins.append(len(reading.begins))
        return write(reading, *given)

    monkeypatch.setattr(iterate, "write_and_read_back", watched)
    programs = [given(f"p{k}.pdl", crowded(f"p{k}", k)) for k in range(6)]
    for one in programs:
        alone(one, job_cell, job_model, DEFAULT_OPTIONS)
    assert len(begins) > len(programs)  # some are written twice
    begins.clear()
    compensate_batch(programs, job_cell, job_model, DEFAULT_OPTIONS)
    assert set(begins) == {len(programs)} and len(begins) > 1  # never alone
    assert_as_alone(programs, job_cell, job_model)


def crowded(name: str, seed: int) -> bytes:
    """Write moves by not much more than what joints have play."""
    rng, at = np.random.default_rng(seed), np.array([100.0, 100.0, 250.0])
    lines = [f"PROGRAM {name}", "BEGIN", "  MOVE JOINT TO {0, 0, -90, 0, 60, 0}"]
    for _ in range(10):
        at = at + rng.normal(0.0, 0.5, 3)
        numbers = ", ".join(f"{v:.1f}" for v in (*at, 0.0, 170.0, 0.0))
        lines.append(f"  MOVE LINEAR TO POS({numbers}, '')")
    return "\r\n".join([*lines, f"END {name}", ""]).encode("ascii")
