"""Expected true errors against a tolerance: bounds, verdicts, exit codes, texts."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi, ncx2

from postproc.compensation.tolerance import Verdict, check_tolerance
from tests.written import FIRST, NEXT, POSE, cli, program

STD = 0.02e-3


def arrivals(error, std=STD, outside=0.0):
    """Arrivals whose model predicts these errors (n, 3) [m]."""
    error = np.asarray(error, dtype=float)
    columns = (error, np.full_like(error, std), np.full_like(error, outside))
    found = np.stack(columns, axis=1)
    return SimpleNamespace(visits=[None] * len(error), predict=lambda rows: found)


def check(error, correction, tolerance, **given):
    judged = np.ones(len(error), dtype=bool)
    made = arrivals(error, **given)
    return check_tolerance(made, np.asarray(correction, dtype=float), judged, tolerance)


def test_bounds_are_those_of_the_length_of_a_normal_error():
    error = np.array([[1e-3, 0, 0], [0.05e-3, 0, 0]])
    found = check(error, [-error[0], [0, 0, 0]], 0.1)
    assert found.high[0] == pytest.approx(STD * chi(3).ppf(0.95), rel=0.01)
    assert found.expected[0] == pytest.approx(STD * chi(3).mean(), rel=0.01)
    length = ncx2(3, (error[1, 0] / STD) ** 2)
    for bound, share in ((found.low[1], 0.05), (found.high[1], 0.95)):
        assert bound == pytest.approx(STD * np.sqrt(length.ppf(share)), rel=0.02)
    beyond = length.sf((0.1e-3 / STD) ** 2)
    assert found.risk[1] == pytest.approx(beyond, abs=0.003)
    assert found.outside == pytest.approx(found.risk.sum())


def test_verdicts():
    error = np.array([[1e-3, 0, 0]] * 3)
    correction = [-error[0], [0, 0, 0], [-0.9e-3, 0, 0]]
    found = check(error, correction, 0.1)
    assert found.verdict.tolist() == [Verdict.PASS, Verdict.FAIL, Verdict.UNKNOWN]
    assert not found.passes and found.before == pytest.approx([1e-3] * 3, rel=0.01)
    assert check(error[:1], correction[:1], 0.1).passes


def test_nothing_passes_outside_of_the_survey_or_without_a_prediction():
    error = np.array([[1e-3, 0, 0]])
    assert check(error, -error, 0.1, outside=1.0).verdict[0] == Verdict.UNKNOWN
    assert check(error, -error, 0.1, std=np.nan).verdict[0] == Verdict.UNKNOWN
    assert check(error, 0 * error, 0.1, outside=1.0).verdict[0] == Verdict.FAIL


@pytest.fixture
def job(desk):
    place = desk.folder / "job.pdl"
    place.write_bytes(program(FIRST, POSE, NEXT))
    return place, (
        "--cell",
        desk.cell,
        "--model",
        desk.model,
        "-o",
        desk.folder / "o.pdl",
    )


@pytest.mark.parametrize(("tolerance", "code"), [("5", 0), ("0.0001", 1)])
def test_the_exit_code_is_that_of_the_verdict(job, tolerance, code):
    place, given = job
    assert cli("compensate", place, *given).exit_code == 0
    report = place.parent / "r.json"
    done = cli(
        "compensate", place, *given, "--tolerance", tolerance, "--report", report
    )
    assert done.exit_code == code, done.stderr
    said = json.loads(report.read_bytes())["tolerance"]
    assert said["passes"] == (code == 0)
    assert len(said["verdict"]) == len(said["bound_95_mm"])
    assert f"tolerance {tolerance} mm" in done.stderr
    assert "expected true error mean" in done.stderr


def test_a_tolerance_is_a_length(job):
    place, given = job
    done = cli("compensate", place, *given, "--tolerance", "0")
    assert done.exit_code == 2 and "above 0" in done.stderr
    assert not (place.parent / "o.pdl").exists()
