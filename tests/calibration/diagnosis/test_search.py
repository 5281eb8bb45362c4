"""Undeclared effects of virtual arms are found, and nothing is found where nothing is.

A small seeded selection of what `make undeclared` does at full size.
"""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.diagnosis.trace import trace
from postproc.calibration.regression import fit_effects
from postproc.model.combination import Combination
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.base_shift import rigid_columns
from postproc.model.kinematics import Batch
from postproc.model.model import COMPENSATED
from tests.calibration.planted import ARM, campaign, states_of, survey
from tests.undeclared_score import close, ok
from tests.undeclared_trial import run

PLANTED = [
    ("compliance", 300, 0.5),
    ("payload", 301, 0.5),
    ("transmission_free", 302, 0.5),
    ("coupling", 303, 1.0),
    ("load_backlash", 304, 1.0),
    ("warmup", 305, 1.0),
    ("windup", 306, 1.0),
    ("tool_shift", 307, 0.5),
    ("tracker_drift", 308, 1.0),
    ("worn_spot", 309, 1.0),
    ("joint_step", 313, 0.3),
    ("base_tilt", 314, 0.3),
    ("elastic_flank", 315, 0.5),
    ("azimuth", 316, 0.3),
    ("refraction", 317, 0.3),
    ("joint_product", 310, 1.0),
    ("hysteresis", 311, 1.0),
    ("two", 312, 1.0),
]


@pytest.mark.parametrize(("kind", "seed", "size"), PLANTED)
def test_an_undeclared_effect_is_named(kind: str, seed: int, size: float) -> None:
    trial = run(kind, seed, size)
    assert ok(trial), trial
    assert all(len(f["group"]) <= 2 for f in trial.found)  # type: ignore[arg-type]
    assert trial.true_mm[1] < trial.true_mm[0]
    assert close(trial) or trial.true_mm[1] < 0.02, trial.true_mm


@pytest.mark.parametrize(
    ("kind", "seed", "size"), [("tracker_drift", 308, 2.0), ("azimuth", 405, 1.0)]
)
def test_a_tracker_leaves_only_where_the_base_stands_unsure(
    kind: str, seed: int, size: float
) -> None:
    """A drift begins, and a circle points, anywhere: one rigid motion is not told."""
    c = campaign(seed, (kind,), size)
    after = trace(c.base_fit(), seed=0).search.fit
    fresh = survey(c.arm, seed + 10**6, 200)
    batch = Batch(ARM, states_of(fresh))
    keep = tuple(e for e in after.combination.effects if e.belongs_to() == "arm")
    values = after.values[after.combination.where("arm")]
    left = c.arm.error(fresh) - Combination(keep).error(batch, values)
    rigid = rigid_columns(batch).reshape(-1, 6)
    motion = np.linalg.lstsq(rigid, left.reshape(-1))[0]
    rest = left - (rigid @ motion).reshape(-1, 3)
    mean = [np.linalg.norm(e, axis=1).mean() * 1e3 for e in (left, rest)]
    informed = run("none", seed, 0.0).true_mm[2]
    assert mean[1] < 1.2 * informed
    assert mean[0] < 0.05


def test_what_may_be_the_trackers_is_told_and_not_compensated() -> None:
    """Nobody says where the tracker stands, so its error cannot be named."""
    c = campaign(410, ("azimuth",), 1.0)
    batch = Batch(ARM, c.states)
    fit = fit_effects(batch, c.position, propose(BASE_EFFECTS, ARM, c.states), None)
    found = trace(fit, seed=0)
    assert found.verdict == "unexplained"
    assert not {"azimuth", "refraction"} & {f.effect for f in found.findings}
    of_frame = [f for f in found.findings if f.settings.get("direction") == "base x"]
    assert of_frame and all(f.of_setup for f in of_frame)
    after = found.search.fit.combination
    told = [e for e in after.effects if e.belongs_to() in COMPENSATED]
    assert not any(e.settings().get("direction") == "base x" for e in told)


@pytest.mark.parametrize("seed", [320, 321, 322, 323, 324])
def test_nothing_is_found_where_nothing_is(seed: int) -> None:
    trial = run("none", seed, 0.0)
    assert trial.verdict == "noise", trial
    assert not trial.found
