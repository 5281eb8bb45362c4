"""A model revised by few rows: what they tell of, and what they leave as it was."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from postproc.calibration.diagnosis.diagnose import Extension, extend_model
from postproc.calibration.diagnosis.model_update import (
    UNSEEN,
    Revision,
    fold_back,
    no_surer,
    only_arm,
    revise,
)
from postproc.calibration.effect_selection import model_of
from postproc.calibration.measurements import Measurements
from postproc.model.effects import BY_NAME
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.report.diagnosis import tell
from postproc.robot.pose import MM, lengths
from postproc.simulation import (
    VirtualArm,
    VirtualArrivals,
    sample_survey,
    stream,
    virtual_arm,
)
from postproc.simulation.reference import WORKING_RANGE
from tests.calibration.planted import (
    ARM,
    BASE,
    TRACKER,
    base_model,
    measurements,
    states_of,
    survey,
)

SEED = 29


Known = tuple[Measurements, Model, ArmStates, Revision]


@pytest.fixture(scope="module")
def known() -> Known:
    """Twelve rows of an arm, and what a survey of 150 tells of it and may revise."""
    arm = virtual_arm(SEED, BASE)
    old = survey(arm, SEED, 150)
    rows = measurements(
        states_of(old), arm.measure(old, TRACKER, stream(SEED, "old")), "old"
    )
    few, model = rows[np.arange(12)], only_arm(base_model(rows))
    batch = ArmStates(ARM, few.states)
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
    fit = revise(few, model, batch, tuple(TRACKER))[0]
    revised = fold_back(model_of(fit, few))
    left = np.diag(revised.covariance)[:count]
    assert (left >= np.diag(revision.unseen) * (1 - 1e-9)).all()


def test_columns_are_those_of_the_rows_that_are_asked_for(known: Known) -> None:
    few, _, batch, revision = known
    forth = revision.columns(batch)
    back = revision.columns(batch.arriving(-few.states.direction))
    alone = ArmStates(ARM, few.states.with_(direction=-few.states.direction))
    np.testing.assert_allclose(back, revision.columns(alone), atol=1e-15)
    assert np.abs(forth - back).max() > 1e-7
    np.testing.assert_array_equal(revision.columns(batch), forth)


ROWS, NEAR = 120, np.deg2rad(20.0)
MOVED = np.array([3e-4, -2e-4, 1e-4])  # [m]


@dataclass(frozen=True)
class Later:
    """An arm whose model is revised by rows of one corner of its range.

    Attributes:
        arm: The arm, as it was surveyed.
        model: Of its survey.
        corner: Joint ranges of the fresh rows, (6, 2) [rad].
        arrivals: Of the fresh rows.
        position: What a tracker reads there, (n, 3) [m].
    """

    arm: VirtualArm
    model: Model
    corner: np.ndarray
    arrivals: VirtualArrivals
    position: np.ndarray

    def diagnosed(
        self, shift: np.ndarray, frame: np.ndarray | None = None
    ) -> Extension:
        """Diagnose the rows, shifted in axes that are given, (n, 3, 3)."""
        axes = np.eye(3)[None] if frame is None else frame
        rows = measurements(
            states_of(self.arrivals), self.position + axes @ shift, "fresh"
        )
        return extend_model(rows, ARM, self.model, tracker=TRACKER)

    def left(self, model: Model, within: np.ndarray) -> tuple[float, float]:
        """Return the true mean error [mm], and how many intervals hold it."""
        there = sample_survey(self.arm, 200, seed=self.arm.seed + 2, within=within)
        said = model.predict(ARM, states_of(there))
        off = np.abs(said.error - self.arm.error(there))
        return float(lengths(off).mean() / MM), float(
            (off < 1.96 * said.std_model).mean()
        )


def revisited(seed: int) -> Later:
    """Survey an arm, and a corner of its range later."""
    arm = virtual_arm(seed, BASE)
    old = survey(arm, seed, 300)
    rows = measurements(
        states_of(old), arm.measure(old, TRACKER, stream(seed, "old")), "old"
    )
    middle = np.deg2rad([20.0, 10.0, -100.0, 30.0, 40.0, -20.0])
    corner = np.stack([middle - NEAR, middle + NEAR], axis=1)
    new = sample_survey(arm, ROWS, seed=seed + 1, within=corner)
    read = arm.measure(new, TRACKER, stream(seed, "new"))
    return Later(arm, base_model(rows), corner, new, read)


@pytest.fixture(scope="module")
def later() -> Later:
    return revisited(SEED)


@pytest.mark.slow
def test_rows_of_one_corner_sharpen_a_model_there_and_spoil_nothing() -> None:
    corner, range_, held = [], [], []
    for seed in range(SEED, SEED + 6):
        later = revisited(seed)
        found = later.diagnosed(np.zeros(3))
        assert found.diagnosis.verdict == "noise" and found.diagnosis.set_anew is None
        for within, errors in ((later.corner, corner), (WORKING_RANGE, range_)):
            (before, _), (after, inside) = (
                later.left(m, within) for m in (later.model, found.model)
            )
            errors.append((before, after))
            held.append(inside)
        everywhere = states_of(sample_survey(later.arm, 50, seed=seed + 3))
        assert not found.model.predict(ARM, everywhere).any_outside.any()
    before, after = np.mean(corner, axis=0)
    assert after < 0.75 * before
    before, after = np.mean(range_, axis=0)
    assert after < 1.05 * before
    assert np.mean(held) > 0.93 and min(held) > 0.85


@pytest.mark.slow
def test_a_base_that_moved_is_told_and_compensated(later: Later) -> None:
    found = later.diagnosed(MOVED)
    assert found.diagnosis.verdict == "noise"
    anew = found.diagnosis.set_anew
    assert anew is not None and not anew.bent
    assert "survey of the given model the base has moved" in tell(found.diagnosis)
    assert set(found.diagnosis.to_dict()["frame_shift"]) == {
        "base_mm", "turn_mrad", "tool_mm",
    }  # fmt: skip
    there = sample_survey(later.arm, 200, seed=SEED + 2, within=later.corner)
    truth = later.arm.error(there) + MOVED
    off = found.model.error(ARM, states_of(there)) - truth
    assert lengths(off).mean() < 0.02 * MM


def test_a_bent_tool_is_told_and_its_survey_stands_for_it_alone(later: Later) -> None:
    frame = ArmStates(ARM, states_of(later.arrivals)).walk.flange[:, :3, :3]
    found = later.diagnosed(MOVED, frame)
    anew = found.diagnosis.set_anew
    assert found.diagnosis.verdict == "noise" and anew is not None and anew.bent
    assert anew.tool == pytest.approx(MOVED, abs=3e-5)
    fresh = {tuple(np.round(t, 9)) for t in states_of(later.arrivals).tool}
    assert set(found.model.ranges.tools) == fresh


def test_rows_that_agree_by_chance_make_a_model_no_surer(known: Known) -> None:
    few, model, batch, _ = known
    fit = revise(few, model, batch, tuple(TRACKER))[0]
    lucky = replace(fit, log_scale=np.where(np.ones(len(fit.groups)), -2.0, 0.0))
    own = no_surer(lucky)
    assert own.log_scale[own.groups.index("revision.model")] == 0.0
    gram = own.normal().gram
    expected = np.linalg.inv(np.eye(len(gram)) + gram)
    np.testing.assert_allclose(own.covariance, expected, atol=1e-9)
    surer = replace(fit, log_scale=np.full(len(fit.groups), 0.5))
    assert no_surer(surer) is surer


def test_a_zero_is_open_again_beside_a_law_that_the_model_lacked(known: Known) -> None:
    _, model, _, revision = known
    two, three = (BY_NAME["compliance"]((j,), ((),)) for j in (2, 3))
    beside = revision.beside((two, three))
    assert beside.groups[-2:] == ("zero2", "zero3")
    assert [p.name for p in beside.parameters()[-2:]] == ["zero2", "zero3"]
    place = model.effects.names.index("geometry.theta3")
    assert np.flatnonzero(beside.factor[:, -1]).tolist() == [place]
    # An offset is the change of the zero itself, and directions have no mean.
    offset, gap = BY_NAME["joint_offset"]((2,)), BY_NAME["backlash"]()
    assert beside.beside((two, offset, gap)).groups == revision.groups
    assert revision.free_zeros((2,)).free_zeros((2,)).groups == (
        *revision.groups,
        "zero2",
    )
    np.testing.assert_array_equal(beside.beside(()).factor, revision.factor)
