"""What may be there besides a model's effects: in its variance, and in its file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.diagnosis.diagnose import _keep_open
from postproc.calibration.diagnosis.model_update import only_arm
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.exceptions import ModelError
from postproc.model.doubt import Doubt
from postproc.model.effect_sum import Combination
from postproc.model.effects.compliance import Compliance
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, load_model
from postproc.model.model_file import content_id
from postproc.robot.state import States
from tests.calibration.simulator import NJ, random_arm, random_states, survey_of


@pytest.fixture(scope="module")
def doubted() -> tuple[Model, States]:
    rng = np.random.default_rng(5)
    states = random_states(60, rng)
    survey = survey_of(states, random_arm(rng).measure(states, rng)[0])
    names = ("geometry", "backlash", "base_shift")
    model = model_of(fit_survey(survey, NJ, names, None), survey)
    batch = ArmStates(NJ, states)
    effects = Combination((Compliance.on(batch), *Compliance.along_axes(batch)))
    size = len(model.values) + len(effects.parameters)
    scales = np.append(model.prior_std, effects.scales)
    factor = 0.3 * rng.standard_normal((size, 4)) * scales[:, None]
    return replace(model, doubt=Doubt(effects, factor @ factor.T)), states


def test_the_file_keeps_it(doubted: tuple[Model, States], tmp_path: Path) -> None:
    model, states = doubted
    model.save(tmp_path / "model.json")
    read = load_model(tmp_path / "model.json")
    assert read.id == model.id
    np.testing.assert_allclose(
        read.std_error(NJ, states), model.std_error(NJ, states), rtol=1e-12
    )


def test_a_file_without_it_reads_as_before(doubted: tuple[Model, States]) -> None:
    plain = replace(doubted[0], doubt=None)
    assert "doubt" not in plain.to_dict()
    assert "along" not in str(plain.to_dict())


def test_the_variance_has_it_by_every_way(doubted: tuple[Model, States]) -> None:
    model, states = doubted
    assert model.doubt is not None
    for effects, values, doubt in (
        (model.effects, model.values, model.doubt),
        (
            *model.compensable()[:2],
            model.doubt.get_settings(model.effects.where("arm")),
        ),
    ):
        at = effects.at(ArmStates(NJ, states), values)
        both = Combination((*effects.effects, *doubt.effects.effects)).columns(at)
        added = np.einsum("nip,pq,niq->ni", both, doubt.covariance, both)
        without = replace(model, doubt=None)
        np.testing.assert_allclose(
            model.unmodelled_covariance(effects, at, values)[:, :3],
            without.unmodelled_covariance(effects, at, values)[:, :3] + added,
            rtol=1e-9,
        )


def test_the_arm_alone_is_as_unsure(doubted: tuple[Model, States]) -> None:
    model, states = doubted
    np.testing.assert_allclose(
        only_arm(model).std_error(NJ, states), model.std_error(NJ, states), rtol=1e-12
    )


def test_an_extended_model_keeps_it_unless_it_was_found(
    doubted: tuple[Model, States],
) -> None:
    model, states = doubted
    assert model.doubt is not None
    kept, own = _keep_open(model, only_arm(model)), model.effects.where("arm")
    assert kept is not None
    np.testing.assert_array_equal(
        kept.covariance, model.doubt.get_settings(own).covariance
    )
    yields = Combination((*model.effects.effects, Compliance.on(ArmStates(NJ, states))))
    assert _keep_open(model, replace(model, effects=yields)) is None


def test_it_goes_by_the_names_of_parameters(doubted: tuple[Model, States]) -> None:
    doubt, names = doubted[0].doubt, doubted[0].effects.names
    assert doubt is not None
    q = len(doubt.effects.parameters)
    moved = doubt.among(names, ("new.a", names[3], names[0]))
    at = np.array([3, 0, *range(len(names), len(names) + q)])
    assert not moved.covariance[0].any()
    np.testing.assert_array_equal(
        moved.covariance[1:, 1:], doubt.covariance[np.ix_(at, at)]
    )


def test_a_file_that_does_not_hold_together(
    doubted: tuple[Model, States], tmp_path: Path
) -> None:
    data = doubted[0].to_dict()
    data["doubt"]["covariance"] = data["doubt"]["covariance"][:-1]
    data["id"] = content_id(data)
    path = tmp_path / "model.json"
    path.write_text(json.dumps(data))
    with pytest.raises(ModelError, match="covariance does not match") as caught:
        load_model(path)
    assert "$.doubt.covariance" in str(caught.value)
