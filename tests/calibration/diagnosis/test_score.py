"""Evidence, projection, folds and the null distribution, by their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from postproc.calibration.diagnosis.candidates import (
    Library,
    Projection,
    ReducedCandidates,
)
from postproc.calibration.diagnosis.held_out import Folds, deal
from postproc.calibration.diagnosis.score import (
    SIGNALS,
    Null,
    Score,
    explain_squares,
    leftovers,
    log_evidence,
    rank,
    score_p_value,
)
from postproc.calibration.diagnosis.table import Causes
from postproc.model.effects.effect import NAMED, Candidate, Family
from postproc.model.effects.scale import Scale
from tests.calibration.planted import campaign, plain_design


def candidate(joint: int = 1) -> Candidate:
    family = Family("scale", joint, None, NAMED)
    return Candidate(family, Scale((joint,)), f"joint {joint}", 0.0)


def blocks_of(B: np.ndarray, z: np.ndarray) -> ReducedCandidates:
    gain, turn = np.linalg.eigh(B.T @ B)
    return ReducedCandidates(
        (candidate(),), gain[None], (turn.T @ B.T @ z)[None, :, None]
    )


@pytest.mark.parametrize("strength", [0.0, 0.3, 2.0])
def test_evidence_is_a_ratio_of_marginal_likelihoods(strength: float) -> None:
    rng = np.random.default_rng(1)
    n, k = 60, 3
    B = rng.standard_normal((n, k))
    z = rng.standard_normal(n) + strength * B @ rng.standard_normal(k)
    largest = float(np.linalg.eigvalsh(B.T @ B).max())

    def marginal(s2: float) -> float:
        """Student t of n degrees, up to a constant: the level integrated out."""
        V = np.eye(n) + s2 * B @ B.T
        quadratic = z @ np.linalg.solve(V, z)
        return -0.5 * np.linalg.slogdet(V)[1] - 0.5 * n * np.log(quadratic)

    wanted = max(marginal(s / largest) for s in SIGNALS) - marginal(0.0)
    found = log_evidence(blocks_of(B, z), np.array([z @ z]), n)[0, 0]
    assert found == pytest.approx(max(wanted, 0.0), abs=1e-9)


def test_score_test_is_the_f_test_of_a_linear_model() -> None:
    rng = np.random.default_rng(2)
    n, k = 80, 4
    B, z = rng.standard_normal((n, k)), rng.standard_normal(n)
    fitted = B @ np.linalg.lstsq(B, z)[0]
    squares, rank_of = explain_squares(blocks_of(B, z))
    assert squares[0, 0] == pytest.approx(fitted @ fitted)
    assert rank_of[0] == k
    draws = rng.standard_normal((n, 400))
    p = [score_p_value(blocks_of(B, d), float(d @ d), n)[0] for d in draws.T]
    assert abs(np.mean(np.array(p) < 0.1) - 0.1) < 0.05


def test_wider_blocks_pay_for_their_columns() -> None:
    rng = np.random.default_rng(3)
    n = 300
    wave = rng.standard_normal((n, 1))
    z = rng.standard_normal(n) + 0.5 * wave[:, 0]
    narrow = blocks_of(wave, z)
    wide = blocks_of(np.hstack([wave, rng.standard_normal((n, 9))]), z)
    square = np.array([z @ z])
    assert log_evidence(narrow, square, n) > log_evidence(wide, square, n)


@pytest.fixture(scope="module")
def base() -> Projection:
    return Projection.of(campaign(40, (), 0.0, rows=150).base_fit())


def test_filter_turns_draws_from_the_model_into_plain_noise(base: Projection) -> None:
    fit = base.fit
    X = fit.whiten(fit.design.dense()) * fit.prior_std
    cov = np.eye(len(X)) + X @ X.T
    white = base.filter(base.filter(cov).T)
    assert np.abs(white - np.eye(len(X))).max() < 1e-6


def test_filter_leaves_nothing_of_what_the_model_knows(base: Projection) -> None:
    fit = base.fit
    X = fit.whiten(fit.design.dense()) * fit.prior_std
    size = np.linalg.norm(X, axis=0)
    left = np.linalg.norm(base.filter(X), axis=0)
    assert (left[size > 100] < 2.0).all()
    assert (base.rest**2).mean() == pytest.approx(1.0, abs=0.15)


def test_evidence_with_the_base_projected_out_is_that_of_the_joint_model(
    base: Projection,
) -> None:
    fit = base.fit
    X = fit.whiten(fit.design.dense()) * fit.prior_std
    one = candidate(4)
    b = fit.whiten(one.effect.columns(base.at))[:, 0]
    target = fit.whiten(fit.residual + fit.design.times(fit.values))
    blocks = blocks_of(base.filter(b[:, None]), base.rest)
    s2 = float(SIGNALS[12] / blocks.gain[0, 0])
    zero = np.zeros(len(b))
    without = multivariate_normal(zero, np.eye(len(b)) + X @ X.T)
    joint = np.eye(len(b)) + X @ X.T + s2 * np.outer(b, b)
    wanted = multivariate_normal(zero, joint).logpdf(target) - without.logpdf(target)
    gain, along = blocks.gain[0, 0], blocks.along[0, 0, 0]
    shrunk = 1 + s2 * gain
    found = 0.5 * s2 * along**2 / shrunk - 0.5 * np.log(shrunk)
    assert found == pytest.approx(wanted, abs=1e-5)


def test_library_gives_the_same_blocks_for_kept_and_for_new_columns(
    base: Projection, monkeypatch: pytest.MonkeyPatch
) -> None:
    def scores(library: Library) -> list[Score]:
        reduced = library.reduce(base, base.rest[:, None])
        return rank(reduced, float(base.rest @ base.rest), base.rows)

    kept = scores(Library.of(base.fit))
    monkeypatch.setattr("postproc.calibration.diagnosis.candidates.KEPT", 0)
    library = Library.of(base.fit)
    assert all(shelf.columns is None for shelf in library.shelves)
    again = scores(library)
    assert [s.family for s in kept] == [s.family for s in again]
    assert kept[0].evidence == pytest.approx(again[0].evidence)


def test_null_tells_how_often_noise_gets_so_far(base: Projection) -> None:
    library = Library.of(base.fit)
    null = Causes(library).null(base, seed=0)
    fresh = Causes(library).null(base, seed=1).maxima
    for level in (0.2, 0.1, 0.05):
        assert np.mean(fresh > null.threshold(level)) == pytest.approx(level, abs=0.05)
    p = [null.p_value(e) for e in np.linspace(0, 40, 81)]
    assert (np.diff(p) <= 1e-12).all()
    assert null.p_value(null.threshold(0.001)) == pytest.approx(0.001)
    assert Null(null.maxima).p_value(1e6) > 0


def test_runs_are_dealt_evenly_and_stay_together() -> None:
    rng = np.random.default_rng(5)
    values = rng.permutation(400).astype(float)
    fold = deal(values, folds=10, seed=0, run=4)
    counts = np.bincount(fold, minlength=10)
    assert counts.min() == counts.max() == 40
    in_order = fold[np.argsort(values)].reshape(-1, 4)
    assert (in_order == in_order[:, :1]).all()


def test_held_out_errors_come_from_the_other_rows() -> None:
    rng = np.random.default_rng(6)
    X, y = rng.standard_normal((60, 5)), rng.standard_normal(60)
    fold = np.arange(20) % 4
    every, less = Folds.of(plain_design(X), np.ones(5), y, fold).errors(slice(1, 3))
    errors = every.reshape(-1)
    out = np.repeat(fold == 2, 3)
    A, b = X[~out], y[~out]
    p = np.linalg.solve(A.T @ A + np.eye(5), A.T @ b)
    assert errors[out] == pytest.approx(y[out] - X[out] @ p)
    A, B = np.delete(A, [1, 2], axis=1), np.delete(X, [1, 2], axis=1)
    p = np.linalg.solve(A.T @ A + np.eye(3), A.T @ b)
    assert less.reshape(-1)[out] == pytest.approx(y[out] - B[out] @ p)


def test_every_part_is_asked_about_every_covariate(base: Projection) -> None:
    causes = Causes.of(base.fit)
    candidates = [c for s in causes.library.shelves for c in s.candidates]
    assert causes.table is not None
    drivers = set(causes.table.laws[""].drivers)
    joints = {f"joint {j}" for j in range(1, 7)}
    passing = {"speed", "payload", "temperature", "time"}
    for j in range(1, 7):
        own = {f"lambda {j}", f"way {j}", "torque 2", "torque 3", "moment 5x"}
        assert joints | passing | own <= drivers, j
        before = {c.source for c in candidates if c.family.joint == j}
        assert {f"before {j}", f"travel {j} x loop {j}"} <= before
        signed = causes.table.laws[f"lambda {j}"].drivers
        assert {f"lambda {j} x joint {k}" for k in range(1, 7)} <= set(signed)
    assert causes.table.only is None  # but all carriers are tried
    steps = [c for c in candidates if c.family.effect in ("tool_shift", "base_shift")]
    assert {c.source for c in steps} == {"order"}
    rows = sorted({c.effect.settings()["row"] for c in steps})
    assert len(rows) >= 40
    assert max(np.diff(rows)) <= len(base.fit.batch) / 40


def test_what_the_model_takes_is_not_left_over() -> None:
    projection = Projection.of(campaign(24, (), 0.0, rows=200).base_fit())
    taken = projection.taken / np.linalg.norm(projection.taken, axis=0)
    rest = np.random.default_rng(0).standard_normal(len(projection.rest))
    rest += 9.0 * taken @ (taken.T @ rest)  # priors of the model are off by ten
    assert leftovers(replace(projection, rest=rest), seed=0)[0].p_value > 0.05


@pytest.mark.parametrize("width", [1, 2])
def test_every_block_may_be_weighed_against_rows_of_its_own(width: int) -> None:
    rng = np.random.default_rng(width)
    gain = rng.uniform(1.0, 9.0, (7, width))
    along, square = rng.standard_normal((7, width, 1)), rng.uniform(40.0, 90.0, (7, 1))
    together = log_evidence(ReducedCandidates((), gain, along), square, 60)
    for k in range(7):
        one = ReducedCandidates((), gain[k : k + 1], along[k : k + 1])
        alone = log_evidence(one, square[k], 60)
        np.testing.assert_allclose(together[k], alone[0], rtol=1e-12)
