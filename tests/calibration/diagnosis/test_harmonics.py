"""Waves inside a map of a joint are named, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.diagnosis import harmonics, score
from postproc.calibration.diagnosis.candidates import Library, Projection
from postproc.calibration.diagnosis.harmonics import (
    GATHERED,
    Along,
    MatchingPursuit,
    fine_parameters,
    name_waves,
)
from postproc.calibration.diagnosis.score import Null
from postproc.calibration.diagnosis.search import Search
from postproc.calibration.diagnosis.table import Causes
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.transmission import Transmission
from postproc.model.kinematics import ArmStates
from postproc.simulation import Planted, VirtualArm, stream
from postproc.simulation.laws import Law, Where, on_joint
from tests.calibration.planted import ARM, TRACKER, planted_arm, states_of, survey

JOINT = 4
ORDERS = (9.5, 23.0)
MRAD = 0.15
SIGNALS = np.exp(np.linspace(0.0, 10.0, 6))
NOTHING = Causes(Library(()))
NULL = Null(np.sort(5.0 + np.random.default_rng(0).exponential(1.0, 300)))


def wave(order: float) -> Law:
    """A wave of a gear, of any order."""

    def shape(arrivals):  # type: ignore[no-untyped-def]
        return on_joint(JOINT, np.cos(order * arrivals.q[:, JOINT - 1] + order))

    return Law("transmission", Where.JOINTS, (JOINT,), 0, {}, shape, MRAD * 1e-3)


def mapped(seed: int, orders: tuple[float, ...], rows: int) -> Fit:
    """Fit an arm with a worn spot and waves in one joint by a map of every joint."""
    arm: VirtualArm = planted_arm(seed, Planted("worn_spot", JOINT, 0.1), rows=rows)
    arm = replace(arm, laws=(*arm.laws, *map(wave, orders)))
    arrivals = survey(arm, seed, rows)
    position = arm.measure(arrivals, TRACKER, stream(seed, "tracker"))
    states = states_of(arrivals)
    effects = propose((*BASE_EFFECTS, "joint_spline"), ARM, states)
    return fit_effects(ArmStates(ARM, states), position, effects, tuple(TRACKER))


def searched(fit: Fit) -> Search:
    """Name the waves in the maps of a fit."""
    return name_waves(Search(fit, fit, NOTHING, NOTHING, (), NULL, None))


def test_waves_beside_a_worn_spot_are_named_with_order_and_size() -> None:
    found = searched(mapped(71, ORDERS, 700))
    effects = [a.candidate.effect for a in found.additions]
    assert len(effects) == len(ORDERS)
    for k, effect in enumerate(effects):
        part = found.fit.combination.slices[found.place(k)]
        size, error = effect.amplitude(  # type: ignore[misc]
            found.fit.values[part], found.fit.covariance[part, part]
        )
        assert abs(size - MRAD * 1e-3) < 4 * error
    told = sorted(e.nonlinear()["order"][0] for e in effects)
    assert np.abs(np.array(told) - ORDERS).max() < 0.2
    assert all(a.candidate.family.joint == JOINT for a in found.additions)
    assert any(e.name == "joint_spline" for e in found.fit.combination.effects)


def test_a_worn_spot_is_no_wave() -> None:
    found = searched(mapped(72, (), 700))
    assert not found.additions
    assert found.fit is found.base


def test_without_a_map_there_is_nothing_to_look_into() -> None:
    fit = mapped(73, (), 60)
    effects = tuple(e for e in fit.combination.effects if e.name != "joint_spline")
    position = fit.error + fit.batch.walk.tcp
    plain = fit_effects(fit.batch, position, effects, tuple(TRACKER))
    assert not searched(plain).additions


@pytest.mark.parametrize("before", [(), (9.5,)])
def test_gain_is_the_ratio_of_marginal_likelihoods(
    before: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its definition: densely, with every scale on the grid."""
    for module in (score, harmonics):
        monkeypatch.setattr(module, "SIGNALS", SIGNALS)
    fit = mapped(74, ORDERS, 60)
    known = fine_parameters(fit, JOINT)
    projection, order = Projection.leaving(fit, known), 23.0
    pursuit = MatchingPursuit.of(Projection.of(fit), JOINT, known, np.arange(3.0, 30.0))
    flat = np.zeros((len(projection.rest), 0))
    if before:
        pursuit = pursuit.without(before[0], pursuit.filter_wave(before[0]))
        flat = filtered(fit, projection, before[0])
    at = fit.combination.at(fit.batch, fit.values)
    columns = fit.combination.columns(at)[:, :, known] * fit.prior_std[known]
    M = projection.filter(fit.whiten(columns))
    W = filtered(fit, projection, order)
    z = projection.rest
    if before:
        basis, _ = np.linalg.qr(flat)
        M, W, z = (x - basis @ (basis.T @ x) for x in (M, W, z))
    n = projection.rows
    scales = [s / np.linalg.eigvalsh(M.T @ M).max() for s in (0.0, *SIGNALS)]
    alone = [log_likelihood([(M, s)], z, n) for s in scales]
    both = []
    for s in scales[: int(np.argmax(alone)) + 1]:
        inside = np.eye(len(z)) + s * M @ M.T
        seen = np.linalg.eigvalsh(W.T @ np.linalg.solve(inside, W)).max()
        tried = (0.0, *(t / seen for t in SIGNALS))
        both.append(max(log_likelihood([(M, s), (W, t)], z, n) for t in tried))
    expected = max(both) - max(alone)
    assert pursuit.gains(np.array([order]))[0] == pytest.approx(expected, abs=1e-3)


def filtered(fit: Fit, projection: Projection, order: float) -> np.ndarray:
    """Columns of a wave as the filter leaves them, (3 n, 2)."""
    columns = Transmission(((JOINT, order),)).columns(projection.at)
    return projection.filter(fit.whiten(columns))


def log_likelihood(
    parts: list[tuple[np.ndarray, float]], z: np.ndarray, n: int
) -> float:
    """Marginal likelihood but for a constant, the level of the noise integrated out."""
    inside = np.eye(len(z)) + sum(s * x @ x.T for x, s in parts)
    _, size = np.linalg.slogdet(inside)
    return -0.5 * n * float(np.log(z @ np.linalg.solve(inside, z))) - 0.5 * size


def test_rows_gathered_at_few_angles_have_the_same_sums() -> None:
    rng = np.random.default_rng(0)
    n, orders = 4000, np.array([3.0, 29.5, 60.0])
    along = Along(
        rng.uniform(-1.0, 1.0, n), rng.uniform(0.5, 1.5, n),
        rng.normal(size=(n, 5)), rng.normal(size=(n, 2)), rng.normal(size=n),
    )  # fmt: skip
    few = along.gather_rows(GATHERED / orders[-1])
    assert len(few.angle) < n / 10
    here, there = along.sums(orders), few.sums(orders)
    for name in ("curves", "own", "rest"):
        exact, found = getattr(here, name), getattr(there, name)
        assert np.abs(found - exact).max() < 0.02 * np.abs(exact).max()
