"""The shares of effects by their definition: each alone, and together the error."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.model.effect_sum import INTERACTION, Combination
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import ArmStates
from tests.calibration.simulator import NJ
from tests.model.test_effects import STATES, variants

BATCH = ArmStates(NJ, STATES)
ALL = tuple(e for e in variants() if e.belongs_to() != "setup")


def drawn(effects: Combination) -> np.ndarray:
    """Draw parameters as large as they are expected to be."""
    rng = np.random.default_rng(3)
    return rng.standard_normal(len(effects.scales)) * effects.scales


def split(*effects: Effect) -> tuple[Combination, np.ndarray, dict[str, np.ndarray]]:
    """Return effects, their parameters and shares, by name."""
    whole = Combination(effects)
    p = drawn(whole)
    shares = whole.shares(BATCH, p)
    assert shares.shape == (len(STATES), len(whole.share_names), 3)
    named = dict(zip(whole.share_names, np.moveaxis(shares, 1, 0), strict=True))
    return whole, p, named


def test_shares_sum_to_the_error() -> None:
    whole, p, shares = split(*ALL)
    total = np.sum(list(shares.values()), axis=0)
    np.testing.assert_allclose(total, whole.error(BATCH, p), rtol=0, atol=1e-12)


def test_a_share_is_the_error_of_the_effect_alone() -> None:
    whole, p, shares = split(*ALL)
    names = [e.name for e in ALL]
    assert tuple(shares) == (*dict.fromkeys(names), INTERACTION)
    for name in set(names):
        own = np.repeat([n == name for n in names], [len(e.parameters()) for e in ALL])
        alone = whole.error(BATCH, np.where(own, p, 0.0))
        np.testing.assert_allclose(shares[name], alone, rtol=0, atol=1e-12)


def test_effects_of_one_name_have_one_share() -> None:
    curves = [e for e in ALL if e.name == "curve"]
    assert len(curves) > 1
    whole, p, shares = split(*curves)
    assert tuple(shares) == ("curve",)
    np.testing.assert_allclose(
        shares["curve"], whole.error(BATCH, p), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("name", dict.fromkeys(e.name for e in ALL))
def test_leaving_an_effect_out_takes_its_share_away(name: str) -> None:
    """But for the interaction: a product of two errors, and nothing else."""
    whole, p, shares = split(*ALL)
    stays = np.concatenate([np.full(len(e.parameters()), e.name != name) for e in ALL])
    change = whole.error(BATCH, p) - whole.error(BATCH, np.where(stays, p, 0.0))
    turned = max(np.abs(p).max(), 0.01)  # [rad] more than any joint or link is off
    size = np.linalg.norm(shares[name], axis=1)
    gap = np.linalg.norm(change - shares[name], axis=1)
    assert (gap <= turned * size + 1e-5).all()


def test_shares_are_first_order_parts_where_errors_are_small() -> None:
    """Interaction falls with the square of the errors, shares with the errors."""
    whole, p, shares = split(*ALL)
    scale = 1e-3
    small = np.moveaxis(whole.shares(BATCH, scale * p), 1, 0) / scale
    slopes = dict.fromkeys(shares, np.zeros((len(STATES), 3)))
    columns = whole.columns(BATCH)
    for effect, part in zip(whole.effects, whole.slices, strict=True):
        slopes[effect.name] = slopes[effect.name] + columns[:, :, part] @ p[part]
    for found, wanted in zip(small, slopes.values(), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-7)  # [m]
    assert np.abs(shares[INTERACTION]).max() > 1e-6  # [m]


def test_no_effects_have_no_shares() -> None:
    assert Combination(()).shares(BATCH, np.empty(0)).shape == (len(STATES), 0, 3)
