"""restore(compensate(x)) == x: samples, the corpus, generated programs."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.output.sidecar import FileRecord, restore
from postproc.exceptions import PostprocError
from postproc.robot.cell import load_cell
from tests.fuzz.originals import case_programs
from tests.generated.landing import program
from tests.language.pdl2.generator import Generator
from tests.language.pdl2.test_corpus import chapters, with_values
from tests.language.pdl2.whole_jobs import Job

PROGRAMS = Path(__file__).parents[3] / "programs"
SAMPLES = sorted(path.stem for path in PROGRAMS.glob("*.pdl"))
WAYS = (
    Options(),
    Options(shared_points="clone"),
    Options(orientation=True, edit_exported=True),
)


def assert_restored(files, cell, model, options=WAYS[0]):
    """Compensate a program with its files, and give back every one that came out."""
    main, *others = files
    values = main.replace(".pdl", ".lsv")
    pages = {name: files[name] for name in others if name != values}
    outcome = compensate(files[main], cell, model, name=main, pages=pages,
                         variables=files.get(values), options=options)  # fmt: skip
    records = json.loads(outcome.sidecar)["files"]
    assert set(records) <= set(outcome.outputs)
    for name, data in outcome.outputs.items():
        if name in records:
            record = FileRecord.read(records[name])
            assert restore(data, record, name) == files[name]
        else:
            assert data == files[name]
    return records


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("options", WAYS)
def test_samples(name, options, job_model):
    cell = load_cell(PROGRAMS / "cell.toml")
    paths = (PROGRAMS / f"{name}.pdl", PROGRAMS / f"{name}.lsv")
    files = {path.name: path.read_bytes() for path in paths if path.exists()}
    assert assert_restored(files, cell, job_model, options)


def test_the_corpus_and_the_cases(job_cell, job_model):
    jobs = []
    for _, case, _ in chapters():
        program, values = (text.encode() for text in with_values(case))
        jobs.append({"x.pdl": program} | ({"x.lsv": values} if values else {}))
    jobs += [{"x.pdl": files["job.pdl"]} for files in case_programs()]
    restored = 0
    for files in jobs:
        try:
            restored += bool(assert_restored(files, job_cell, job_model))
        except PostprocError:
            continue  # refused: nothing came out that could be restored
    assert restored > 0.9 * len(jobs)


@pytest.mark.parametrize("seed", range(16))
def test_generated_programs(seed, job_cell, job_model):
    made = Generator(random.Random(seed), exact=seed % 2 == 0).program()
    assert assert_restored(made.files, job_cell, job_model)


@pytest.mark.parametrize("seed", range(16))
def test_generated_jobs_of_several_files(seed, job_cell, job_model):
    made = Job(random.Random(seed), exact=seed % 2 == 0).program()
    options = WAYS[seed % len(WAYS)]
    assert assert_restored(made.files, job_cell, job_model, options)


@pytest.mark.parametrize("seed", range(24))
def test_generated_programs_within_reach(seed, job_cell, job_model):
    made, options = program(seed)
    assert assert_restored(made.files, job_cell, job_model, options)
