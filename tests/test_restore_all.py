"""restore(compensate(x)) == x: samples, the corpus, generated programs."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from postproc.compensate import compensate
from postproc.exceptions import PostprocError
from postproc.restore import restore
from postproc.robot.cell import load_cell
from postproc.sidecar import FileRecord
from tests.language.generator import Generator
from tests.language.test_corpus import chapters

PROGRAMS = Path(__file__).parents[1] / "programs"
SAMPLES = ("drilling", "handling", "milling", "spot")


def assert_restored(source, cell, model, variables=None):
    """Compensate, and give back every file that came out."""
    outcome = compensate(source, cell, model, name="x.pdl", variables=variables)
    records = json.loads(outcome.sidecar)["files"]
    sources = {"x.pdl": source, "x.lsv": variables}
    assert set(records) <= set(outcome.outputs)
    for name, data in outcome.outputs.items():
        if name in records:
            record = FileRecord.read(records[name])
            assert restore(data, record, name) == sources[name]
        else:
            assert data == sources[name]
    return records


@pytest.mark.parametrize("name", SAMPLES)
def test_samples(name, job_model):
    cell = load_cell(PROGRAMS / "cell.toml")
    values = PROGRAMS / f"{name}.lsv"
    source = (PROGRAMS / f"{name}.pdl").read_bytes()
    variables = values.read_bytes() if values.exists() else None
    assert assert_restored(source, cell, job_model, variables)


def test_the_corpus(job_cell, job_model):
    restored = 0
    for _, program, _ in chapters():
        try:
            restored += bool(assert_restored(program.encode(), job_cell, job_model))
        except PostprocError:
            continue  # refused: nothing came out that could be restored
    assert restored > 0.9 * len(chapters())


@pytest.mark.parametrize("seed", range(30))
def test_generated_programs(seed, job_cell, job_model):
    text = Generator(random.Random(seed), exact=seed % 2 == 0).program().text
    assert assert_restored(text.encode("latin-1"), job_cell, job_model)
