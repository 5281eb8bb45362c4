"""The poses proposed next really tell apart what the rows so far cannot."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from postproc.calibration.diagnosis.investigate import Investigation, trace
from postproc.calibration.diagnosis.next_poses import poses_that_separate
from postproc.calibration.diagnosis.score import Score
from postproc.calibration.diagnosis.search import NEAR, JudgedAddition
from postproc.calibration.regression import fit_effects
from postproc.model.kinematics import ArmStates
from postproc.simulation import VirtualArrivals, stream
from tests.calibration.planted import (
    ARM,
    TRACKER,
    Campaign,
    campaign,
    states_of,
    survey,
)

ROWS = 90
POSES = 80


@pytest.fixture(scope="module")
def unsure() -> tuple[Campaign, Investigation]:
    """A spring on joint 2 that these rows cannot tell from a wrong gear ratio."""
    c = campaign(3200, ("counterbalance",), 2.0, rows=ROWS)
    return c, trace(c.base_fit(), seed=0)


def group(found: Investigation) -> tuple[Score, Score]:
    """Return the one addition and its closest rival."""
    (addition,) = found.search.additions
    (standing,) = found.standings
    assert isinstance(standing, JudgedAddition)
    return addition.score, standing.confusable[0]


def lead(c: Campaign, found: Investigation, more: VirtualArrivals | None) -> float:
    """Say how far the true cause is ahead of the other with more rows [nats]."""
    arrivals, position = c.arrivals, c.position
    if more is not None:
        joined = {
            f.name: np.concatenate([getattr(a, f.name) for a in (arrivals, more)])
            for f in fields(arrivals)
        }
        fresh = c.arm.measure(more, TRACKER, stream(1, "next"))
        arrivals, position = (
            VirtualArrivals(**joined),
            np.concatenate([position, fresh]),
        )
    batch = ArmStates(ARM, states_of(arrivals))
    evidence = {
        s.family.effect: fit_effects(
            batch,
            position,
            (*found.search.base.combination.effects, s.best.effect),
            tuple(TRACKER),
        ).log_evidence
        for s in group(found)
    }
    truth = evidence.pop("counterbalance")
    (other,) = evidence.values()
    return truth - other


@pytest.mark.slow
def test_measuring_the_proposed_poses_separates_a_group(
    unsure: tuple[Campaign, Investigation],
) -> None:
    c, found = unsure
    search = found.search
    _, rival = group(found)
    few, _ = poses_that_separate(search.fit, search.place(0), rival, seed=0)
    nats, q = poses_that_separate(search.fit, search.place(0), rival, 0, wanted=POSES)
    assert 0 < few < nats
    like = survey(c.arm, 1, POSES)
    later = {"order": like.order + ROWS, "time": like.time + c.arrivals.time.max()}
    before = lead(c, found, None)
    proposed = lead(c, found, replace(like, q=q, **later)) - before
    anywhere = lead(c, found, replace(like, **later)) - before
    assert proposed > 2 * NEAR
    assert proposed > 1.2 * anywhere
    assert 0.5 * nats < proposed < 2.0 * nats


def test_proposed_poses_lie_apart_within_the_surveyed_ranges(
    unsure: tuple[Campaign, Investigation],
) -> None:
    c, found = unsure
    search = found.search
    _, rival = group(found)
    _, q = poses_that_separate(search.fit, search.place(0), rival, seed=0)
    seen = c.states.q
    assert ((q >= seen.min(axis=0)) & (q <= seen.max(axis=0))).all()
    gap = np.abs(q[:, None] - q[None]) / np.ptp(seen, axis=0)
    assert (gap.max(axis=2) + np.eye(len(q)) > 0.1).all()
