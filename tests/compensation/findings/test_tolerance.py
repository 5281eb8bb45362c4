"""Expected true errors against a tolerance: bounds, verdicts, exit codes, texts."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import chi, ncx2

from postproc.compensation.findings.tolerance import (
    JobTolerance,
    Verdict,
    check_tolerance,
)
from postproc.compensation.solver.expected_error import (
    ErrorLaws,
    LengthLaw,
    expect_errors,
    pool_bound,
)
from postproc.exceptions import PostprocError
from postproc.language.visits import Meaning
from postproc.model.model import Prediction
from postproc.model.variance import covariance_of
from tests.made_visits import visits as made_visits
from tests.written import FIRST, NEXT, POSE, cli, program

STD = 0.02e-3


def predicted(error, std=STD, outside=False):
    """What a model says that predicts these errors (n, 3) [m]."""
    error = np.asarray(error, dtype=float)
    covariance = np.zeros((len(error), 6))
    covariance[:, :3] = std**2
    beyond = {"beyond": np.full(len(error), outside)}
    return Prediction(error, np.full_like(error, std), covariance, beyond)


def check(error, correction, tolerance, **given):
    judged = np.ones(len(error), dtype=bool)
    told = predicted(error, **given)
    laws = ErrorLaws.of(told, 1.0, np.asarray(correction, dtype=float), judged)
    found = expect_errors(laws, judged)
    return check_tolerance(found, np.full(len(error), tolerance * 1e-3))


def test_bounds_are_those_of_the_length_of_a_normal_error():
    error = np.array([[1e-3, 0, 0], [0.05e-3, 0, 0], [0.3e-3, 0, 0]])
    found = check(error, [-error[0], [0, 0, 0], [0, 0, 0]], 0.1)
    assert found.errors.high[0] == pytest.approx(STD * chi(3).ppf(0.95), rel=0.01)
    assert found.errors.after[0] == pytest.approx(STD * chi(3).mean(), rel=0.01)
    length = ncx2(3, (error[1:, 0] / STD) ** 2)
    low, high = (STD * np.sqrt(length.ppf(share)) for share in (0.05, 0.95))
    assert found.errors.high[1:] == pytest.approx(high, rel=0.02)
    assert (found.low[1:] <= low).all()  # at least 95 % are beyond
    assert found.low[2] == pytest.approx(low[1], rel=0.02)
    beyond = length.sf((0.1e-3 / STD) ** 2)
    assert found.risk[1:] == pytest.approx(beyond, abs=0.003)
    assert found.outside == pytest.approx(found.risk.sum())


def test_the_law_of_lengths_is_that_of_drawn_errors():
    rng = np.random.default_rng(56)
    mean = rng.normal(size=(40, 3)) * rng.choice([0.0, 0.02, 0.3], size=(40, 1))
    # Errors of one axis are drawn with those of the others, as one joint makes them.
    root = 0.02 * rng.normal(size=(40, 3, 3)) * np.exp(rng.normal(size=(40, 1, 3)))
    normal = rng.normal(size=(40, 50_000, 3))
    drawn = np.linalg.norm(mean[:, None] + normal @ root.swapaxes(1, 2), axis=2)
    law = LengthLaw.of_normal(mean, covariance_of(root))
    assert law.bound == pytest.approx(np.quantile(drawn, 0.95, axis=1), rel=0.03)
    assert ((drawn < law.least[:, None]).mean(axis=1) < 0.053).all()
    at = np.quantile(drawn, 0.9, axis=1)
    assert law.beyond(at) == pytest.approx(np.full(40, 0.1), abs=0.01)
    assert law.mean == pytest.approx(drawn.mean(axis=1), rel=0.02)
    whole = pool_bound(law, law.bound.max())
    assert whole == pytest.approx(pool_bound(law, 3.0 * law.mean.max()), rel=1e-6)
    assert whole == pytest.approx(np.quantile(drawn, 0.95), rel=0.02)


def test_an_error_that_does_not_scatter_has_its_own_length():
    law = LengthLaw.of_normal(np.array([[3e-3, 0, 4e-3]]), np.zeros((1, 6)))
    assert law.bound == pytest.approx([5e-3], rel=2e-3)
    assert law.least == pytest.approx([5e-3], rel=2e-3)
    assert law.beyond(4.9e-3) == pytest.approx([1.0])


def test_the_last_pattern_that_fits_a_name_counts():
    visits = made_visits(
        [Meaning.POSE] * 3, [[0.0] * 6] * 3, files=("a.pdl", "b.pdl"),
        file=np.array([0, 0, 1]), names=("", "P_drill1", "q"), name=np.arange(3),
    )  # fmt: skip
    job = JobTolerance(0.3, {"b.*": 0.5, "p_*": 0.1})
    assert job.of_visits(visits) == pytest.approx([0.3e-3, 0.1e-3, 0.5e-3])
    with pytest.raises(PostprocError, match="above 0"):
        JobTolerance(0.3, {"p": -1.0})


def test_verdicts():
    error = np.array([[1e-3, 0, 0]] * 3)
    correction = [-error[0], [0, 0, 0], [-0.9e-3, 0, 0]]
    found = check(error, correction, 0.1)
    assert found.verdict.tolist() == [Verdict.PASS, Verdict.FAIL, Verdict.UNKNOWN]
    assert not found.passes and found.errors.before == pytest.approx(
        [1e-3] * 3, rel=0.01
    )
    assert check(error[:1], correction[:1], 0.1).passes


def test_nothing_passes_outside_of_the_survey_or_without_a_prediction():
    error = np.array([[1e-3, 0, 0]])
    assert check(error, -error, 0.1, outside=True).verdict[0] == Verdict.UNKNOWN
    assert check(error, -error, 0.1, std=np.nan).verdict[0] == Verdict.UNKNOWN
    assert check(error, 0 * error, 0.1, outside=True).verdict[0] == Verdict.FAIL


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
