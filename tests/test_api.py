"""The Python interface: ten functions, loaded when they are asked for."""

from __future__ import annotations

import inspect
import subprocess
import sys
from typing import get_type_hints

import numpy as np
import pytest

import postproc
from postproc.compensation.outcome import Status
from postproc.compensation.output.sidecar import restore_file, sidecar_path
from tests.plant import contents, pages, program
from tests.written import cli

TEN = (
    "load_cell",
    "load_model",
    "read_measurements",
    "fit",
    "predict",
    "diagnose",
    "compensate",
    "explain",
    "diff",
    "check",
)
LAZY = """
import sys
import postproc
heavy = ("postproc.", "numpy", "pandas")
assert not [m for m in sys.modules if m.startswith(heavy)]
assert callable(postproc.compensate)
from postproc.compensation.compensate import compensate
assert postproc.compensate is compensate
assert "pandas" not in sys.modules
"""


@pytest.fixture(scope="module")
def found(job_folder, job_cell):
    """A fit of the job's survey, as it is called from Python."""
    return postproc.fit(
        str(job_folder / "survey.csv"),
        cell=job_folder / "cell.toml",
        effects=("geometry", "backlash"),
    )


def test_nothing_is_loaded_before_it_is_asked_for():
    done = subprocess.run([sys.executable, "-c", LAZY], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_all_public_names_are_there_and_listed():
    assert dir(postproc) == sorted(postproc.__all__)
    assert set(TEN) < set(postproc.__all__)
    for name in postproc.__all__:
        assert getattr(postproc, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        postproc.nothing  # noqa: B018


def test_functions_are_ten_and_name_public_classes_only():
    public = {n: getattr(postproc, n) for n in postproc.__all__ if n != "__version__"}
    functions = {n: f for n, f in public.items() if inspect.isfunction(f)}
    assert set(functions) == set(TEN)
    for name, function in functions.items():
        result = get_type_hints(function)["return"]
        assert public[result.__name__] is result, name


def test_a_fit_scores_other_rows_and_is_saved(found, job_folder, tmp_path):
    path = job_folder / "survey.csv"
    score = found.score(path)
    assert isinstance(score, postproc.ErrorStatistics)
    assert score.n == len(found.survey)
    assert 0 < score.mean_mm < found.report.before.mean_mm / 5
    assert found.score(path.read_bytes(), name="again.csv") == score
    place = tmp_path / "model.json"
    found.save(place)
    text = place.read_bytes()
    assert postproc.load_model(place).id == found.model.id
    assert postproc.load_model(text, name="m").id == found.model.id
    assert "error after fit mean" in str(found)
    table = found.to_frame()
    assert set(table["name"]) == set(found.model.effects.names)


def test_the_command_line_fits_the_same_model(found, job_folder, tmp_path):
    out = tmp_path / "m.json"
    given = (job_folder / "survey.csv", "--cell", job_folder / "cell.toml")
    done = cli("fit", *given, "-o", out, "--effects", "geometry,backlash")
    assert done.exit_code == 0, done.stderr
    found.save(tmp_path / "n.json")
    assert out.read_bytes() == (tmp_path / "n.json").read_bytes()


def test_files_are_read_as_paths_and_as_bytes(job_folder):
    cell_path, data = job_folder / "cell.toml", job_folder / "survey.csv"
    cell = postproc.load_cell(cell_path.read_bytes(), name=str(cell_path))
    assert cell.arm.id == postproc.load_cell(str(cell_path)).arm.id
    rows = postproc.read_measurements(data, cell=cell)
    again = postproc.read_measurements(data.read_bytes(), cell=cell_path)
    assert rows.sha256 == again.sha256
    assert np.array_equal(rows.position, again.position)
    assert postproc.read_measurements(rows, cell=cell) is rows
    with pytest.raises(postproc.PostprocError, match=r"mine\.csv"):
        postproc.read_measurements(b"nothing", cell=cell, name="mine.csv")
    with pytest.raises(postproc.PostprocError, match="give files"):
        postproc.read_measurements(cell=cell)


def test_predictions_are_those_of_the_command_line(job_folder, tmp_path):
    data, cell = job_folder / "survey.csv", job_folder / "cell.toml"
    model, out = job_folder / "model.json", tmp_path / "out.csv"
    found = postproc.predict(data, cell, model)
    done = cli("predict", data, "--cell", cell, "--model", model, "-o", out)
    assert out.read_text() == found.to_csv()
    assert str(found) in done.stderr
    table = found.to_frame()
    assert len(table) == len(found.rows)
    moved = table[["dx_mm", "dy_mm", "dz_mm"]].to_numpy()
    assert np.allclose(moved, found.predicted.error * 1e3)


def test_a_rejected_fit_is_not_saved(found, tmp_path):
    from dataclasses import replace

    rejected = replace(found, report=replace(found.report, rejected="no better"))
    with pytest.raises(postproc.PostprocError, match="no better"):
        rejected.save(tmp_path / "model.json")
    assert not (tmp_path / "model.json").exists()


def test_compensates_bytes(job_folder):
    cell = postproc.load_cell(job_folder / "cell.toml")
    model = postproc.load_model(job_folder / "model.json")
    outcome = postproc.compensate(program("job", 2, 1), cell, model)
    assert isinstance(outcome, postproc.Outcome)
    assert outcome.exit_code == 0
    assert outcome.outputs["program.pdl"].startswith(b"-- postproc ")
    assert outcome.decisions.count(Status.CORRECTED) == 3
    table = outcome.to_frame()
    assert table["status"].tolist().count("corrected") == 3
    assert set(table["line"]) == set(outcome.visits.place.line)
    assert str(outcome).startswith("program.pdl: ")


def test_a_program_with_its_pages_is_written_as_the_command_line_does(
    job_folder, tmp_path
):
    given = {"cell": job_folder / "cell.toml", "model": job_folder / "model.json"}
    folder = tmp_path / "cell"
    main = pages(folder, count=2, targets=3) / "main.pdl"
    before = contents(folder)
    outcome = postproc.compensate(main, **given)
    with pytest.raises(postproc.PostprocError):
        outcome.save(folder)
    assert contents(folder) == before
    written = outcome.save(tmp_path / "new" / "out")
    (tmp_path / "line").mkdir()
    told = [part for key, value in given.items() for part in (f"--{key}", value)]
    cli("compensate", main, *told, "-o", tmp_path / "line" / main.name)
    assert contents(tmp_path / "new" / "out") == contents(tmp_path / "line")
    assert written[-1].name == main.name
    assert sidecar_path(written[-1]) in written
    back = restore_file(written[-1], tmp_path / "back.pdl")
    assert back[0].read_bytes() == main.read_bytes()


def test_explains_compares_and_checks(job_folder, tmp_path):
    cell, model = job_folder / "cell.toml", job_folder / "model.json"
    source = tmp_path / "source"
    source.mkdir()
    path = source / "job.pdl"
    path.write_bytes(program("job", 2, 1))
    told = postproc.explain(str(path), cell, model)
    planned = postproc.explain(path, cell)
    assert told.to_frame()["line"].tolist() == planned.to_frame()["line"].tolist()
    assert "reason" in planned.to_frame()
    outcome = postproc.compensate(path, cell, model)
    assert told.outcome is not None
    assert np.array_equal(
        told.outcome.decisions.correction, outcome.decisions.correction
    )
    new = outcome.save(tmp_path / "out")[-1]
    found = postproc.diff(path, str(new))
    beside = postproc.diff(path.read_bytes(), new.read_bytes(), name="job.pdl")
    assert [r.line for r in found.rows] == [r.line for r in beside.rows]
    assert set(found.to_frame()["status"]) == {"corrected"}
    assert "lines with other numbers" in str(found)
    checked = postproc.check(tmp_path / "out", model=model, source=source)
    assert checked.exit_code == 0, str(checked)
    path.write_bytes(path.read_bytes() + b"\n")
    later = postproc.check(str(tmp_path / "out"), model=model, source=str(source))
    assert later.to_frame()["code"].tolist() == ["source-changed"]
    assert "1 programs, 1 findings" in str(later)


def test_a_path_and_bytes_are_not_mixed(job_folder, tmp_path):
    path = tmp_path / "job.pdl"
    path.write_bytes(program("job", 2, 1))
    given = (job_folder / "cell.toml", job_folder / "model.json")
    with pytest.raises(postproc.PostprocError, match="in one way"):
        postproc.compensate(path, *given, variables=b"")
