"""What is known is what all readings together say, whatever order they came in."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from postproc.record.check_rows import CheckRows, place_check
from postproc.record.events import Event
from postproc.record.knowledge import OF_POSE, Knowledge
from tests.calibration.simulator import NJ
from tests.record.conftest import Drawn
from tests.record.drawn_robots import measure

WIDE = 0.1  # [m], [rad] prior of the tracker's place that is as good as none


def read(drawn: Drawn, seed: int) -> CheckRows:
    rng = np.random.default_rng(seed)
    rows = measure(drawn.robot, *drawn.poses, rng)
    return place_check(rows, NJ, drawn.model, "tracker")


def test_the_tracker_is_projected_out_as_by_a_wide_prior(drawn: Drawn) -> None:
    rows = read(drawn, 1)
    known = Knowledge.of(drawn.model, NJ).visiting(rows)
    found = known.expect(rows)
    S = found.columns @ known.covariance @ found.columns.T + rows.noise
    wide = np.linalg.inv(S + WIDE**2 * rows.placing @ rows.placing.T)
    shown = found.left @ wide @ found.left
    assert abs(found.statistic - shown) < 1e-3 * shown
    moved = rows.placing @ np.array([1e-3, -2e-3, 1e-3, 1e-4, 2e-4, -1e-4])
    assert moved @ found.precision @ moved < 1e-6 * moved @ np.linalg.inv(S) @ moved
    assert found.free == len(S) - 6


def test_two_checks_say_what_both_say_at_once(drawn: Drawn) -> None:
    """Updates one after the other are one generalised least squares fit."""
    one, other = read(drawn, 2), read(drawn, 3)
    begun = Knowledge.of(drawn.model, NJ).visiting(one)
    after = begun.update(one).update(other)
    parts = [begun.expect(rows, after.mean) for rows in (one, other)]
    H = np.concatenate([part.columns for part in parts])
    left = np.concatenate([part.left for part in parts])
    noise, placing = (
        block_diag(*(getattr(rows, name) for rows in (one, other)))
        for name in ("noise", "placing")
    )
    inverse = np.linalg.inv(H @ begun.covariance @ H.T + noise)
    known = inverse @ placing
    inverse -= known @ np.linalg.solve(placing.T @ known, known.T)
    together = begun.mean + begun.covariance @ H.T @ inverse @ left
    assert np.abs(H @ (after.mean - together)).max() < 1e-7  # [m]
    covariance = (
        begun.covariance - begun.covariance @ H.T @ inverse @ H @ begun.covariance
    )
    of_readings = np.diag(H @ covariance @ H.T)
    assert np.allclose(np.diag(H @ after.covariance @ H.T), of_readings, rtol=1e-3)


def test_a_pose_is_known_again_and_a_new_one_is_added(drawn: Drawn) -> None:
    rows = read(drawn, 4)
    first = Knowledge.of(drawn.model, NJ).update(rows)
    assert len(first.poses) == 10
    assert len(first.mean) == len(first.values) + 10 * OF_POSE
    assert first.visiting(rows) is first
    other = rows.states.with_(q=rows.states.q + 0.01)
    assert (first.find_poses(rows.states) >= 0).all()
    assert (first.find_poses(other) < 0).all()


def test_an_event_opens_what_it_may_have_changed_and_no_more(drawn: Drawn) -> None:
    known = Knowledge.of(drawn.model, NJ)
    names = known.model.effects.names
    wider = known.after(Event("remastered", (3,)))
    grown = np.flatnonzero(np.diag(wider.covariance) > np.diag(known.covariance))
    assert [names[k] for k in grown] == ["geometry.theta3"]
    based = known.after(Event("base"))
    grown = np.flatnonzero(np.diag(based.covariance) > np.diag(known.covariance))
    assert {names[k].partition("_")[0] for k in grown} == {"geometry.base"}


def test_what_is_written_is_the_model_with_what_is_known(drawn: Drawn) -> None:
    rows = read(drawn, 5)
    known = Knowledge.of(drawn.model, NJ).update(rows)
    model = known.to_model()
    assert np.array_equal(model.values, known.values)
    assert model.to_dict()["id"] != drawn.model.id
    before = np.diag(Knowledge.of(drawn.model, NJ).covariance)
    assert (np.diag(model.covariance) <= before * (1 + 1e-9)).all()
