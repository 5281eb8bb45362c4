"""A model revised by few rows: what they tell of, and what they leave as it was."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.diagnosis.refit import (
    UNSEEN,
    Revision,
    fold_back,
    only_arm,
    revise,
)
from postproc.calibration.measurements import Measurements
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.simulation import stream, virtual_arm
from tests.calibration.diagnosis.test_diagnose import base_model, measurements
from tests.calibration.planted import ARM, BASE, TRACKER, states_of, survey

SEED = 29


Known = tuple[Measurements, Model, Batch, Revision]


@pytest.fixture(scope="module")
def known() -> Known:
    """Twelve rows of an arm, and what a survey of 150 tells of it and may revise."""
    arm = virtual_arm(SEED, BASE)
    old = survey(arm, SEED, 150)
    rows = measurements(
        states_of(old), arm.measure(old, TRACKER, stream(SEED, "old")), "old"
    )
    few, model = rows[np.arange(12)], only_arm(base_model(rows))
    batch = Batch(ARM, few.states)
    return few, model, batch, Revision.of(model, batch)


def test_directions_that_move_no_row_keep_their_uncertainty(known: Known) -> None:
    few, model, batch, revision = known
    count = len(model.values)
    assert 0 < revision.factor.shape[1] < count
    np.testing.assert_allclose(
        revision.factor @ revision.factor.T + revision.unseen,
        model.covariance,
        atol=1e-5 * np.abs(model.covariance).max(),
    )
    columns = model.effects.columns(model.effects.at(batch, model.values))
    moved = np.einsum("nip,pq,niq->ni", columns, revision.unseen, columns)
    assert moved.max() < 3 * len(batch) * count * UNSEEN**2
    fit = fold_back(revise(few, model, batch, tuple(TRACKER)))
    left = np.diag(fit.covariance)[:count]
    assert (left >= np.diag(revision.unseen) * (1 - 1e-9)).all()


def test_columns_are_those_of_the_rows_that_are_asked_for(known: Known) -> None:
    few, _, batch, revision = known
    forth = revision.columns(batch)
    back = revision.columns(batch.arriving(-few.states.direction))
    alone = Batch(ARM, few.states.with_(direction=-few.states.direction))
    np.testing.assert_allclose(back, revision.columns(alone), atol=1e-15)
    assert np.abs(forth - back).max() > 1e-7
    np.testing.assert_array_equal(revision.columns(batch), forth)
